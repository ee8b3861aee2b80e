"""Cubic splines: the least bent curve through the points; acceleration is continuous, jerk steps at every point."""

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
JUMP = 1e-9  # of the largest position: a periodic motion must come back this closely


def clamped(
    times_s: ArrayLike,
    points_m: ArrayLike,
    start_speed_m_s: float = 0.0,
    end_speed_m_s: float = 0.0,
) -> Trajectory:
    """Through points (N,) at times (N,) with the speeds at both ends (source 000, cubic spline). PlanError for bad points."""
    ends = End(start_speed_m_s), End(end_speed_m_s)
    via = via_points("cubic spline", times_s, points_m, MIN_POINTS, ends)
    rows = clamped_coefficients(via.durations_s, via.points_m, start_speed_m_s, end_speed_m_s)
    return Trajectory(Polynomials(via.durations_s, rows))


def natural(times_s: ArrayLike, points_m: ArrayLike) -> Trajectory:
    """Through points (N,) at times (N,) without acceleration at the ends; the end speeds follow. PlanError for bad points."""
    via = via_points("natural cubic spline", times_s, points_m, MIN_POINTS)
    h, steps = via.durations_s, np.diff(via.slopes_m_s)
    a = np.zeros(via.times_s.size)
    if steps.size:
        a[1:-1] = solve(h[:-1], 2.0 * (h[:-1] + h[1:]), h[1:], 6.0 * steps)
    return Trajectory(Polynomials(h, from_accelerations(h, via.points_m, a)))


def periodic(times_s: ArrayLike, points_m: ArrayLike) -> Trajectory:
    """Through points (N,) at times (N,), the last one equal to the first: speed and acceleration also come back.

    Raises PlanError for bad points, or a last point that is not the first.
    """
    from scipy.interpolate import CubicSpline

    via = via_points("periodic cubic spline", times_s, points_m, 3)
    q = via.points_m.copy()
    if abs(q[-1] - q[0]) > JUMP * np.abs(q).max():
        raise PlanError(
            f"periodic cubic spline: the last point is {q[-1]:.12g} m, the first {q[0]:.12g} m; must be equal: "
            "close the path, or take the natural spline"
        )
    q[-1] = q[0]
    return Trajectory(
        Polynomials(via.durations_s, CubicSpline(via.times_s, q, bc_type="periodic").c[::-1].T)
    )


def clamped_coefficients(
    h: FloatArray, q: FloatArray, start_m_s: float = 0.0, end_m_s: float = 0.0
) -> FloatArray:
    """Ascending coefficients (..., K, 4) on durations h (..., K) through points q (..., K + 1): many splines at once."""
    slopes = np.diff(q) / h
    left, right = (
        _padded(h, 0.0, 0),
        _padded(h, 0.0, -1),
    )  # the interval before and after every point
    steps = np.diff(slopes, prepend=start_m_s, append=end_m_s)
    a = solve(left, 2.0 * (left + right), right, 6.0 * steps)
    return from_accelerations(h, q, a)


def from_accelerations(h: FloatArray, q: FloatArray, a: FloatArray) -> FloatArray:
    """Cubic pieces (..., K, 4) from positions q and accelerations a at the points (..., K + 1)."""
    speeds = np.diff(q) / h - h * (2.0 * a[..., :-1] + a[..., 1:]) / 6.0
    return np.stack(
        np.broadcast_arrays(q[..., :-1], speeds, a[..., :-1] / 2.0, np.diff(a) / (6.0 * h)), axis=-1
    )


def _padded(h: FloatArray, value: float, end: int) -> FloatArray:
    widths = [(0, 0)] * (h.ndim - 1) + [(1, 0) if end == 0 else (0, 1)]
    return np.pad(h, widths, constant_values=value)
