"""4-3-4 spline: cubic inside, a quartic at both ends for given speed and acceleration."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from planners.splines.cubic import from_accelerations
from planners.splines.points import REST, End, via_points
from planners.splines.tridiagonal import solve
from planners.trajectories.cells import Polynomials
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

MIN_POINTS = 3


def four_three_four(
    times_s: ArrayLike, points_m: ArrayLike, start: End = REST, end: End = REST
) -> Trajectory:
    """Compute the 4-3-4 spline through points (N >= 3,) at times (N,) with end conditions.

    Source 003, 4n - 2 conditions. The unknowns left are the accelerations at the inner points, a
    tridiagonal system of N - 2. Raises PlanError for bad points.
    """
    via = via_points("4-3-4 spline", times_s, points_m, MIN_POINTS, (start, end))
    rows = spline_coefficients(via.durations_s, via.points_m, start, end)
    return Trajectory(Polynomials(via.durations_s, rows))


def spline_coefficients(
    h: FloatArray, q: FloatArray, start: End = REST, end: End = REST
) -> FloatArray:
    """Compute ascending coefficients (..., K, 5) of many 4-3-4 splines at once.

    Durations h (..., K) between points q (..., K + 1). Six times the speed left of a point is
    6 s + h (a_before + 2 a) for a cubic of slope s, 12 s - 6 v0 - a0 h + h a for the quartic that
    starts with v0, a0, and the mirror image on the right. Their equality is a row of the system.
    """
    s, (v0, a0), (v1, a1) = np.diff(q) / h, start, end
    left, right = h[..., :-1], h[..., 1:]
    diagonal = 2.0 * (left + right)
    rhs = 6.0 * np.diff(s)
    diagonal[..., 0] -= left[..., 0]
    diagonal[..., -1] -= right[..., -1]
    rhs[..., 0] -= 6.0 * (s[..., 0] - v0) - a0 * h[..., 0]
    rhs[..., -1] += 6.0 * (s[..., -1] - v1) + a1 * h[..., -1]
    inner = solve(left, diagonal, right, rhs)
    first, last = np.full_like(inner[..., :1], a0), np.full_like(inner[..., :1], a1)
    a = np.concatenate([first, inner, last], axis=-1)
    fourth_powers = np.zeros((*a.shape[:-1], h.shape[-1], 1))
    rows = np.concatenate([from_accelerations(h, q, a), fourth_powers], axis=-1)
    rows[..., 0, :] = _first_quartic(h[..., 0], q[..., 0], q[..., 1], start, inner[..., 0])
    rows[..., -1, :] = _last_quartic(h[..., -1], q[..., -2], q[..., -1], end, inner[..., -1])
    return rows


def _first_quartic(
    h: FloatArray, q0: FloatArray, q1: FloatArray, start: End, a1: FloatArray
) -> FloatArray:
    """Compute the quartic from q0 with a start condition to q1 with acceleration a1: (..., 5)."""
    v0, a0 = start
    remainder = q1 - q0 - h * (v0 + h * a0 / 2.0)
    bend = h**2 * (a1 - a0) / 6.0
    third, fourth = (2.0 * remainder - bend) / h**3, (bend - remainder) / h**4
    return np.stack(np.broadcast_arrays(q0, v0, a0 / 2.0, third, fourth), axis=-1)


def _last_quartic(
    h: FloatArray, q0: FloatArray, q1: FloatArray, end: End, a0: FloatArray
) -> FloatArray:
    """Compute the quartic from q0 with acceleration a0 to q1 with an end condition: (..., 5)."""
    v1, a1 = end
    bend = h**2 * (a1 - a0) / 6.0
    fourth = q1 - q0 - h * (v1 - h * a1 / 2.0) - bend  # the mirror image of the first quartic
    third = bend - 2.0 * fourth
    speed = (q1 - q0 - third - fourth) / h - h * a0 / 2.0
    return np.stack(np.broadcast_arrays(q0, speed, a0 / 2.0, third / h**3, fourth / h**4), axis=-1)
