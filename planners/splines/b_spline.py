"""B-splines of degree 4 and 5 with given speed and acceleration at both ends."""

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
    """Compute the B-spline through points (N,) at times (N,) with end conditions.

    Degree 4: knots at the middle of every interval, jerk continuous (source 003, knots and rows
    corrected). Degree 5: knots at the points, the derivative of the jerk continuous too.
    Raises PlanError for bad points or another degree.
    """
    if degree not in DEGREES:
        raise PlanError(
            f"degree = {degree} of a B-spline; must be 4 or 5: "
            "two conditions at both ends determine no other"
        )
    via = via_points(f"B-spline of degree {degree}", times_s, points_m, MIN_POINTS, (start, end))
    durations_s, rows = spline_pieces(via.durations_s, via.points_m, degree, start, end)
    return Trajectory(Polynomials(durations_s, rows))


def spline_pieces(
    h: FloatArray, q: FloatArray, degree: int, start: End = REST, end: End = REST
) -> tuple[FloatArray, FloatArray]:
    """Compute durations (P,) and ascending coefficients (P, degree + 1) of the pieces.

    The spline has intervals h (K,) between points q (K + 1,).
    """
    from scipy.interpolate import PPoly, make_interp_spline

    t = np.concatenate([[0.0], np.cumsum(h)])
    inner = (t[:-1] + t[1:]) / 2.0 if degree == 4 else t[1:-1]
    knots = np.concatenate([np.full(degree + 1, t[0]), inner, np.full(degree + 1, t[-1])])
    ends: Any = (
        [(1, start.speed_m_s), (2, start.acceleration_m_s2)],
        [(1, end.speed_m_s), (2, end.acceleration_m_s2)],
    )
    spline = make_interp_spline(t, q, k=degree, t=knots, bc_type=ends)
    nonempty = slice(degree, knots.size - degree - 1)  # repeated knots make pieces of length 0
    pieces = PPoly.from_spline((spline.t, spline.c, spline.k))
    return np.diff(knots)[nonempty], pieces.c[::-1, nonempty].T


def many_pieces(h: FloatArray, q: FloatArray, degree: int) -> tuple[FloatArray, FloatArray]:
    """Compute durations (..., P) and coefficients (..., P, degree + 1) of many splines.

    From rest to rest, for intervals h (..., K) between the same points q (K + 1,).
    """
    splines = [spline_pieces(row, q, degree) for row in h.reshape(-1, h.shape[-1])]
    durations, rows = (np.array(part) for part in zip(*splines, strict=True))
    return durations.reshape(*h.shape[:-1], -1), rows.reshape(*h.shape[:-1], -1, degree + 1)
