"""Via points: where an axis must be, and when."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners import bounds
from planners.errors import PlanError, check_range
from planners.trajectories.pieces import FloatArray

LATEST_S = 1e12  # on any clock
MIN_INTERVAL_REL = 1e-9  # of the whole time: a shorter interval is a slip of the table


class ViaPoints(NamedTuple):
    """Positions at strictly increasing times."""

    times_s: FloatArray  # (N,)
    points_m: FloatArray  # (N,)

    @property
    def durations_s(self) -> FloatArray:
        """Length of every interval: (N - 1,)."""
        return np.diff(self.times_s)

    @property
    def slopes_m_s(self) -> FloatArray:
        """Speed of the straight line over every interval: (N - 1,)."""
        return np.diff(self.points_m) / self.durations_s


class End(NamedTuple):
    """What a spline must meet at an end; rest unless said otherwise."""

    speed_m_s: float = 0.0
    acceleration_m_s2: float = 0.0


REST = End()


def via_points(
    law: str, times_s: ArrayLike, points_m: ArrayLike, fewest: int, ends: tuple[End, ...] = ()
) -> ViaPoints:
    """The points of a law, checked: within bounds, times strictly increasing, none too close, at least `fewest` of them.

    Raises PlanError naming the law, the value and the bound.
    """
    t, q = np.asarray(times_s, dtype=np.float64), np.asarray(points_m, dtype=np.float64)
    if t.ndim != 1 or t.shape != q.shape:
        raise PlanError(
            f"{law}: times_s has shape {t.shape}, points_m {q.shape}; must both be (N,): give a time a point"
        )
    if t.size < fewest:
        raise PlanError(
            f"{law}: {t.size} points; must be >= {fewest}: add points, or take a two-point law"
        )
    for name, values, most in (
        ("times_s", t, LATEST_S),
        ("points_m", q, bounds.FARTHEST_M),
        ("ends", ends, bounds.FASTEST),
    ):
        flat = np.ravel(values)
        for value in flat[~(np.abs(flat) <= most)][:1].tolist():
            check_range(f"{law}: a number of {name}", value, -most, most, "mend the table")
    for k in np.flatnonzero(np.diff(t) <= 0.0).tolist():
        what = "repeats" if t[k + 1] == t[k] else "goes back"
        raise PlanError(
            f"{law}: times_s[{k + 1}] = {t[k + 1]:.12g} {what} after {t[k]:.12g}; must increase: mend the table"
        )
    total = bounds.duration(float(t[-1] - t[0]))
    for k in np.flatnonzero(np.diff(t) < MIN_INTERVAL_REL * total).tolist():
        raise PlanError(
            f"{law}: the interval after times_s[{k}] lasts {t[k + 1] - t[k]:.3g} s of {total:.6g} s; "
            f"must be >= {MIN_INTERVAL_REL:g} of it: drop one of the points"
        )
    return ViaPoints(t, q)
