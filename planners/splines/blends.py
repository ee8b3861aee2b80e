"""Straight lines between via points, joined by parabolas: the points are passed by, not through, by a stated error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners import bounds
from planners.errors import Infeasible, check_range
from planners.splines.points import ViaPoints, via_points
from planners.trajectories.cells import Polynomials
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

MIN_POINTS = 3
BLEND_OVERLAP_REL = 1e-12  # share of an interval that blends may overlap by


class Blends(NamedTuple):
    """The move, and by how much it misses each point."""

    trajectory: Trajectory
    speeds_m_s: FloatArray  # of the lines (N - 1,)
    half_blends_s: FloatArray  # tau (N,): a blend lasts tau before and tau after its point; at a resting end all of it
    errors_m: FloatArray  # e (N,): position at the time of the point, less the point


def parabolic_blends(
    times_s: ArrayLike, points_m: ArrayLike, acceleration_m_s2: float, *, rest_ends: bool = True
) -> Blends:
    """Lines through points (N >= 3,) at times (N,), each corner rounded with the given acceleration.

    With v1, v2 the slopes before and after a point: a = sign(v2 - v1) acceleration, tau = |v2 - v1| / (2 acceleration),
    e = (v2 - v1) |v2 - v1| / (8 acceleration) (source 002, signs and slope term corrected). With rest_ends the move
    starts and ends at rest by a parabola that lies inside its first and last interval; without, at the lines' speeds.
    Raises PlanError for bad points, Infeasible when the blends do not fit their interval.
    """
    via = via_points("parabolic blends", times_s, points_m, MIN_POINTS)
    check_range(
        "acceleration_m_s2",
        acceleration_m_s2,
        bounds.SLOWEST,
        bounds.FASTEST,
        "give the axis' limit",
    )
    speeds, ramps = via.slopes_m_s, np.zeros(2)
    if rest_ends:
        ramps = np.array([_ramp(via, k, acceleration_m_s2) for k in (0, -1)])
        speeds[[0, -1]] = np.diff(via.points_m)[[0, -1]] / (via.durations_s[[0, -1]] - ramps / 2.0)
    steps = np.diff(speeds)
    halves = np.abs(steps) / (2.0 * acceleration_m_s2)
    blends = np.array([ramps[0], *halves, ramps[1]])
    _check_room(via, blends, acceleration_m_s2)
    errors = np.array([0.0, *(steps * np.abs(steps) / (8.0 * acceleration_m_s2)), 0.0])
    return Blends(_trajectory(via, speeds, blends), speeds, blends, errors)


def _ramp(via: ViaPoints, interval: int, acceleration: float) -> float:
    """How long the parabola from or to rest lasts: the smaller root of distance = a t_b (T - t_b / 2)."""
    duration, distance = via.durations_s[interval], abs(np.diff(via.points_m)[interval])
    square = duration**2 - 2.0 * distance / acceleration
    if square < 0.0:
        raise Infeasible(
            f"acceleration_m_s2 = {acceleration:.6g} over {distance:.6g} m in {duration:.6g} s from or to rest; must be "
            f">= {2.0 * distance / duration**2:.6g}: give the {'first' if interval == 0 else 'last'} interval more time"
        )
    return float(2.0 * distance / acceleration / (duration + np.sqrt(square)))


def _check_room(via: ViaPoints, blends: FloatArray, acceleration: float) -> None:
    taken = blends[:-1] + blends[1:]
    for k in np.flatnonzero(taken > (1.0 + BLEND_OVERLAP_REL) * via.durations_s).tolist():
        raise Infeasible(
            f"blends at points {k} and {k + 1} take {taken[k]:.6g} s of an interval of {via.durations_s[k]:.6g} s at "
            f"{acceleration:.6g} m/s^2; must fit: raise the acceleration or give the interval more time"
        )


def _trajectory(via: ViaPoints, speeds: FloatArray, blends: FloatArray) -> Trajectory:
    """Parabola, line, parabola, ...: each begins where the one before ended; those of no length are left out."""
    lines = np.maximum(via.durations_s - blends[:-1] - blends[1:], 0.0)
    parabolas = blends * np.array([1.0, *np.full(blends.size - 2, 2.0), 1.0])
    before, after = _around(speeds, parabolas)
    durations = np.append(np.column_stack([parabolas[:-1], lines]).ravel(), parabolas[-1])
    starts = np.append(np.column_stack([before[:-1], speeds]).ravel(), before[-1])
    ends = np.append(np.column_stack([after[:-1], speeds]).ravel(), after[-1])
    kept = durations > 0.0
    durations, starts, ends = durations[kept], starts[kept], ends[kept]
    positions = via.points_m[0] + np.cumsum([0.0, *(durations * (starts + ends) / 2.0)[:-1]])
    return Trajectory(
        Polynomials(
            durations, np.column_stack([positions, starts, (ends - starts) / (2.0 * durations)])
        )
    )


def _around(speeds: FloatArray, parabolas: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Speed before and after every point: (N,) both; an end without a parabola keeps its line's."""
    first = 0.0 if parabolas[0] else speeds[0]
    last = 0.0 if parabolas[-1] else speeds[-1]
    return np.array([first, *speeds]), np.array([*speeds, last])
