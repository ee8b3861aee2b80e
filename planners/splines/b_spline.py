"""B-splines of degree 4 and 5: smoother than the 4-3-4 spline, with speed and acceleration at both ends."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import PlanError
from planners.splines.points import REST, End, via_points
from planners.trajectories.cells import Polynomials
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

MIN_POINTS = 2
DEGREES = (4, 5)


def b_spline(
    times_s: ArrayLike, points_m: ArrayLike, degree: int = 5, start: End = REST, end: End = REST
) -> Trajectory:
    """Through points (N,) at times (N,), with speed and acceleration at both ends.

    Degree 4: knots at the middle of every interval, jerk continuous (source 003, knots and rows corrected). Degree 5: knots
    at the points, the derivative of the jerk continuous too. PlanError for bad points or another degree.
    """
    if degree not in DEGREES:
        raise PlanError(
            f"degree = {degree} of a B-spline; must be 4 or 5: two conditions at both ends fix no other"
        )
    via = via_points(f"B-spline of degree {degree}", times_s, points_m, MIN_POINTS, (start, end))
    return Trajectory(
        Polynomials(*degree_pieces(via.durations_s, via.points_m, degree, start, end))
    )


def degree_pieces(
    h: FloatArray, q: FloatArray, degree: int, start: End = REST, end: End = REST
) -> tuple[FloatArray, FloatArray]:
    """Durations (P,) and ascending coefficients (P, degree + 1) on intervals h (K,) through points q (K + 1,)."""
    from scipy.interpolate import PPoly, make_interp_spline

    t = np.concatenate([[0.0], np.cumsum(h)])
    inner = (t[:-1] + t[1:]) / 2.0 if degree == 4 else t[1:-1]
    knots = np.concatenate([np.full(degree + 1, t[0]), inner, np.full(degree + 1, t[-1])])
    ends: Any = (
        [(1, start.speed_m_s), (2, start.acceleration_m_s2)],
        [(1, end.speed_m_s), (2, end.acceleration_m_s2)],
    )
    spline = make_interp_spline(t, q, k=degree, t=knots, bc_type=ends)
    whole = slice(degree, knots.size - degree - 1)  # the repeated knots make pieces of no length
    return np.diff(knots)[whole], PPoly.from_spline((spline.t, spline.c, spline.k)).c[::-1, whole].T


def many_pieces(h: FloatArray, q: FloatArray, degree: int) -> tuple[FloatArray, FloatArray]:
    """The same from rest to rest for intervals (..., K): durations (..., P) and coefficients (..., P, degree + 1)."""
    made = [degree_pieces(row, q, degree) for row in h.reshape(-1, h.shape[-1])]
    durations, rows = (np.array(part) for part in zip(*made, strict=True))
    return durations.reshape(*h.shape[:-1], -1), rows.reshape(*h.shape[:-1], -1, degree + 1)
