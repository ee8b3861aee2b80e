"""How a total time is shared among the intervals between points."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import PlanError
from planners.pieces import FloatArray

ALLOCATIONS = {"equal": 0.0, "proportional": 1.0, "root": 0.5}  # name -> power of the distance


def allocate(points_m: ArrayLike, total_s: float, power: float) -> FloatArray:
    """Durations (N - 1,) in proportion to |distance|^power between points (N,) or (N, axes); they sum to total_s.

    The three of source 003 are in ALLOCATIONS; the root is the best first guess under an acceleration limit.
    Raises PlanError for repeated points (an interval of no length) unless power is 0.
    """
    q = np.asarray(points_m, dtype=np.float64)
    if q.ndim not in (1, 2) or q.shape[0] < 2 or not np.isfinite(q).all():
        raise PlanError(f"points_m of shape {q.shape}; must be >= 2 finite points (N,) or (N, axes): mend the table")
    if not 0.0 < total_s < math.inf:
        raise PlanError(f"total_s = {total_s} for {q.shape[0]} points; must be finite and > 0: give the motion time")
    if not 0.0 <= power < math.inf:
        raise PlanError(f"power = {power} of an allocation; must be finite and >= 0: equal 0, root 0.5, proportional 1")
    distances = np.linalg.norm(np.diff(q.reshape(q.shape[0], -1), axis=0), axis=1)
    for k in np.flatnonzero(distances == 0.0).tolist() if power else ():
        raise PlanError(
            f"points {k} and {k + 1} are both at {q[k]} m, so their interval lasts 0 s; must be > 0: "
            "use equal times, drop the point, or put a dwell there"
        )
    weights: FloatArray = distances**power
    return weights * (total_s / float(weights.sum()))
