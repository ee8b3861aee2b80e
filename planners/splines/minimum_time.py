"""The shortest times at which a spline passes its points within limits of speed, acceleration and jerk."""

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
from planners.splines.four_three_four import quartic_ended
from planners.splines.limits import OF_ORDER, AxisLimits
from planners.splines.shape_search import Shape, ShapeSearch
from planners.trajectories.pieces import FloatArray

MIN_POINTS = 3
SAMPLES = 256  # allocations looked at besides the starts
POLISHED = 4  # the best of them that are followed to their minimum
SPREAD = 1.0  # standard deviation of the logarithm of a drawn duration about the root allocation
FLOOR = 1e-3  # of the whole path: a shorter interval is given time as if it were so long
LEAST_M = 1e-12  # of the way: less is rounding
MIN_INTERVAL_REL = 1e-3  # of the total time: an interval between equal points that is shorter is on its way to nothing

SHAPES: dict[str, Shape] = {
    "cubic": lambda h, q: (h, clamped_coefficients(h, q)),
    "four_three_four": lambda h, q: (h, quartic_ended(h, q)),
    "b_spline_4": lambda h, q: many_pieces(h, q, 4),
    "b_spline_5": lambda h, q: many_pieces(h, q, 5),
}


class MinimumTime(NamedTuple):
    """Times of the points from 0, and how much of each limit they use."""

    times_s: FloatArray  # (N,)
    reached: dict[str, float]  # name of a limit -> share used, 1 = reached


def minimum_time(
    law: str,
    points_m: ArrayLike,
    limits: AxisLimits,
    *,
    starts: Sequence[str] = tuple(ALLOCATIONS),
    samples: int = SAMPLES,
) -> MinimumTime:
    """The least total time of a law through points (N >= 3,) or (N, axes), at rest at both ends, every axis within limits.

    The starts (names of allocations) and the best of `samples` drawn around the root allocation, the same ones every
    time, are each followed to their minimum; the shortest is returned. Bounds of position are not looked at: slowing
    down does not change the path. Raises PlanError for an unknown name or bad points, Infeasible for limits that no
    time keeps.
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
    search = ShapeSearch(
        SHAPES[law], q, {k: limits.of_order(k) for k in OF_ORDER if limits.of_order(k) < np.inf}
    )
    h = min(
        (search.polish(h) for h in _starts(search, starts, samples)), key=lambda h: float(h.sum())
    )
    _check_repeated(q, h)
    reached = {OF_ORDER[k]: share for k, share in search.reached(h).items()}
    return MinimumTime(np.concatenate([[0.0], np.cumsum(h)]), reached)


def _check(law: str, q: FloatArray, limits: AxisLimits) -> None:
    if q.ndim != 2 or q.shape[0] < MIN_POINTS or not np.isfinite(q).all():
        raise PlanError(
            f"points_m of shape {q.shape} for a minimum time; must be >= {MIN_POINTS} finite points (N,) or (N, axes): "
            "mend the table, or scale a two-point law"
        )
    check_range(
        "largest point", float(np.abs(q).max()), 0.0, bounds.FARTHEST_M, "give the points in metres"
    )
    if not np.any(q != q[0]):
        raise PlanError(
            f"all {q.shape[0]} points are at {q[0]} m; a path must be > 0 m long: use Trajectory.hold"
        )
    check_range(
        "farthest way from the first point",
        float(np.abs(q - q[0]).max()),
        LEAST_M,
        np.inf,
        "use Trajectory.hold",
    )
    if not min(map(limits.of_order, OF_ORDER)) < np.inf:
        raise PlanError(
            "no limit of speed, acceleration or jerk is given; one must be finite: the minimum time would be 0 s"
        )
    if law == "cubic" and limits.jerk_m_s3 < np.inf:
        raise Infeasible(
            f"jerk_m_s3 = {limits.jerk_m_s3} for a cubic spline at rest at its ends: its acceleration steps there, a jerk "
            "without bound; must be inf: take four_three_four or a B-spline"
        )


def _check_repeated(q: FloatArray, h: FloatArray) -> None:
    """A motion may pass one point twice, turning in between; it must not stop there, or the interval has no least time."""
    for k in np.flatnonzero(
        (h < MIN_INTERVAL_REL * h.sum()) & np.all(np.diff(q, axis=0) == 0.0, axis=1)
    ).tolist():
        raise Infeasible(
            f"points {k} and {k + 1} are both at {q[k]} m, and the time between them shrinks to {h[k]:.3g} s of "
            f"{h.sum():.6g} s; must be > {MIN_INTERVAL_REL:g} of it: drop one of them, or put a dwell there"
        )


def _starts(search: ShapeSearch, starts: Sequence[str], samples: int) -> FloatArray:
    """Durations to begin with: (starts, K)."""
    distances = np.linalg.norm(np.diff(search.points, axis=0), axis=1)
    logs = np.log(np.maximum(distances / distances.sum(), FLOOR))
    first = np.array([ALLOCATIONS[name] * logs for name in starts]).reshape(-1, logs.size)
    if samples < 1:
        return np.asarray(np.exp(first))
    drawn = ALLOCATIONS["root"] * logs + SPREAD * np.random.default_rng(0).standard_normal(
        (samples, logs.size)
    )
    drawn = search.scaled(np.exp(drawn))
    best = np.argsort(drawn.sum(axis=-1))[:POLISHED]
    return np.concatenate([np.exp(first), drawn[best]])
