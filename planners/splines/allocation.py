"""Allocation of a total time to the intervals between points."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from planners import bounds
from planners.errors import PlanError, check_range
from planners.splines.points import MIN_INTERVAL_REL
from planners.trajectories.pieces import FloatArray

ALLOCATIONS = {"equal": 0.0, "proportional": 1.0, "root": 0.5}  # name -> power of the distance
MAX_POWER = 4.0  # a higher power leaves all but the longest interval without time


def allocate(points_m: ArrayLike, total_s: float, power: float) -> FloatArray:
    """Allocate total_s to intervals in proportion to |distance|^power: durations (N - 1,).

    points_m (N,) or (N, axes). The three powers of source 003 are in ALLOCATIONS; the root is the
    best first guess under an acceleration limit.
    Raises PlanError for numbers out of bounds, and for an interval without time: between equal
    points, unless power is 0.
    """
    q = np.asarray(points_m, dtype=np.float64)
    if q.ndim not in (1, 2) or q.shape[0] < 2 or not np.isfinite(q).all():
        raise PlanError(
            f"points_m of shape {q.shape}; must be >= 2 finite points (N,) or (N, axes): "
            "correct the table"
        )
    check_range(
        "largest point", float(np.abs(q).max()), 0.0, bounds.FARTHEST_M, "give the points in metres"
    )
    check_range(
        "total_s", total_s, bounds.SHORTEST_S, bounds.LONGEST_S, "give the motion a time in seconds"
    )
    check_range("power", power, 0.0, MAX_POWER, "give 0 for equal, 0.5 root, 1 proportional")
    distances = np.linalg.norm(np.diff(q.reshape(q.shape[0], -1), axis=0), axis=1)
    repeated = np.flatnonzero(distances == 0.0) if power else np.zeros(0, dtype=np.intp)
    for k in repeated.tolist():
        raise PlanError(
            f"points {k} and {k + 1} are both at {q[k]} m, so their interval lasts 0 s; "
            "must be > 0: use equal times, remove the point, or insert a dwell"
        )
    weights = (distances / max(float(distances.max()), bounds.NEAREST_M)) ** power
    shares: FloatArray = weights / weights.sum()
    for k in np.flatnonzero(shares < MIN_INTERVAL_REL).tolist():
        raise PlanError(
            f"the interval between points {k} and {k + 1} gets {shares[k]:.3g} of the time; "
            f"must be >= {MIN_INTERVAL_REL:g}: lower the power, or remove one of the points"
        )
    return shares * total_s
