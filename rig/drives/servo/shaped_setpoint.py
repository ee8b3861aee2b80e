"""Sampled input shaping of setpoints: a delay line with impulses on whole samples.

An impulse between two samples is split such that the response of the mode is unchanged. With
eigenvalue s + j w, x = time of the impulse after the earlier sample and h = sample time,

    e^(-s x) sin(w (h - x)) / sin(w h)  at the earlier sample,
    e^(s (h - x)) sin(w x) / sin(w h)   at the later sample

excite the same vibration (digital shaper of Murphy and Watanabe 1992, here for any impulses). The
amplitudes are divided by their sum afterwards: V = 0 stays 0 to rounding and amplitudes keep their
sign. A split in proportion, x / h and 1 - x / h, would leave up to
A (w h)^2 / 8 of an impulse A: 0.125 % at w h = 0.1. The split used here also differs by a
second-order term, but only away from the frequency of the mode. Setpoints may be held between
samples or connected by lines.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planners.errors import unknown_name
from planners.shapers import SHAPERS, Shaper, convolve, insensitivity, residual
from planners.trajectories.pieces import FloatArray
from rig.drives.servo.block import check_period
from rig.drives.servo.errors import (
    BeyondNyquist,
    ServoError,
    check_below_nyquist,
    check_datum,
    check_range,
)
from rig.drives.servo.loops import PolePair
from rig.drives.servo.setpoint import MotorSetpoint

MAX_DAMPING = 0.99  # damping ratio of a mode; above it no shaper is needed
MAX_DELAY_SAMPLES = 1_000_000  # length of the delay line
SAMPLE_TOLERANCE = 1e-6  # share of the sample time; an impulse this close is on the sample
# sum of the split amplitudes; positive ones of an undamped mode sum to 1 or more
MIN_AMPLITUDE_SUM = 0.5
# vibration by an impulse relative to the largest one; impulses below it are left out
NEGLIGIBLE_SWING_REL = 1e-13


class ShaperFacts(NamedTuple):
    """Effect of a shaper on one mode, see planners.shapers."""

    residual: float  # V at the mode
    insensitivity: float  # relative width of the frequency band around the mode with V <= 5 %
    duration_s: float


def eigenvalue_1_s(mode: PolePair) -> complex:
    """Compute the eigenvalue -zeta w + j w sqrt(1 - zeta^2) of a mode.

    Raises ServoError for a mode that hardly oscillates or is unstable.
    """
    check_datum("frequency_rad_s", mode.frequency_rad_s)
    check_range("damping", mode.damping, 0.0, MAX_DAMPING, "above it no shaper is needed")
    return mode.frequency_rad_s * complex(-mode.damping, math.sqrt(1.0 - mode.damping**2))


def design_shaper(name: str, modes: Sequence[PolePair], period_s: float) -> Shaper:
    """Convolve the shapers of all modes, with impulses on whole samples.

    One of SHAPERS for each mode: V = 0 at every mode if the shaper has V = 0. Raises PlanError for
    an unknown name and for a damping ratio too high for this shaper, ServoError for modes that do
    not oscillate, BeyondNyquist for a sample time that is too long for one of them.
    """
    if name not in SHAPERS:
        raise unknown_name("shaper", name, SHAPERS)
    if not modes:
        raise ServoError(
            f"modes of shaper {name} = (); must be one or more: "
            "give the oscillatory modes of the joint"
        )
    return convolve(
        *(place_on_samples(SHAPERS[name](eigenvalue_1_s(mode)), mode, period_s) for mode in modes)
    )


def place_on_samples(shaper: Shaper, mode: PolePair, period_s: float) -> Shaper:
    """Move the impulses of a shaper to whole sample times.

    Up to twice as many impulses; at most a sample longer. The residual vibration of the mode,
    relative to the unshaped one at the same instant, is that of the shaper over the sum of the
    split amplitudes. Raises BeyondNyquist, and ServoError for a delay of more than
    MAX_DELAY_SAMPLES.
    """
    check_period(period_s)
    rate = eigenvalue_1_s(mode)
    check_below_nyquist(
        "damped frequency of a shaper's mode", rate.imag, period_s, "reduce the sample time"
    )
    check_range(
        "samples of delay",
        float(shaper.times_s[-1] / period_s),
        0.0,
        MAX_DELAY_SAMPLES,
        "increase the sample time",
    )
    line = _split_impulses(shaper, rate, period_s)
    total = float(line.sum())
    if not total > MIN_AMPLITUDE_SUM:
        raise BeyondNyquist(
            f"impulses of both signs on samples of {period_s:g} s sum to {total:.4g}; "
            f"must be > {MIN_AMPLITUDE_SUM:g}: reduce the sample time, or use zv, which has no "
            "negative impulses"
        )
    swings = np.abs(line) * np.exp(-rate.real * period_s * np.arange(line.size))
    kept = np.flatnonzero(swings > NEGLIGIBLE_SWING_REL * swings.max())
    return Shaper(line[kept] / total, period_s * kept.astype(np.float64))


def _split_impulses(shaper: Shaper, rate_1_s: complex, period_s: float) -> FloatArray:
    """Compute an amplitude for every sample up to the one after the last impulse."""
    decay, w = rate_1_s.real, rate_1_s.imag
    samples = shaper.times_s / period_s  # (n,)
    before = np.floor(samples).astype(np.intp)
    late_s = (samples - before) * period_s
    early_s = period_s - late_s
    sine = math.sin(w * period_s)
    line: FloatArray = np.zeros(int(before[-1]) + 2)
    np.add.at(
        line, before, shaper.amplitudes * np.exp(-decay * late_s) * np.sin(w * early_s) / sine
    )
    np.add.at(
        line, before + 1, shaper.amplitudes * np.exp(decay * early_s) * np.sin(w * late_s) / sine
    )
    return line


def analyse_shaper(shaper: Shaper, mode: PolePair) -> ShaperFacts:
    """Compute residual, insensitivity and duration of any shaper at one mode.

    Raises ServoError for a mode that does not oscillate.
    """
    rate = eigenvalue_1_s(mode)
    width = insensitivity(lambda _: shaper, rate)
    return ShaperFacts(float(residual(shaper, rate)), width, float(shaper.times_s[-1]))


class ShapedSetpoint:
    """Weighted sum of present and past setpoints, by the impulses of a shaper.

    Starts at rest at angle 0. The work of a step depends on the number of impulses, not on the
    delay.
    """

    def __init__(self, shaper: Shaper, period_s: float) -> None:
        """Take a shaper of design_shaper() or place_on_samples() with this sample time.

        Raises ServoError for impulses between samples.
        """
        check_period(period_s)
        samples = shaper.times_s / period_s
        delays = np.rint(samples).astype(np.intp)
        off = int(np.argmax(np.abs(samples - delays)))
        if not abs(samples[off] - delays[off]) <= SAMPLE_TOLERANCE:
            raise ServoError(
                f"times_s = {shaper.times_s[off]} of impulse {off} is {samples[off]:.6f} samples "
                f"of {period_s:g} s; must be a whole number: design the shaper for this sample "
                "time, or call place_on_samples"
            )
        self._taps: list[tuple[float, int]] = list(
            zip(shaper.amplitudes.tolist(), delays.tolist(), strict=True)
        )
        self._line = [MotorSetpoint(0.0)] * (int(delays[-1]) + 1)  # ring buffer
        self._now = 0  # index of the next setpoint; older ones lie before it

    def step(self, setpoint: MotorSetpoint) -> MotorSetpoint:
        """Compute the shaped setpoint of this sample from the unshaped one."""
        line, now = self._line, self._now
        line[now] = setpoint
        angle = speed = acceleration = 0.0
        for amplitude, delay in self._taps:
            then = line[now - delay]  # an index below 0 wraps around
            angle += amplitude * then[0]
            speed += amplitude * then[1]
            acceleration += amplitude * then[2]
        self._now = now + 1 if now + 1 < len(line) else 0
        return MotorSetpoint(angle, speed, acceleration)

    def reset(self) -> None:
        """Set the state to rest at angle 0."""
        self._line[:] = [MotorSetpoint(0.0)] * len(self._line)
        self._now = 0
