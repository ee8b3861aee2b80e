"""Analysis of a spline: peaks with their instants, mean squares, and exceeded limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import PlanError
from planners.splines.limits import LIMIT_NAMES, AxisLimits
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

NAMES = ("position_m", "speed_m_s", "acceleration_m_s2", "jerk_m_s3")
LIMIT_EXCESS_REL = 1e-9  # of a limit: larger excess is reported; of the duration: at a joint
NO_LIMITS = AxisLimits()


class Range(NamedTuple):
    """Range of one derivative over the motion; exact, not sampled."""

    low: float
    high: float
    peak: float  # largest absolute value
    peak_t_s: float  # the first instant it is reached
    interval: int  # of that instant; the one that ends there for a peak on that side of a point
    rms: float


class SplineAnalysis(NamedTuple):
    """Ranges of position to jerk of a motion, and a warning for every exceeded limit."""

    duration_s: float
    position_m: Range
    speed_m_s: Range
    acceleration_m_s2: Range
    jerk_m_s3: Range
    warnings: tuple[str, ...]


def analyse(
    trajectory: Trajectory, times_s: ArrayLike | None = None, limits: AxisLimits = NO_LIMITS
) -> SplineAnalysis:
    """Compute the ranges of a motion and compare them with the limits.

    Intervals lie between times_s (N,) of the points, from 0 on; without times they are the pieces
    of the trajectory. Steps at joints (infinite jerk) are not in the ranges; see
    Trajectory.continuous. Raises PlanError for times that do not increase from 0.
    """
    t = trajectory.breaks_s if times_s is None else np.asarray(times_s, dtype=np.float64)
    if t.ndim != 1 or t.size < 2 or t[0] != 0.0 or not np.all(np.diff(t) > 0.0):
        raise PlanError(
            f"times_s of shape {t.shape} for an analysis; must be (N,), increasing from 0: "
            "subtract the first time"
        )
    position, speed, acceleration, jerk = (
        _range(trajectory, order, t) for order in range(len(NAMES))
    )
    warnings = _position_warnings(position, limits)
    warnings += _peak_warnings((speed, acceleration, jerk), limits)
    return SplineAnalysis(
        trajectory.duration_s, position, speed, acceleration, jerk, tuple(warnings)
    )


def _range(trajectory: Trajectory, order: int, times: FloatArray) -> Range:
    low, high = trajectory.extent(order)
    peak, at = trajectory.peak(order)
    near = LIMIT_EXCESS_REL * trajectory.duration_s
    interval = int(np.clip(np.searchsorted(times, at + near) - 1, 0, times.size - 2))
    at_point = interval > 0 and abs(at - times[interval]) <= near
    if at_point and _is_reached_before(trajectory, order, at, peak):
        interval -= 1
    return Range(low, high, peak, at, interval, trajectory.rms(order))


def _is_reached_before(trajectory: Trajectory, order: int, at: float, peak: float) -> bool:
    """Test that the piece that ends at this instant reaches the peak too."""
    k = int(np.argmin(np.abs(trajectory.breaks_s[1:] - at)))
    piece = trajectory.pieces[k]
    end = float(piece.at(np.array(piece.duration_s), order))
    return abs(end) >= (1.0 - LIMIT_EXCESS_REL) * peak


def _position_warnings(position: Range, limits: AxisLimits) -> list[str]:
    tolerance = LIMIT_EXCESS_REL * position.peak
    warnings = []
    if position.high > limits.position_max_m + tolerance:
        warnings.append(_position_warning(position.high, "<=", limits.position_max_m))
    if position.low < limits.position_min_m - tolerance:
        warnings.append(_position_warning(position.low, ">=", limits.position_min_m))
    return warnings


def _position_warning(value: float, relation: str, limit: float) -> str:
    return (
        f"position_m reaches {value:.6g}; must be {relation} {limit:.6g}: "
        "move a point, or choose a spline with less overshoot"
    )


def _peak_warnings(ranges: Sequence[Range], limits: AxisLimits) -> list[str]:
    warnings = []
    for (order, name), found in zip(LIMIT_NAMES.items(), ranges, strict=True):
        limit = limits.peak_limit(order)
        if found.peak > (1.0 + LIMIT_EXCESS_REL) * limit:
            warnings.append(
                f"|{name}| reaches {found.peak:.6g} at {found.peak_t_s:.6g} s "
                f"in interval {found.interval}; must be <= {limit:.6g}: "
                "give that interval more time"
            )
    return warnings
