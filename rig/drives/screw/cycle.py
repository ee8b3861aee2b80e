"""Cycle of an axis: repeated moves with their rests."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planners import bounds
from planners.errors import PlanError, check_range, unknown_name
from planners.laws import LAWS
from planners.laws.segments import integrated
from planners.trajectories.trajectory import Trajectory
from rig.drives.screw.instants import CyclePhase, Instants, moving_phase, rest_phase

TRAPEZOIDAL = "trapezoidal"
CLOSURE_REL = 1e-9  # sum of the strokes of a cycle, over its longest stroke
SHARE_SUM_TOLERANCE = 1e-9  # by which lambda_acc + lambda_dec may exceed 1
MAX_LISTED_STROKES = 8  # in an error
DURATION_ROUNDING_REL = 2e-3  # of stroke and time, for durations rounded in a printed table


@dataclass(frozen=True, kw_only=True)
class Move:
    """Move from rest to rest by a motion law, and the rest after it.

    lambda_acc and lambda_dec are shares of time_s for the ramps of the trapezoidal law, a third
    each by default. durations_s, the durations of its three phases as printed in a table, are
    checked against them.

    Raises PlanError for a stroke of 0, ramp shares that are not above 0 or whose sum is above 1, an
    unknown law, and durations that do not cover the stroke in time_s.
    """

    stroke_m: float
    time_s: float
    lambda_acc: float | None = None
    lambda_dec: float | None = None
    rest_s: float = 0.0
    law: str = TRAPEZOIDAL
    durations_s: Sequence[float] | None = None

    def __post_init__(self) -> None:
        bounds.distance(self.stroke_m, "stroke_m")
        check_range(
            "time_s",
            self.time_s,
            bounds.SHORTEST_S,
            bounds.LONGEST_S,
            "give the move a time in seconds",
        )
        check_range(
            "rest_s",
            self.rest_s,
            0.0,
            bounds.LONGEST_S,
            "0 lets the next move follow at once",
        )
        if self.stroke_m == 0.0:
            raise PlanError(
                "stroke_m = 0; must not be 0: leave the move out, and lengthen rest_s of the move "
                "before it"
            )
        if self.law not in LAWS:
            raise unknown_name("law", self.law, LAWS)
        self._check_law()
        self._check_ramps()
        if self.durations_s is not None:
            self._check_durations(self.durations_s)
            # a tuple, as moves are keys of a dict
            object.__setattr__(self, "durations_s", tuple(self.durations_s))

    @property
    def ramp_shares(self) -> tuple[float, float]:
        """lambda_acc and lambda_dec of the trapezoidal law."""
        return (
            1.0 / 3.0 if self.lambda_acc is None else self.lambda_acc,
            1.0 / 3.0 if self.lambda_dec is None else self.lambda_dec,
        )

    @property
    def peak_speed_m_s(self) -> float:
        """Largest absolute speed; inversely proportional to time_s."""
        return self.trajectory.peak(1).value

    def time_at(self, speed_m_s: float) -> float:
        """Compute the time with which the same law keeps a speed limit [s]; at least time_s."""
        return self.time_s * max(1.0, self.peak_speed_m_s / speed_m_s)

    @cached_property
    def trajectory(self) -> Trajectory:
        """Position from 0 to stroke_m.

        Trapezoid: v = h / (T (1 - lambda_acc/2 - lambda_dec/2)) (source 004, fig. C.9).
        """
        if self.law != TRAPEZOIDAL:
            return LAWS[self.law](self.time_s).scaled(self.stroke_m)
        up_s, even_s, down_s = self._phases_s
        speed = self._trapezoid_speed_m_s
        return integrated(
            (0.0, 0.0), ((up_s, speed / up_s), (even_s, 0.0), (down_s, -speed / down_s))
        )

    @cached_property
    def phases(self) -> tuple[CyclePhase, ...]:
        """Rows of the motion-law table, in the order of time; a rest of 0 s has no row."""
        direction = math.copysign(1.0, self.stroke_m)
        rows = [
            moving_phase(number, piece, direction)
            for number, piece in enumerate(self.trajectory.pieces, start=1)
        ]
        if self.rest_s > 0.0:
            rows.append(rest_phase(self.rest_s))
        return tuple(rows)

    @property
    def _phases_s(self) -> tuple[float, float, float]:
        """Durations of acceleration, constant speed and deceleration."""
        up, down = self.ramp_shares
        even = 1.0 - up - down
        if not even > SHARE_SUM_TOLERANCE:
            even = 0.0
        return up * self.time_s, even * self.time_s, down * self.time_s

    @property
    def _trapezoid_speed_m_s(self) -> float:
        up, down = self.ramp_shares
        return self.stroke_m / (self.time_s * (1.0 - (up + down) / 2.0))

    def _check_law(self) -> None:
        if self.law == TRAPEZOIDAL:
            return
        for name in ("lambda_acc", "lambda_dec", "durations_s"):
            if getattr(self, name) is not None:
                raise PlanError(
                    f"{name} with law = {self.law!r}; must be {TRAPEZOIDAL!r}, the law with ramp "
                    f"shares: leave {name} out"
                )

    def _check_ramps(self) -> None:
        for name, share in zip(("lambda_acc", "lambda_dec"), self.ramp_shares, strict=True):
            check_range(name, share, 1e-6, 1.0, "it is a share of the move's time")
        total = sum(self.ramp_shares)
        if not total <= 1.0 + SHARE_SUM_TOLERANCE:
            raise PlanError(
                f"lambda_acc + lambda_dec = {total:.6g}; must be <= 1, the whole move: shorten one "
                "of them"
            )

    def _check_durations(self, durations_s: Sequence[float]) -> None:
        if len(durations_s) != 3 or not all(0.0 <= t < math.inf for t in durations_s):
            raise PlanError(
                f"durations_s = {list(durations_s)}; must be three numbers >= 0: acceleration, "
                "constant speed, deceleration"
            )
        up, even, down = durations_s
        total_s = sum(durations_s)
        speed = abs(self._trapezoid_speed_m_s)
        covered = speed * (up / 2.0 + even + down / 2.0)
        stroke = abs(self.stroke_m)
        wrong_stroke = abs(covered - stroke) > DURATION_ROUNDING_REL * stroke
        wrong_time = abs(total_s - self.time_s) > DURATION_ROUNDING_REL * self.time_s
        if wrong_stroke or wrong_time:
            lambda_acc, lambda_dec = self.ramp_shares
            right = ", ".join(f"{t:.4g}" for t in self._phases_s)
            raise PlanError(
                f"durations_s = {list(durations_s)} last {total_s:.4g} s and cover "
                f"{covered:.4g} m at {speed:.4g} m/s; must be {self.time_s:g} s and {stroke:g} m: "
                f"lambda_acc = {lambda_acc:g} and lambda_dec = {lambda_dec:g} give {right}"
            )


@dataclass(frozen=True)
class Cycle:
    """Moves that end at their start position.

    Raises PlanError without a move, or for strokes that do not sum to 0.
    """

    moves: Sequence[Move]

    def __post_init__(self) -> None:
        if not self.moves:
            raise PlanError("a cycle of 0 moves; must be >= 2, forth and back: add them")
        strokes = [move.stroke_m for move in self.moves]
        if abs(sum(strokes)) > CLOSURE_REL * max(map(abs, strokes)):
            listed = [f"{stroke:g}" for stroke in strokes[:MAX_LISTED_STROKES]]
            if len(strokes) > MAX_LISTED_STROKES:
                listed.append("...")
            raise PlanError(
                f"strokes {', '.join(listed)} m sum to {sum(strokes):g} m; must be 0, so that the "
                f"cycle ends at its start: add a move of {-sum(strokes):g} m"
            )
        # equal moves become one object, so that each different move is computed once
        first: dict[Move, Move] = {}
        unique = tuple(first.setdefault(move, move) for move in self.moves)
        object.__setattr__(self, "moves", unique)

    @cached_property
    def counts(self) -> Counter[Move]:
        """Number of occurrences of each different move, in the order of the first ones."""
        return Counter(self.moves)

    @property
    def duration_s(self) -> float:
        """Time of all moves and rests."""
        return math.fsum(move.time_s + move.rest_s for move in self.moves)

    @property
    def travel_m(self) -> float:
        """Distance between the outermost positions of the axis."""
        strokes = [move.stroke_m for move in self.moves]
        positions = np.cumsum([0.0, *strokes])
        return float(np.ptp(positions))

    @property
    def peak_speed_m_s(self) -> float:
        """Largest absolute speed of all moves."""
        return max(move.peak_speed_m_s for move in self.counts)

    @cached_property
    def instants(self) -> Instants:
        """Instants of all different moves, weighted by the number of their occurrences."""
        rows = [
            row.instants._replace(weight_s=row.instants.weight_s * times)
            for move, times in self.counts.items()
            for row in move.phases
        ]
        return Instants(*(np.concatenate(parts) for parts in zip(*rows, strict=True)))
