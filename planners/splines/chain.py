"""Chain of splines, constant speeds and dwells, without steps at the joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from planners import bounds
from planners.errors import PlanError, check_range, unknown_name
from planners.splines.b_spline import b_spline
from planners.splines.four_three_four import four_three_four
from planners.splines.points import MIN_INTERVAL_REL, REST, End, via_points
from planners.trajectories.cells import Polynomials
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import JUMP_REL, Trajectory

SplineLaw: TypeAlias = Callable[[FloatArray, FloatArray, End, End], Trajectory]

SPLINE_LAWS: dict[str, SplineLaw] = {
    "four_three_four": four_three_four,
    "b_spline_4": lambda t, q, start, end: b_spline(t, q, 4, start, end),
    "b_spline_5": lambda t, q, start, end: b_spline(t, q, 5, start, end),
}


@dataclass(frozen=True)
class Straight:
    """Segment of constant speed between two points; a dwell when they are equal.

    Raises PlanError for a time or a position out of bounds.
    """

    from_m: float
    to_m: float
    duration_s: float

    def __post_init__(self) -> None:
        bounds.duration(self.duration_s)
        for name, place_m in (("from_m", self.from_m), ("to_m", self.to_m)):
            check_range(name, place_m, -bounds.FARTHEST_M, bounds.FARTHEST_M, "give it in metres")

    @property
    def end(self) -> End:
        """Speed and acceleration of the segment."""
        return End((self.to_m - self.from_m) / self.duration_s, 0.0)

    @property
    def points_m(self) -> tuple[float, float]:
        """Start and end position."""
        return self.from_m, self.to_m


@dataclass(frozen=True)
class Spline:
    """Spline segment through points with the given durations between them.

    end: speed and acceleration at its end, before another spline or at the end of the chain.
    Next to a Straight, the neighbour determines them.
    """

    points_m: Sequence[float]
    durations_s: Sequence[float] | FloatArray
    end: End = REST
    law: str = "four_three_four"


Segment: TypeAlias = Straight | Spline


def dwell(at_m: float, duration_s: float) -> Straight:
    """Build a segment at rest."""
    return Straight(at_m, at_m, duration_s)


def chain(segments: Sequence[Segment], start: End = REST) -> Trajectory:
    """Join segments end to end (rules of source 003).

    A spline has the speed of a straight neighbour, without acceleration, and starts with the end
    condition of the spline before it; start is for a first spline. Speed and acceleration have no
    step at a joint; the durations stay unchanged. A motion that begins or ends with a constant
    speed is not at rest there; see Trajectory.continuous(1).
    Raises PlanError for a step of position or speed between segments, which the message names,
    and for input that a spline refuses.
    """
    if not segments:
        raise PlanError("a chain of 0 segments; must be >= 1: use Trajectory.hold for rest")
    for k, (one, other) in enumerate(pairwise(segments)):
        _check_joint(k, one, other)
    parts = []
    for k, segment in enumerate(segments):
        if isinstance(segment, Straight):
            line = np.array([[segment.from_m, segment.end.speed_m_s]])
            parts.append(Trajectory(Polynomials(np.array([segment.duration_s]), line)))
            continue
        begin = segments[k - 1].end if k else start
        next_segment = segments[k + 1] if k + 1 < len(segments) else segment
        end = next_segment.end if isinstance(next_segment, Straight) else segment.end
        parts.append(_spline_trajectory(k, segment, begin, end))
    return Trajectory(tuple(piece for part in parts for piece in part.pieces))


def _spline_trajectory(k: int, segment: Spline, start: End, end: End) -> Trajectory:
    if segment.law not in SPLINE_LAWS:
        raise unknown_name(f"law of segment {k}", segment.law, SPLINE_LAWS)
    durations = np.asarray(segment.durations_s, dtype=np.float64)
    points = np.asarray(segment.points_m, dtype=np.float64)
    if durations.size != points.size - 1:
        raise PlanError(
            f"segment {k} has {points.size} points and {durations.size} durations; "
            f"must be {points.size - 1}: give one per interval"
        )
    for i, h in enumerate(durations.tolist()):
        check_range(
            f"durations_s[{i}] in segment {k}",
            h,
            MIN_INTERVAL_REL * bounds.SHORTEST_S,
            bounds.LONGEST_S,
            "give the interval a time in seconds",
        )
    via = via_points(f"segment {k}", np.concatenate([[0.0], np.cumsum(durations)]), points, 2)
    return SPLINE_LAWS[segment.law](via.times_s, via.points_m, start, end)


def _check_joint(k: int, one: Segment, other: Segment) -> None:
    """Raise PlanError for a step of position or speed between segments k and k + 1."""
    here, there = one.points_m[-1], other.points_m[0]
    if abs(here - there) > JUMP_REL * max(1.0, abs(here)):
        raise PlanError(
            f"segment {k} ends at {here} m, segment {k + 1} begins at {there} m; must meet: "
            "correct one of the points"
        )
    if isinstance(one, Straight) and isinstance(other, Straight):
        before, after = one.end.speed_m_s, other.end.speed_m_s
        if abs(after - before) > JUMP_REL * max(abs(before), abs(after)):
            raise PlanError(
                f"speed steps from {before:.6g} m/s in segment {k} to {after:.6g} m/s "
                f"in segment {k + 1}; must be equal: insert a spline between them"
            )
