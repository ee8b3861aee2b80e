"""What a motion asks of its axis: peaks and where they fall, mean squares, and which limits it breaks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import PlanError
from planners.splines.limits import OF_ORDER, AxisLimits
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

NAMES = ("position_m", "speed_m_s", "acceleration_m_s2", "jerk_m_s3")
LIMIT_EXCESS_REL = (
    1e-9  # share by which a peak may exceed its limit, and by which it counts as being at a joint
)
NO_LIMITS = AxisLimits()


class Range(NamedTuple):
    """One derivative over the motion; exact, never sampled."""

    low: float
    high: float
    peak: float  # largest absolute value
    peak_t_s: float  # the first instant it is met
    interval: int  # where that is; a peak at a point counts for the interval that ends there, if it is met on that side
    rms: float


class SplineAnalysis(NamedTuple):
    """Position, speed, acceleration and jerk of a motion, and a sentence for every limit broken."""

    duration_s: float
    position_m: Range
    speed_m_s: Range
    acceleration_m_s2: Range
    jerk_m_s3: Range
    warnings: tuple[str, ...]


def analyse(
    trajectory: Trajectory, times_s: ArrayLike | None = None, limits: AxisLimits = NO_LIMITS
) -> SplineAnalysis:
    """Intervals are those between times_s (N,) of the points, from 0 on; without them, the pieces of the trajectory.

    Steps at joints (a jerk without bound) are not in the ranges; Trajectory.continuous tells of them. Raises PlanError for
    times that do not increase from 0.
    """
    t = trajectory.breaks_s if times_s is None else np.asarray(times_s, dtype=np.float64)
    if t.ndim != 1 or t.size < 2 or t[0] != 0.0 or not np.all(np.diff(t) > 0.0):
        raise PlanError(
            f"times_s of shape {t.shape} for an analysis; must be (N,), increasing from 0: subtract the first time"
        )
    position, speed, acceleration, jerk = (
        _range(trajectory, order, t) for order in range(len(NAMES))
    )
    warnings = _position_warnings(position, limits) + _peak_warnings(
        (speed, acceleration, jerk), limits
    )
    return SplineAnalysis(
        trajectory.duration_s, position, speed, acceleration, jerk, tuple(warnings)
    )


def _range(trajectory: Trajectory, order: int, times: FloatArray) -> Range:
    (low, high), (peak, at) = trajectory.extent(order), trajectory.peak(order)
    near = LIMIT_EXCESS_REL * trajectory.duration_s
    interval = int(np.clip(np.searchsorted(times, at + near) - 1, 0, times.size - 2))
    if interval and abs(at - times[interval]) <= near and _met_before(trajectory, order, at, peak):
        interval -= 1
    return Range(low, high, peak, at, interval, trajectory.rms(order))


def _met_before(trajectory: Trajectory, order: int, at: float, peak: float) -> bool:
    """Whether the piece that ends at this instant has the peak too."""
    k = int(np.argmin(np.abs(trajectory.breaks_s[1:] - at)))
    piece = trajectory.pieces[k]
    return (
        abs(float(piece.at(np.array(piece.duration_s), order))) >= (1.0 - LIMIT_EXCESS_REL) * peak
    )


def _position_warnings(position: Range, limits: AxisLimits) -> list[str]:
    reach = LIMIT_EXCESS_REL * position.peak
    sides = (
        (position.high, "<=", limits.position_max_m, position.high > limits.position_max_m + reach),
        (position.low, ">=", limits.position_min_m, position.low < limits.position_min_m - reach),
    )
    return [
        f"position_m reaches {value:.6g}; must be {relation} {bound:.6g}: move a point, or take a law that overshoots less"
        for value, relation, bound, broken in sides
        if broken
    ]


def _peak_warnings(ranges: Sequence[Range], limits: AxisLimits) -> list[str]:
    return [
        f"|{NAMES[order]}| reaches {here.peak:.6g} at {here.peak_t_s:.6g} s in interval {here.interval}; "
        f"must be <= {limits.of_order(order):.6g}: give that interval more time"
        for order, here in zip(OF_ORDER, ranges, strict=True)
        if here.peak > (1.0 + LIMIT_EXCESS_REL) * limits.of_order(order)
    ]
