"""Fit of a pendulum beyond small swings: from its turning points, over a growing window."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_fit import FittedDecay, fit, without_spikes
from rig.analysis.identify.decay_model import ParameterLayout
from rig.analysis.identify.errors import RefusedError
from rig.analysis.identify.identification import Reason
from rig.analysis.identify.large_swing import natural_over_swing
from rig.analysis.identify.mode_search import search
from rig.analysis.identify.sampled import MIN_SAMPLES, Sampled
from rig.analysis.identify.turning_points import TurningPoints

FloatArray = npt.NDArray[np.float64]

LARGE_RAD = 0.3  # where the equation is integrated instead of its series
FIRST_PERIODS = 3.0
MAX_LATER = 5  # periods
MIN_HALF_SWINGS = 7  # after a later start
GOOD_RESIDUAL = 3.0  # times the noise
MAX_PERIODS = 25.0  # integration costs time in proportion; the largest swings say most


def large_fit(
    record: Sampled, points: TurningPoints, start: int, notes: list[Reason]
) -> FittedDecay:
    """Fit the integrated pendulum from a turning point on; raises RefusedError when too short.

    A start a period later is taken where it leaves less than half: no hand or latch is in it.
    """
    found = _fit_from(record, points, start, notes)
    for _ in range(MAX_LATER):
        start += 2
        if points.sample.size - start < MIN_HALF_SWINGS:
            break
        if math.sqrt(found.variance) < GOOD_RESIDUAL * found.residual_noise():
            break
        later = _fit_from(record, points, start, [])
        if later.variance > found.variance / 4:
            break
        found = later
    return found


def _fit_from(
    record: Sampled, points: TurningPoints, start: int, notes: list[Reason]
) -> FittedDecay:
    p = _start(points, start)
    first = int(points.sample[start])
    period_s = 2 * math.pi / p[0]
    whole = record.part(first, record.values.size)
    if whole.duration_s > MAX_PERIODS * period_s:
        stop = int(np.searchsorted(whole.t_s, whole.t_s[0] + MAX_PERIODS * period_s))
        whole = whole.part(0, stop)
        text = f"the first {MAX_PERIODS:.0f} periods of a large swing are integrated"
        notes.append(Reason("large_swing", text, False))
    if whole.values.size < MIN_SAMPLES:
        raise RefusedError(
            "too_short", f"{whole.values.size} samples after the largest swing: record longer"
        )
    layout = ParameterLayout(1)
    periods = FIRST_PERIODS
    while True:
        stop = int(np.searchsorted(whole.t_s, whole.t_s[0] + periods * period_s))
        is_whole = stop >= 0.7 * whole.values.size
        window = whole if is_whole else whole.part(0, max(stop, MIN_SAMPLES))
        found = fit(window, layout, p, elliptic=True, is_large=True)
        found = search(found, 1, 1)
        if is_whole:
            return without_spikes(found)
        p, layout = found.p, found.layout
        periods *= 2


def _start(points: TurningPoints, start: int) -> FloatArray:
    """Estimate the parameters from the turning points."""
    t, y = points.t_s[start:], points.values[start:]
    half_swings = points.half_swings[start:]
    count = min(6, half_swings.size)
    if count < 2:
        raise RefusedError(
            "too_short",
            f"{count} half swings after the largest turning point; need 2: record longer",
        )
    natural = []
    for k in range(1, count):  # the first one may begin in mid-swing
        swing = min(float(half_swings[k]), 3.0)
        natural.append(math.pi / (t[k + 1] - t[k]) * natural_over_swing(swing))
    w0 = float(np.median(natural))
    logs = np.log(half_swings[:count])
    decay = float(-np.polyfit(t[:count] - t[0], logs, 1)[0])
    decay = min(max(decay, 0.0), 0.3 * w0)
    offset = float(np.median((y[:-2] + 2 * y[1:-1] + y[2:]) / 4)) if y.size > 2 else 0.0
    amplitude = min(abs(float(y[0]) - offset), 3.1)
    phase = 0.0 if y[0] > offset else math.pi
    return np.array([w0, decay, amplitude, phase, offset])
