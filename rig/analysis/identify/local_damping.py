"""Frequency and damping in parts of a window, by one step of the fit from the common model."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_fit import FittedDecay
from rig.analysis.identify.decay_model import MODE_SIZE
from rig.analysis.identify.identification import DampingAt
from rig.analysis.identify.least_squares import influence, unit_covariance

FloatArray = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

MIN_PERIODS = 1.0  # of a part, below which offset and swing cannot be told apart
MAX_PARTS = 8
PERIODS_PER_PART = 2.0
MIN_AMPLITUDE_NOISE = 0.5  # of a part's amplitude over the noise


class Shift(NamedTuple):
    """A quantity in one part of the window, as its difference from the fit."""

    value: float
    sigma: float


def half_shifts(found: FittedDecay) -> tuple[list[Shift], list[Shift]] | None:
    """Estimate frequency [Hz] and damping ratio of the first mode in two parts of the window.

    The parts hold the same information on the decay rate; None where one of them is too short.
    """
    weight = np.cumsum(found.model.amplitude(found.p, 0, found.tau) ** 2)
    if not weight[-1] > 0:
        return None
    middle = int(np.searchsorted(weight, weight[-1] / 2))
    parts = (np.arange(middle), np.arange(middle, found.tau.size))
    w0, _ = found.model.natural(found.p, 0)
    for part in parts:
        too_few = part.size < 2 * (MODE_SIZE * found.layout.modes + 1) + 4
        if too_few or np.ptp(found.tau[part]) * w0 < 2 * math.pi * MIN_PERIODS:
            return None
    first, second = (_shifts(found, part) for part in parts)
    return first, second


def damping_over_amplitude(found: FittedDecay, excess: float) -> tuple[DampingAt, ...]:
    """Estimate the damping ratio of the first mode in up to eight parts of the window.

    excess: variance of the noise near the mode over that of white noise.
    """
    w0, _ = found.model.natural(found.p, 0)
    periods = found.tau[-1] * w0 / (2 * math.pi)
    count = min(MAX_PARTS, int(periods / PERIODS_PER_PART))
    if count < 2:
        return ()
    noise = math.sqrt(found.variance)
    rows = []
    edges = np.searchsorted(found.tau, np.linspace(0, found.tau[-1], count + 1))
    edges[-1] = found.tau.size
    for first, stop in pairwise(edges):
        part = np.arange(first, stop)
        if part.size < 2 * (MODE_SIZE * found.layout.modes + 1) + 4:
            continue
        middle = found.tau[part[part.size // 2]]
        amplitude = float(found.model.amplitude(found.p, 0, np.array([middle]))[0])
        if amplitude < MIN_AMPLITUDE_NOISE * noise:
            continue
        _, shift = _shifts(found, part)
        damping = found.model.damping_ratio(found.p, 0, amplitude) + shift.value
        rows.append(DampingAt(amplitude, damping, shift.sigma * math.sqrt(excess)))
    return tuple(rows)


def _shifts(found: FittedDecay, part: Indices) -> list[Shift]:
    """Solve one Gauss-Newton step for the modes and the offset on a part of the samples."""
    columns = found.jacobian[part, : MODE_SIZE * found.layout.modes + 1]
    inverse = influence(columns)
    record = found.record
    tau = found.tau[part] - found.tau[part[0]]
    unit = unit_covariance(inverse, tau, record.correlated_frames, record.frame_period_s)
    step = inverse @ found.residual[part]
    sigma = np.sqrt(found.variance * np.diag(unit))
    w0, _ = found.model.natural(found.p, 0)
    return [
        Shift(float(step[0]) / (2 * math.pi), float(sigma[0]) / (2 * math.pi)),
        Shift(float(step[1]) / w0, float(sigma[1]) / w0),
    ]
