"""The strongest mode by other methods: matrix pencil, logarithmic decrement, windowed FFT."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_fit import FittedDecay
from rig.analysis.identify.identification import Mode, SecondOpinion
from rig.analysis.identify.large_swing import natural_over_swing
from rig.analysis.identify.matrix_pencil import Pencil, pencil, poles
from rig.analysis.identify.sampled import Sampled
from rig.analysis.identify.spectrum import windowed_peak_hz
from rig.analysis.identify.turning_points import turning_points

FloatArray = npt.NDArray[np.float64]

SAMPLES_PER_PERIOD = 24.0
MIN_SWING = 0.1  # of the first half swing; the decrement ends where less is left


def window_pencil(record: Sampled, frequency_hz: float) -> Pencil:
    """Decompose the window for second opinion and stabilisation diagram."""
    return pencil(record, SAMPLES_PER_PERIOD, frequency_hz)


def second_opinion(found: FittedDecay, decomposed: Pencil, mode: Mode) -> SecondOpinion:
    """Estimate the first mode by other methods; of a pendulum corrected to small swings."""
    swing_hz = mode.frequency_hz
    correction = 1.0
    if found.elliptic:
        correction = natural_over_swing(min(mode.at_amplitude, 3.0))
    order = 2 * found.layout.modes + 1
    near = poles(decomposed, min(order, decomposed.right.shape[0]))
    frequency_hz = damping = math.nan
    if near:
        pole = min(near, key=lambda pole: abs(pole.frequency_hz * correction - swing_hz))
        frequency_hz, damping = pole.frequency_hz * correction, pole.damping_ratio
    decrement, periods = _decrement(found.record, swing_hz / correction)
    return SecondOpinion(
        frequency_hz=frequency_hz,
        damping_ratio=damping,
        frequency_difference_hz=frequency_hz - mode.frequency_hz,
        damping_difference=damping - mode.damping_ratio,
        decrement_damping_ratio=decrement,
        decrement_periods=periods,
        hann_peak_hz=windowed_peak_hz(found.record, found.record.values, "hann"),
        hamming_peak_hz=windowed_peak_hz(found.record, found.record.values, "hamming"),
        fft_bin_hz=1 / found.record.duration_s,
    )


def _decrement(record: Sampled, frequency_hz: float) -> tuple[float, int]:
    """Compute the damping ratio of the logarithmic decrement, and its number of periods."""
    half_swings = turning_points(record, frequency_hz).half_swings
    if half_swings.size < 3:
        return math.nan, 0
    usable = int(np.count_nonzero(half_swings > MIN_SWING * half_swings[0]))
    periods = (usable - 1) // 2
    if periods < 1 or not half_swings[2 * periods] > 0:
        return math.nan, 0
    decrement = math.log(half_swings[0] / half_swings[2 * periods]) / periods
    return decrement / math.hypot(2 * math.pi, decrement), periods
