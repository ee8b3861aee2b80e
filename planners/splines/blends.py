"""Straight lines between via points with parabolic blends, which pass the points at an error."""

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
BLEND_OVERLAP_REL = 1e-12  # of an interval: overlap of blends that is rounding


class Blends(NamedTuple):
    """Trajectory with parabolic blends, and its errors at the points."""

    trajectory: Trajectory
    speeds_m_s: FloatArray  # of the lines (N - 1,)
    # tau (N,): a blend lasts tau before and tau after its point; at an end at rest tau in all
    half_blends_s: FloatArray
    errors_m: FloatArray  # e (N,): position at the time of the point, less the point


def parabolic_blends(
    times_s: ArrayLike, points_m: ArrayLike, acceleration_m_s2: float, *, rest_ends: bool = True
) -> Blends:
    """Compute lines through points (N >= 3,) at times (N,), blended with a given acceleration.

    With v1, v2 the slopes before and after a point: a = sign(v2 - v1) acceleration,
    tau = |v2 - v1| / (2 acceleration), e = (v2 - v1) |v2 - v1| / (8 acceleration) (source 002,
    signs and slope term corrected). With rest_ends the move starts and ends at rest, by parabolas
    inside the first and last interval; without, at the speeds of the lines.
    Raises PlanError for bad points, Infeasible when the blends do not fit their interval.
    """
    via = via_points("parabolic blends", times_s, points_m, MIN_POINTS)
    check_range(
        "acceleration_m_s2",
        acceleration_m_s2,
        bounds.SLOWEST,
        bounds.FASTEST,
        "give the limit of the axis",
    )
    speeds, ramps = via.slopes_m_s, np.zeros(2)
    if rest_ends:
        ramps = np.array([_ramp_s(via, k, acceleration_m_s2) for k in (0, -1)])
        speeds[[0, -1]] = np.diff(via.points_m)[[0, -1]] / (via.durations_s[[0, -1]] - ramps / 2.0)
    steps = np.diff(speeds)
    halves = np.abs(steps) / (2.0 * acceleration_m_s2)
    blends = np.array([ramps[0], *halves, ramps[1]])
    _check_overlap(via, blends, acceleration_m_s2)
    errors = np.array([0.0, *(steps * np.abs(steps) / (8.0 * acceleration_m_s2)), 0.0])
    return Blends(_trajectory(via, speeds, blends), speeds, blends, errors)


def _ramp_s(via: ViaPoints, interval: int, acceleration: float) -> float:
    """Compute the time of the parabola from or to rest.

    It is the smaller root t_b of distance = a t_b (T - t_b / 2).
    """
    duration = via.durations_s[interval]
    distance = abs(np.diff(via.points_m)[interval])
    square = duration**2 - 2.0 * distance / acceleration
    if square < 0.0:
        place = "first" if interval == 0 else "last"
        raise Infeasible(
            f"acceleration_m_s2 = {acceleration:.6g} over {distance:.6g} m in {duration:.6g} s "
            f"from or to rest; must be >= {2.0 * distance / duration**2:.6g}: "
            f"give the {place} interval more time"
        )
    return float(2.0 * distance / acceleration / (duration + np.sqrt(square)))


def _check_overlap(via: ViaPoints, blends: FloatArray, acceleration: float) -> None:
    blended = blends[:-1] + blends[1:]
    for k in np.flatnonzero(blended > (1.0 + BLEND_OVERLAP_REL) * via.durations_s).tolist():
        raise Infeasible(
            f"blends at points {k} and {k + 1} take {blended[k]:.6g} s of an interval of "
            f"{via.durations_s[k]:.6g} s at {acceleration:.6g} m/s^2; must fit: "
            "raise the acceleration or give the interval more time"
        )


def _trajectory(via: ViaPoints, speeds: FloatArray, blends: FloatArray) -> Trajectory:
    """Join parabola, line, parabola, ... end to end, without those of length 0."""
    lines = np.maximum(via.durations_s - blends[:-1] - blends[1:], 0.0)
    parabolas = blends * np.array([1.0, *np.full(blends.size - 2, 2.0), 1.0])
    before, after = _speeds_around_points(speeds, parabolas)
    durations = np.append(np.column_stack([parabolas[:-1], lines]).ravel(), parabolas[-1])
    starts = np.append(np.column_stack([before[:-1], speeds]).ravel(), before[-1])
    ends = np.append(np.column_stack([after[:-1], speeds]).ravel(), after[-1])
    kept = durations > 0.0
    durations, starts, ends = durations[kept], starts[kept], ends[kept]
    positions = via.points_m[0] + np.cumsum([0.0, *(durations * (starts + ends) / 2.0)[:-1]])
    rows = np.column_stack([positions, starts, (ends - starts) / (2.0 * durations)])
    return Trajectory(Polynomials(durations, rows))


def _speeds_around_points(
    speeds: FloatArray, parabolas: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Compute the speeds before and after every point: (N,) both.

    An end without a parabola has the speed of its line.
    """
    first = 0.0 if parabolas[0] else speeds[0]
    last = 0.0 if parabolas[-1] else speeds[-1]
    return np.array([first, *speeds]), np.array([*speeds, last])
