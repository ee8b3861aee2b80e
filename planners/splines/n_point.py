"""Polynomial through n points, and the condition numbers of its matrices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import NotConverged, PlanError
from planners.splines.points import via_points
from planners.trajectories.pieces import FloatArray, Smooth
from planners.trajectories.trajectory import Trajectory

MIN_POINTS = 2
POINT_ERROR_REL = 1e-9  # of the largest point
MIN_DERIVATIVE_ORDER = 6  # declared at least, though those of a short polynomial are 0
MAX_DERIVATIVE_ORDER = 24  # beyond, derivatives of the shortest motions overflow


class Conditioning(NamedTuple):
    """2-norm condition numbers of the interpolation matrices for n equidistant points."""

    points: int
    powers: float  # Vandermonde matrix on 0..1
    centred: float  # Vandermonde matrix on -1..1
    chebyshev: float  # Chebyshev polynomials on -1..1, used by n_point


def n_point(times_s: ArrayLike, points_m: ArrayLike) -> Trajectory:
    """Compute the polynomial of degree N - 1 through points (N,) at times (N,).

    It is a Chebyshev series of the centred, scaled time, as powers of time amplify rounding. It
    oscillates between many equidistant points; from about 30 on the rounding of these
    oscillations exceeds the error bound at the points.
    Raises PlanError for bad points, NotConverged for an error at a point above POINT_ERROR_REL.
    """
    from numpy.polynomial import chebyshev

    via = via_points("n-point polynomial", times_s, points_m, MIN_POINTS)
    duration = float(via.times_s[-1] - via.times_s[0])
    x = 2.0 * (via.times_s - via.times_s[0]) / duration - 1.0
    series = np.linalg.solve(chebyshev.chebvander(x, x.size - 1), via.points_m)
    error = float(np.abs(chebyshev.chebval(x, series) - via.points_m).max())
    bound = POINT_ERROR_REL * float(np.abs(via.points_m).max())
    if not error <= bound:
        raise NotConverged(
            f"the polynomial through {x.size} points has an error of {error:.3g} m at one of them; "
            f"must be <= {bound:.3g}: use a spline"
        )
    orders = range(min(max(MIN_DERIVATIVE_ORDER, x.size), MAX_DERIVATIVE_ORDER) + 1)
    derivatives = [chebyshev.chebder(series, order) * (2.0 / duration) ** order for order in orders]

    def value(t: FloatArray, order: int) -> FloatArray:
        scaled = 2.0 * t / duration - 1.0
        return np.asarray(chebyshev.chebval(scaled, derivatives[order]), dtype=np.float64)

    return Trajectory((Smooth(duration, value, len(derivatives) - 1),))


def conditioning(points: int) -> Conditioning:
    """Compute the condition numbers for n equidistant points.

    Source 000, Vandermonde table: the column of powers. Raises PlanError below 2 points.
    """
    if points < MIN_POINTS:
        raise PlanError(f"points = {points} of a polynomial; must be >= {MIN_POINTS}: give more")
    from numpy.polynomial import chebyshev

    x = np.linspace(-1.0, 1.0, points)
    matrices = np.vander((x + 1.0) / 2.0), np.vander(x), chebyshev.chebvander(x, points - 1)
    return Conditioning(points, *(float(np.linalg.cond(m)) for m in matrices))
