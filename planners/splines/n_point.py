"""The polynomial through n points, and why it must not be computed from powers of time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import NotConverged, PlanError
from planners.splines.points import via_points
from planners.trajectories.pieces import FloatArray, Smooth
from planners.trajectories.trajectory import Trajectory

MIN_POINTS = 2
MISS = 1e-9  # of the largest point
MOST_ORDERS = 24  # beyond, derivatives of the shortest motions are no numbers
MAX_DERIVATIVE_ORDER = 6  # derivatives that are declared, though those of a short polynomial are 0


class Conditioning(NamedTuple):
    """How many times the matrix of n equidistant points amplifies rounding (2-norm condition number)."""

    points: int
    powers: float  # Vandermonde matrix on 0..1
    centred: float  # Vandermonde matrix on -1..1
    chebyshev: float  # Chebyshev polynomials on -1..1: what n_point uses


def n_point(times_s: ArrayLike, points_m: ArrayLike) -> Trajectory:
    """The polynomial of degree N - 1 through points (N,) at times (N,), in Chebyshev polynomials of centred, scaled time.

    Between many equidistant points it swings out, and from about 30 on by more than arithmetic can resolve at the points.
    Raises PlanError for bad points, NotConverged when a point is missed by more than MISS.
    """
    from numpy.polynomial import chebyshev

    via = via_points("n-point polynomial", times_s, points_m, MIN_POINTS)
    duration = float(via.times_s[-1] - via.times_s[0])
    x = 2.0 * (via.times_s - via.times_s[0]) / duration - 1.0
    series = np.linalg.solve(chebyshev.chebvander(x, x.size - 1), via.points_m)
    missed, size = (
        float(np.abs(chebyshev.chebval(x, series) - via.points_m).max()),
        float(np.abs(via.points_m).max()),
    )
    if not missed <= MISS * size:
        raise NotConverged(
            f"the polynomial through {x.size} points misses one by {missed:.3g} m; must be <= {MISS * size:.3g}: take a spline"
        )
    orders = range(min(max(MAX_DERIVATIVE_ORDER, x.size), MOST_ORDERS) + 1)
    slopes = [chebyshev.chebder(series, order) * (2.0 / duration) ** order for order in orders]

    def value(t: FloatArray, order: int) -> FloatArray:
        return np.asarray(
            chebyshev.chebval(2.0 * t / duration - 1.0, slopes[order]), dtype=np.float64
        )

    return Trajectory((Smooth(duration, value, len(slopes) - 1),))


def conditioning(points: int) -> Conditioning:
    """The row of n equidistant points (source 000, Vandermonde table: the column of powers). PlanError below 2."""
    if points < MIN_POINTS:
        raise PlanError(f"points = {points} of a polynomial; must be >= {MIN_POINTS}: ask for more")
    from numpy.polynomial import chebyshev

    x = np.linspace(-1.0, 1.0, points)
    matrices = np.vander((x + 1.0) / 2.0), np.vander(x), chebyshev.chebvander(x, points - 1)
    return Conditioning(points, *(float(np.linalg.cond(m)) for m in matrices))
