"""Minimum-time durations of a spline within limits of speed, acceleration and jerk."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners import bounds
from planners.errors import Infeasible, PlanError, check_range, unknown_name
from planners.splines.allocation import ALLOCATIONS
from planners.splines.b_spline import many_pieces
from planners.splines.cubic import clamped_coefficients
from planners.splines.four_three_four import spline_coefficients
from planners.splines.limits import LIMIT_NAMES, AxisLimits
from planners.splines.shape_search import Shape, ShapeSearch
from planners.trajectories.pieces import FloatArray

MIN_POINTS = 3
SAMPLES = 256  # random allocations besides the starts
REFINED_SAMPLES = 4  # the best of them, from which a local search starts
LOG_DURATION_SIGMA = 1.0  # standard deviation of ln(duration) about the root allocation
MIN_DISTANCE_REL = 1e-3  # of the path: a shorter interval starts with the time of this distance
MIN_PATH_M = 1e-12  # shorter is rounding
MIN_INTERVAL_REL = 1e-3  # of the total time: a shorter one between equal points has no minimum

SHAPES: dict[str, Shape] = {
    "cubic": lambda h, q: (h, clamped_coefficients(h, q)),
    "four_three_four": lambda h, q: (h, spline_coefficients(h, q)),
    "b_spline_4": lambda h, q: many_pieces(h, q, 4),
    "b_spline_5": lambda h, q: many_pieces(h, q, 5),
}


class MinimumTime(NamedTuple):
    """Times of the points from 0, and the share of each limit that is used."""

    times_s: FloatArray  # (N,)
    reached: dict[str, float]  # name of a limit -> share, 1 = reached


def minimum_time(
    law: str,
    points_m: ArrayLike,
    limits: AxisLimits,
    *,
    starts: Sequence[str] = tuple(ALLOCATIONS),
    samples: int = SAMPLES,
) -> MinimumTime:
    """Find the minimum time of a spline law with every axis within limits, at rest at both ends.

    points_m (N >= 3,) or (N, axes). A local search runs from each start (a name of an allocation)
    and from the best of `samples` random allocations around the root allocation, with a fixed
    seed; the shortest result is returned. Limits of position are ignored, as the time does not
    change the path.
    Raises PlanError for an unknown name or bad points, Infeasible for limits that no time
    satisfies.
    """
    if law not in SHAPES:
        raise unknown_name("law of a minimum time", law, SHAPES)
    for name in starts:
        if name not in ALLOCATIONS:
            raise unknown_name("start of a minimum time", name, ALLOCATIONS)
    if not starts and samples < 1:
        raise PlanError(
            f"samples = {samples} without starts; must be >= 1: name a start or draw some"
        )
    q = np.asarray(points_m, dtype=np.float64)
    q = q[:, None] if q.ndim == 1 else q
    _check(law, q, limits)
    peak_limits = {k: limits.peak_limit(k) for k in LIMIT_NAMES if limits.peak_limit(k) < np.inf}
    search = ShapeSearch(SHAPES[law], q, peak_limits)
    minima = [search.refine(h) for h in _starts(search, starts, samples)]
    h = min(minima, key=lambda h: float(h.sum()))
    _check_repeated(q, h)
    reached = {LIMIT_NAMES[k]: share for k, share in search.reached(h).items()}
    return MinimumTime(np.concatenate([[0.0], np.cumsum(h)]), reached)


def _check(law: str, q: FloatArray, limits: AxisLimits) -> None:
    if q.ndim != 2 or q.shape[0] < MIN_POINTS or not np.isfinite(q).all():
        raise PlanError(
            f"points_m of shape {q.shape} for a minimum time; must be >= {MIN_POINTS} finite "
            "points (N,) or (N, axes): correct the table, or scale a motion law"
        )
    check_range(
        "largest point", float(np.abs(q).max()), 0.0, bounds.FARTHEST_M, "give the points in metres"
    )
    if not np.any(q != q[0]):
        raise PlanError(
            f"all {q.shape[0]} points are at {q[0]} m; a path must be > 0 m long: "
            "use Trajectory.hold"
        )
    check_range(
        "largest distance from the first point",
        float(np.abs(q - q[0]).max()),
        MIN_PATH_M,
        np.inf,
        "use Trajectory.hold",
    )
    if not min(map(limits.peak_limit, LIMIT_NAMES)) < np.inf:
        raise PlanError(
            "no limit of speed, acceleration or jerk is given; at least one must be finite, "
            "or the minimum time is 0 s: give a speed or an acceleration"
        )
    if law == "cubic" and limits.jerk_m_s3 < np.inf:
        raise Infeasible(
            f"jerk_m_s3 = {limits.jerk_m_s3} for a cubic spline at rest at its ends, where its "
            "acceleration has a step, an infinite jerk; must be inf: "
            "use four_three_four or a B-spline"
        )


def _check_repeated(q: FloatArray, h: FloatArray) -> None:
    """Raise Infeasible when the time between two equal points has no minimum above 0.

    A motion may pass one point twice with a turn in between.
    """
    short = h < MIN_INTERVAL_REL * h.sum()
    equal = np.all(np.diff(q, axis=0) == 0.0, axis=1)
    for k in np.flatnonzero(short & equal).tolist():
        raise Infeasible(
            f"points {k} and {k + 1} are both at {q[k]} m, and the time between them shrinks to "
            f"{h[k]:.3g} s of {h.sum():.6g} s; must be > {MIN_INTERVAL_REL:g} of it: "
            "remove one of them, or insert a dwell"
        )


def _starts(search: ShapeSearch, starts: Sequence[str], samples: int) -> FloatArray:
    """Compute the durations from which the local searches start: (starts, K)."""
    distances = np.linalg.norm(np.diff(search.points, axis=0), axis=1)
    logs = np.log(np.maximum(distances / distances.sum(), MIN_DISTANCE_REL))
    first = np.array([ALLOCATIONS[name] * logs for name in starts]).reshape(-1, logs.size)
    if samples < 1:
        return np.asarray(np.exp(first))
    deviations = np.random.default_rng(0).standard_normal((samples, logs.size))
    drawn_logs = ALLOCATIONS["root"] * logs + LOG_DURATION_SIGMA * deviations
    drawn = search.scaled(np.exp(drawn_logs))
    best = np.argsort(drawn.sum(axis=-1))[:REFINED_SAMPLES]
    return np.concatenate([np.exp(first), drawn[best]])
