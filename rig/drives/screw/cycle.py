"""What an axis is to do, again and again: moves with their rests."""

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
from rig.drives.screw.instants import CyclePhase, Instants, moving, resting

TRAPEZOIDAL = "trapezoidal"
CLOSED = 1e-9  # share of the longest stroke by which a cycle may miss its start
LISTED = 8  # strokes that an error lists
PRINTED = 2e-3  # share of a stroke by which durations rounded for a table may miss it


@dataclass(frozen=True, kw_only=True)
class Move:
    """From rest to rest by a law. The trapezoidal one has shares of the time for speeding up and slowing down, a third
    each unless given; durations_s are those of its three phases where a table states them, and are checked.

    Raises PlanError for a stroke of 0, shares that are not above 0 or whose sum is above 1, an unknown law, and durations that
    miss the stroke.
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
            "0 is a move that the next one follows at once",
        )
        if self.stroke_m == 0.0:
            raise PlanError(
                "stroke_m = 0; must not be 0: leave the move out, and let the one before it rest for longer"
            )
        if self.law not in LAWS:
            raise unknown_name("law", self.law, LAWS)
        given = [
            name
            for name in ("lambda_acc", "lambda_dec", "durations_s")
            if getattr(self, name) is not None
        ]
        if self.law != TRAPEZOIDAL and given:
            raise PlanError(
                f"{given[0]} with law = {self.law!r}; must be {TRAPEZOIDAL!r} to have shares: leave it out"
            )
        self._check_shares()
        if self.durations_s is not None:
            self._check_durations(self.durations_s)
            object.__setattr__(
                self, "durations_s", tuple(self.durations_s)
            )  # a move can be looked up

    @property
    def shares(self) -> tuple[float, float]:
        """lambda_acc and lambda_dec of the trapezoid."""
        return (
            1.0 / 3.0 if self.lambda_acc is None else self.lambda_acc,
            1.0 / 3.0 if self.lambda_dec is None else self.lambda_dec,
        )

    @property
    def peak_speed_m_s(self) -> float:
        """Its size; it falls as 1 / time_s."""
        return self.trajectory.peak(1).value

    def time_at(self, speed_m_s: float) -> float:
        """The time in which the same law keeps a lower speed [s]."""
        return self.time_s * max(1.0, self.peak_speed_m_s / speed_m_s)

    @cached_property
    def trajectory(self) -> Trajectory:
        """Position from 0 to stroke_m. Trapezoid: v = h / (T (1 - lambda_acc/2 - lambda_dec/2)) (source 004, fig. C.9)."""
        if self.law != TRAPEZOIDAL:
            return LAWS[self.law](self.time_s).scaled(self.stroke_m)
        up_s, even_s, down_s = self._phases_s
        speed = self._trapezoid_speed_m_s
        return integrated(
            (0.0, 0.0), ((up_s, speed / up_s), (even_s, 0.0), (down_s, -speed / down_s))
        )

    @cached_property
    def phases(self) -> tuple[CyclePhase, ...]:
        """The rows of its motion-law table, in the order of time; a rest of 0 s has none."""
        direction = math.copysign(1.0, self.stroke_m)
        rows = [
            moving(number, piece, direction)
            for number, piece in enumerate(self.trajectory.pieces, start=1)
        ]
        return (*rows, resting(self.rest_s)) if self.rest_s > 0.0 else tuple(rows)

    @property
    def _phases_s(self) -> tuple[float, float, float]:
        up, down = self.shares
        even = 1.0 - up - down
        return up * self.time_s, (even if even > CLOSED else 0.0) * self.time_s, down * self.time_s

    @property
    def _trapezoid_speed_m_s(self) -> float:
        up, down = self.shares
        return self.stroke_m / (self.time_s * (1.0 - (up + down) / 2.0))

    def _check_shares(self) -> None:
        for name, share in zip(("lambda_acc", "lambda_dec"), self.shares, strict=True):
            check_range(name, share, 1e-6, 1.0, "it is a share of the move's time")
        if not sum(self.shares) <= 1.0 + CLOSED:
            raise PlanError(
                f"lambda_acc + lambda_dec = {sum(self.shares):.6g}; must be <= 1, the whole move: shorten one of them"
            )

    def _check_durations(self, durations_s: Sequence[float]) -> None:
        if len(durations_s) != 3 or not all(0.0 <= t < math.inf for t in durations_s):
            raise PlanError(
                f"durations_s = {list(durations_s)}; must be three, >= 0: speeding up, even speed, slowing down"
            )
        up, even, down = durations_s
        speed = abs(self._trapezoid_speed_m_s)
        covered, stroke = speed * (up / 2.0 + even + down / 2.0), abs(self.stroke_m)
        right = ", ".join(f"{t:.4g}" for t in self._phases_s)
        if (
            abs(covered - stroke) > PRINTED * stroke
            or abs(sum(durations_s) - self.time_s) > PRINTED * self.time_s
        ):
            raise PlanError(
                f"durations_s = {list(durations_s)} last {sum(durations_s):.4g} s and cover {covered:.4g} m at "
                f"{speed:.4g} m/s; must be {self.time_s:g} s and {stroke:g} m: shares of {self.shares[0]:g} and "
                f"{self.shares[1]:g} make {right}"
            )


@dataclass(frozen=True)
class Cycle:
    """Moves that end where they began. Raises PlanError without a move, or for strokes that do not sum to 0."""

    moves: Sequence[Move]

    def __post_init__(self) -> None:
        if not self.moves:
            raise PlanError("a cycle of 0 moves; must be >= 2, there and back: add them")
        strokes = [move.stroke_m for move in self.moves]
        if abs(sum(strokes)) > CLOSED * max(map(abs, strokes)):
            told = ", ".join(f"{stroke:g}" for stroke in strokes[:LISTED]) + (
                ", ..." if len(strokes) > LISTED else ""
            )
            raise PlanError(
                f"strokes {told} m sum to {sum(strokes):g} m; must be 0, back where the cycle "
                f"began: add a move of {-sum(strokes):g} m"
            )
        first: dict[Move, Move] = {}
        object.__setattr__(
            self, "moves", tuple(first.setdefault(move, move) for move in self.moves)
        )  # equal ones are one

    @cached_property
    def counts(self) -> Counter[Move]:
        """How often each different move occurs, in the order of the first ones."""
        return Counter(self.moves)

    @property
    def duration_s(self) -> float:
        """Moves and rests."""
        return math.fsum(move.time_s + move.rest_s for move in self.moves)

    @property
    def travel_m(self) -> float:
        """Between the outermost places that the axis reaches."""
        places = np.cumsum([0.0, *(move.stroke_m for move in self.moves)])
        return float(np.ptp(places))

    @property
    def peak_speed_m_s(self) -> float:
        """Over all moves."""
        return max(move.peak_speed_m_s for move in self.counts)

    @cached_property
    def instants(self) -> Instants:
        """Of all different moves; the weight counts how often they occur."""
        rows = [
            row.instants._replace(weight_s=row.instants.weight_s * times)
            for move, times in self.counts.items()
            for row in move.phases
        ]
        return Instants(*(np.concatenate(parts) for parts in zip(*rows, strict=True)))
