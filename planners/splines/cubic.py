"""Cubic splines: continuous acceleration, jerk with a step at every point."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import PlanError
from planners.splines.points import End, via_points
from planners.splines.tridiagonal import solve
from planners.trajectories.cells import Polynomials
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

MIN_POINTS = 2
CLOSURE_REL = 1e-9  # of the largest position: distance from last to first point


def clamped(
    times_s: ArrayLike,
    points_m: ArrayLike,
    start_speed_m_s: float = 0.0,
    end_speed_m_s: float = 0.0,
) -> Trajectory:
    """Compute the cubic spline through points (N,) at times (N,) with given end speeds.

    Source 000, cubic spline. Raises PlanError for bad points.
    """
    ends = End(start_speed_m_s), End(end_speed_m_s)
    via = via_points("cubic spline", times_s, points_m, MIN_POINTS, ends)
    rows = clamped_coefficients(via.durations_s, via.points_m, start_speed_m_s, end_speed_m_s)
    return Trajectory(Polynomials(via.durations_s, rows))


def natural(times_s: ArrayLike, points_m: ArrayLike) -> Trajectory:
    """Compute the cubic spline through points (N,) at times (N,) with end accelerations of 0.

    Raises PlanError for bad points.
    """
    via = via_points("natural cubic spline", times_s, points_m, MIN_POINTS)
    h, steps = via.durations_s, np.diff(via.slopes_m_s)
    a = np.zeros(via.times_s.size)
    if steps.size:
        a[1:-1] = solve(h[:-1], 2.0 * (h[:-1] + h[1:]), h[1:], 6.0 * steps)
    return Trajectory(Polynomials(h, from_accelerations(h, via.points_m, a)))


def periodic(times_s: ArrayLike, points_m: ArrayLike) -> Trajectory:
    """Compute the cubic spline with equal position, speed and acceleration at both ends.

    Points (N,) at times (N,), the last one equal to the first.
    Raises PlanError for bad points, or a last point that is not the first.
    """
    from scipy.interpolate import CubicSpline

    via = via_points("periodic cubic spline", times_s, points_m, 3)
    q = via.points_m.copy()
    if abs(q[-1] - q[0]) > CLOSURE_REL * np.abs(q).max():
        raise PlanError(
            f"periodic cubic spline: the last point is {q[-1]:.12g} m, the first {q[0]:.12g} m; "
            "must be equal: close the path, or use the natural spline"
        )
    q[-1] = q[0]
    spline = CubicSpline(via.times_s, q, bc_type="periodic")
    return Trajectory(Polynomials(via.durations_s, spline.c[::-1].T))


def clamped_coefficients(
    h: FloatArray, q: FloatArray, start_m_s: float = 0.0, end_m_s: float = 0.0
) -> FloatArray:
    """Compute ascending coefficients (..., K, 4) of many clamped splines at once.

    Durations h (..., K) between points q (..., K + 1).
    """
    slopes = np.diff(q) / h
    left = _padded(h, before=1, after=0)  # the interval before every point
    right = _padded(h, before=0, after=1)  # the interval after every point
    steps = np.diff(slopes, prepend=start_m_s, append=end_m_s)
    a = solve(left, 2.0 * (left + right), right, 6.0 * steps)
    return from_accelerations(h, q, a)


def from_accelerations(h: FloatArray, q: FloatArray, a: FloatArray) -> FloatArray:
    """Compute cubic pieces (..., K, 4) from positions q and accelerations a at the points.

    q and a are (..., K + 1), durations h (..., K).
    """
    speeds = np.diff(q) / h - h * (2.0 * a[..., :-1] + a[..., 1:]) / 6.0
    powers = np.broadcast_arrays(q[..., :-1], speeds, a[..., :-1] / 2.0, np.diff(a) / (6.0 * h))
    return np.stack(powers, axis=-1)


def _padded(h: FloatArray, *, before: int, after: int) -> FloatArray:
    """Pad the last axis with zeros."""
    widths = [(0, 0)] * (h.ndim - 1) + [(before, after)]
    return np.pad(h, widths, constant_values=0.0)
