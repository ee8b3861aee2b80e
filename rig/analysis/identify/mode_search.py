"""Choice of the model: modes and terms are added one at a time, while the record asks for them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_fit import (
    FittedDecay,
    fit,
    strongest_first,
    term_gains,
    with_term,
    without_spikes,
)
from rig.analysis.identify.decay_model import MODE_SIZE, ParameterLayout, mode_sum
from rig.analysis.identify.matrix_pencil import Pencil, Pole, order_by_gap, pencil, poles
from rig.analysis.identify.sampled import Sampled
from rig.analysis.identify.spectrum import strongest_frequency_hz

FloatArray = npt.NDArray[np.float64]

SAMPLES_PER_PERIOD = 24.0  # of the pencil's grid
MIN_GAIN = 16.0  # variances; a term of noise reaches it once in 16,000
MIN_MODE_GAIN = 40.0  # variances, of the four parameters of a mode
MIN_NEW_PERIODS = 1.0  # of a mode beside the first; less is a drift
MAX_EXTRA_DAMPING = 0.25  # damping ratio; more is a transient, not a mode
MAX_STEPS = 8
MANY_SAMPLES = 20_000


def first_fit(record: Sampled, *, elliptic: bool) -> FittedDecay:
    """Fit one mode, from the strongest line of the spectrum or the strongest pole."""
    layout = ParameterLayout(1)
    frequency_hz = strongest_frequency_hz(record, record.values)
    starts = [_sinusoid(record, [frequency_hz])]
    found = poles(pencil(record, SAMPLES_PER_PERIOD, frequency_hz), 3)
    if found:
        starts.append(_damped(record, found[:1]))
    fits = [fit(record, layout, start, elliptic=elliptic) for start in starts if start is not None]
    return min(fits, key=_cost)


def search(found: FittedDecay, modes: int | None, highest: int) -> FittedDecay:
    """Add terms and modes while they gain; modes given: exactly so many, terms by gain."""
    found = without_spikes(found)
    highest = highest if modes is None else modes
    for _ in range(MAX_STEPS):
        candidates = [] if found.is_exact and modes is None else _larger(found, highest, modes)
        if not candidates:
            break
        gains = [_gain_per_parameter(found, larger) for larger in candidates]
        best = candidates[int(np.argmax(gains))]
        must = modes is not None and best.layout.modes > found.layout.modes
        if not must and best.criterion > found.criterion - 2:
            break
        found = without_spikes(best)
    return strongest_first(found)


def _larger(found: FittedDecay, highest: int, modes: int | None) -> list[FittedDecay]:
    """Fit the models one step larger that gain enough."""
    candidates = []
    gains = term_gains(found)
    if gains:
        term = max(gains, key=lambda name: gains[name])
        if gains[term] > MIN_GAIN:
            candidates.append(with_term(found, term))
    if found.layout.modes < highest and not found.is_large and _wants_mode(found):
        candidates += _with_mode(found, is_asked=modes is not None)
    return [larger for larger in candidates if _gain(found, larger) > MIN_GAIN]


def _wants_mode(found: FittedDecay) -> bool:
    """Tell if the residual holds a line, or more than white noise does."""
    spread = np.fft.rfft(found.residual - found.residual.mean())
    power = np.abs(spread[1:]) ** 2
    if not power.any():
        return False
    line = float(np.max(power) / np.mean(power))
    count = power.size / found.record.correlated_frames
    return line / found.record.correlated_frames > math.log(count) + 7.0


def _with_mode(found: FittedDecay, *, is_asked: bool) -> list[FittedDecay]:
    """Fit one mode more: from the poles of the record, and from the line in the residual.

    Unless asked for, only where the singular values of the record stand out for so many.
    """
    count = found.layout.modes + 1
    frequencies = [found.layout.mode(found.p, k)[0] / (2 * math.pi) for k in range(count - 1)]
    decomposed = pencil(found.record, SAMPLES_PER_PERIOD, max(frequencies))
    if not is_asked and order_by_gap(decomposed, _grid_noise(found, decomposed), count) < count:
        return []
    starts = []
    for order in (2 * count, 2 * count + 1, 2 * count + 3):
        start = _from_poles(found.record, decomposed, order, count)
        if start is not None:
            starts.append(start)
    line_hz = strongest_frequency_hz(found.record, found.residual)
    extra = _sinusoid(found.record, [line_hz], found.residual)
    if extra is not None and line_hz * found.record.duration_s > MIN_NEW_PERIODS:
        modes = found.p[: MODE_SIZE * (count - 1)]
        starts.append(np.concatenate([modes, extra[:MODE_SIZE], [found.p[found.layout.offset]]]))
    drifts = tuple(term for term in found.layout.terms if term.startswith("trend"))
    layout = ParameterLayout(count, drifts)
    drift = np.zeros(len(drifts))
    whole = [np.append(start, drift) for start in starts]
    whole = [start for start in whole if layout.is_decay(start)]
    if found.record.values.size > MANY_SAMPLES:
        whole = _best_starts(found, layout, whole)
    fits = [fit(found.record, layout, start, elliptic=found.elliptic) for start in whole]
    return [larger for larger in fits if _is_mode_gained(found, larger)]


def _best_starts(
    found: FittedDecay, layout: ParameterLayout, starts: list[FloatArray]
) -> list[FloatArray]:
    """Keep the start of least squares where a fit of each would take long."""
    model = mode_sum(found.record, layout, elliptic=found.elliptic)
    costs = [float(np.sum((found.record.values - model(start)[0]) ** 2)) for start in starts]
    return [starts[int(np.argmin(costs))]] if starts else []


def _grid_noise(found: FittedDecay, decomposed: Pencil) -> float:
    """White noise on the grid of the pencil, which averages samples where it is coarser."""
    record = found.record
    averaged = max(1.0, decomposed.step_s / record.step_s / record.correlated_frames)
    return max(found.residual_noise(), record.quantum / math.sqrt(12)) / math.sqrt(averaged)


def _is_mode_gained(found: FittedDecay, larger: FittedDecay) -> bool:
    """Tell if a mode more explains the record better, and none but the first dies at once."""
    ordered = strongest_first(larger)
    for k in range(1, ordered.layout.modes):
        w0, decay = ordered.model.natural(ordered.p, k)
        if abs(decay) > MAX_EXTRA_DAMPING * w0:
            return False
    return _gain(found, larger) > MIN_MODE_GAIN


def _from_poles(record: Sampled, decomposed: Pencil, order: int, count: int) -> FloatArray | None:
    if order > decomposed.right.shape[0]:
        return None
    found = poles(decomposed, order)
    return _damped(record, found[:count]) if len(found) >= count else None


def _damped(record: Sampled, found: list[Pole]) -> FloatArray | None:
    """Make a start of poles; amplitudes, phases and offset by linear least squares."""
    tau = record.t_s - record.t_s[0]
    columns = []
    for pole in found:
        w0 = 2 * math.pi * pole.frequency_hz
        decay = w0 * pole.damping_ratio
        wd = w0 * math.sqrt(1 - pole.damping_ratio**2)
        envelope = np.exp(np.clip(-decay * tau, -50, 50))
        columns += [envelope * np.cos(wd * tau), envelope * np.sin(wd * tau)]
    solution = np.linalg.lstsq(np.column_stack([*columns, np.ones_like(tau)]), record.values)[0]
    start = np.empty(MODE_SIZE * len(found) + 1)
    for k, pole in enumerate(found):
        a, b = solution[2 * k], solution[2 * k + 1]
        w0 = 2 * math.pi * pole.frequency_hz
        wd = w0 * math.sqrt(1 - pole.damping_ratio**2)
        amplitude, phase = max(math.hypot(a, b), 1e-12), math.atan2(-b, a)
        start[MODE_SIZE * k : MODE_SIZE * (k + 1)] = [wd, w0 * pole.damping_ratio, amplitude, phase]
    start[-1] = solution[-1]
    return start


def _sinusoid(
    record: Sampled, frequencies_hz: list[float], values: FloatArray | None = None
) -> FloatArray | None:
    """Make a start of undamped sinusoids."""
    if values is not None:
        record = replace(record, values=values)
    return _damped(record, [Pole(hz, 0.0, 0.0, 0.0) for hz in frequencies_hz])


def _gain(found: FittedDecay, larger: FittedDecay) -> float:
    """Reduction of the squares in variances of the larger model."""
    return (_cost(found) - _cost(larger)) / larger.variance / found.record.correlated_frames


def _gain_per_parameter(found: FittedDecay, larger: FittedDecay) -> float:
    return _gain(found, larger) / (larger.layout.size - found.layout.size)


def _cost(found: FittedDecay) -> float:
    return float(found.residual @ found.residual)
