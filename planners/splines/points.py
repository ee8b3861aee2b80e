"""Via points: required positions of an axis at given times."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners import bounds
from planners.errors import PlanError, check_range
from planners.trajectories.pieces import FloatArray

MAX_TIME_S = 1e12  # from any origin
MIN_INTERVAL_REL = 1e-9  # of the total time; a shorter interval is an error of the table


class ViaPoints(NamedTuple):
    """Positions at strictly increasing times."""

    times_s: FloatArray  # (N,)
    points_m: FloatArray  # (N,)

    @property
    def durations_s(self) -> FloatArray:
        """Durations of the intervals: (N - 1,)."""
        return np.diff(self.times_s)

    @property
    def slopes_m_s(self) -> FloatArray:
        """Mean speeds of the intervals: (N - 1,)."""
        return np.diff(self.points_m) / self.durations_s


class End(NamedTuple):
    """End condition of a spline; rest by default."""

    speed_m_s: float = 0.0
    acceleration_m_s2: float = 0.0


REST = End()


def via_points(
    law: str, times_s: ArrayLike, points_m: ArrayLike, min_points: int, ends: tuple[End, ...] = ()
) -> ViaPoints:
    """Check the points and end conditions of a spline law.

    Raises PlanError, with law, value and bound, unless there are at least min_points, all numbers
    are within bounds, and the times increase by more than MIN_INTERVAL_REL of the total.
    """
    t, q = np.asarray(times_s, dtype=np.float64), np.asarray(points_m, dtype=np.float64)
    if t.ndim != 1 or t.shape != q.shape:
        raise PlanError(
            f"{law}: times_s has shape {t.shape}, points_m {q.shape}; must both be (N,): "
            "give a time for each point"
        )
    if t.size < min_points:
        raise PlanError(
            f"{law}: {t.size} points; must be >= {min_points}: add points, or use a motion law"
        )
    for name, values, most in (
        ("times_s", t, MAX_TIME_S),
        ("points_m", q, bounds.FARTHEST_M),
        ("ends", ends, bounds.FASTEST),
    ):
        flat = np.ravel(values)
        for value in flat[~(np.abs(flat) <= most)][:1].tolist():
            check_range(f"{law}: a number of {name}", value, -most, most, "correct the table")
    for k in np.flatnonzero(np.diff(t) <= 0.0).tolist():
        fault = "repeats" if t[k + 1] == t[k] else "decreases"
        raise PlanError(
            f"{law}: times_s[{k + 1}] = {t[k + 1]:.12g} {fault} after {t[k]:.12g}; "
            "must increase: correct the table"
        )
    total = bounds.duration(float(t[-1] - t[0]))
    for k in np.flatnonzero(np.diff(t) < MIN_INTERVAL_REL * total).tolist():
        raise PlanError(
            f"{law}: the interval after times_s[{k}] lasts {t[k + 1] - t[k]:.3g} s "
            f"of {total:.6g} s; must be >= {MIN_INTERVAL_REL:g} of it: remove one of the points"
        )
    return ViaPoints(t, q)
