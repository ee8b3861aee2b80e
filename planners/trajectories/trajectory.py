"""One axis over time: pieces end to end, with exact extremes and mean squares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import PlanError
from planners.trajectories.cells import Polynomials, resolve
from planners.trajectories.pieces import FloatArray, Piece, add, polynomial

MANY = 16  # plain polynomials: so many pieces are worth a table
BLOCK = 8192  # instants of a piece looked at together: a million stay in the cache, a third faster
END = 1e-12  # share of the duration by which an instant may miss the end and still be it: sums of durations round
JUMP = 1e-9  # a step below this share of the largest value is rounding


class Peak(NamedTuple):
    """Largest absolute value of a derivative, and the first instant it is met."""

    value: float
    t_s: float


class Extent(NamedTuple):
    """Lowest and highest value of a derivative."""

    low: float
    high: float


class _Summary(NamedTuple):
    extent: Extent
    peak: Peak
    square_integral: float


@dataclass(frozen=True)
class Trajectory:
    """Position of one axis [m] over time [s]; before the start and after the end it stands still.

    A derivative at a joint is the one of the piece that begins there; at duration_s it is the last piece's.
    Raises PlanError without pieces, or with a piece whose duration is not finite and > 0.
    """

    pieces: Sequence[Piece]

    def __post_init__(self) -> None:
        if not self.pieces:
            raise PlanError(
                "a trajectory of 0 pieces; must be >= 1: use Trajectory.hold for standing still"
            )
        durations = self._durations_s
        for k in np.flatnonzero(~((durations > 0.0) & (durations < math.inf)))[:1]:
            raise PlanError(
                f"duration_s = {durations[k]} of piece {k}; must be finite and > 0: leave the piece out"
            )

    @classmethod
    def hold(cls, position_m: float, duration_s: float) -> Trajectory:
        """Standing still at position_m."""
        return cls((polynomial(duration_s, (position_m,)),))

    @cached_property
    def breaks_s(self) -> FloatArray:
        """Start of every piece and the end: (pieces + 1,), from 0."""
        return np.concatenate([[0.0], np.cumsum(self._durations_s)])

    @property
    def duration_s(self) -> float:
        """Time from start to end."""
        return float(self.breaks_s[-1])

    def at(self, t_s: ArrayLike, order: int = 0) -> FloatArray:
        """Derivative of that order at times of any shape; the result has that shape, () for a number.

        Raises PlanError for a time that is not a number or a derivative that a smooth piece does not declare.
        """
        t = np.asarray(t_s, dtype=np.float64)
        flat = t.ravel()
        if np.isnan(flat).any():
            raise PlanError(
                "t_s holds nan; every time must be a number: mend the clock or the table it came from"
            )
        if flat.size > 1 and np.any(flat[1:] < flat[:-1]):
            rank = np.argsort(flat, kind="stable")
            values = np.empty_like(flat)
            values[rank] = self._at_sorted(flat[rank], order)
        else:
            values = self._at_sorted(flat, order)
        return values.reshape(t.shape)

    def peak(self, order: int = 0) -> Peak:
        """Exact largest absolute value over the move (both sides of every joint), to rounding."""
        return self._summary(order).peak

    def extent(self, order: int = 0) -> Extent:
        """Exact lowest and highest value over the move, to rounding."""
        return self._summary(order).extent

    def rms(self, order: int = 0) -> float:
        """Exact root of the mean square over [0, duration_s], to rounding."""
        return math.sqrt(self._summary(order).square_integral / self.duration_s)

    def continuous(self, order: int) -> bool:
        """Whether derivatives 0..order have no step at any joint, nor against rest at both ends."""
        return all(self._joined(k) for k in range(order + 1))

    def then(self, other: Trajectory) -> Trajectory:
        """This one, and at its end the other. Raises PlanError when the position would jump."""
        end, start = self._ends(0)[1][-1], other._ends(0)[0][0]
        if abs(start - end) > JUMP * max(1.0, abs(end)):
            raise PlanError(
                f"position jumps from {end} m to {start} m; must meet within {JUMP:g} m: shift the second part"
            )
        return Trajectory((*self.pieces, *other.pieces))

    def scaled(self, factor: float) -> Trajectory:
        """factor times the position."""
        return Trajectory(tuple(piece.scaled(factor) for piece in self.pieces))

    def shifted(self, offset_m: float) -> Trajectory:
        """The same move from another place."""
        return Trajectory(
            tuple(add(piece, polynomial(piece.duration_s, (offset_m,))) for piece in self.pieces)
        )

    def _at_sorted(self, t: FloatArray, order: int) -> FloatArray:
        first, last = self.pieces[0], self.pieces[-1]
        cuts = np.searchsorted(t, self.breaks_s)  # (pieces + 1,)
        end = float(self.breaks_s[-1])
        cuts[-1] = np.searchsorted(t, end * (1.0 + END), side="right")
        t = np.where((t > end) & (t <= end * (1.0 + END)), end, t)
        values = np.zeros_like(t)
        if order == 0 and cuts[0] > 0:
            values[: cuts[0]] = first.at(np.zeros(()))
        if order == 0 and cuts[-1] < t.size:
            values[cuts[-1] :] = last.at(np.asarray(last.duration_s))
        if self._table is not None:
            self._table.derivative(order).sweep(t, self.breaks_s, cuts, values)
            return values
        for k in np.flatnonzero(np.diff(cuts)).tolist():
            for begin in range(cuts[k], cuts[k + 1], BLOCK):
                here = slice(begin, min(begin + BLOCK, cuts[k + 1]))
                values[here] = self.pieces[k].at(t[here] - self.breaks_s[k], order)
        return values

    @cached_property
    def _table(self) -> Polynomials | None:
        return Polynomials.of(self.pieces) if len(self.pieces) >= MANY else None

    @property
    def _durations_s(self) -> FloatArray:
        if isinstance(self.pieces, Polynomials):
            return self.pieces.durations_s
        return np.array([piece.duration_s for piece in self.pieces])

    @cached_property
    def _summaries(self) -> dict[int, _Summary]:
        return {}

    def _summary(self, order: int) -> _Summary:
        if order not in self._summaries:
            self._summaries[order] = self._summarize(order)
        return self._summaries[order]

    def _summarize(self, order: int) -> _Summary:
        if self._table is not None:
            return self._summarize_table(self._table.derivative(order))
        times, values, square = [], [], 0.0
        for start, piece in zip(self.breaks_s, self.pieces, strict=False):
            cells = resolve(piece, order)
            t = np.sort(cells.candidates_s())
            times.append(start + t)
            values.append(piece.at(t, order))
            square += cells.square_integral()
        t, v = np.concatenate(times), np.concatenate(values)
        k = int(np.argmax(np.abs(v)))
        return _Summary(
            Extent(float(v.min()), float(v.max())), Peak(float(abs(v[k])), float(t[k])), square
        )

    def _summarize_table(self, table: Polynomials) -> _Summary:
        cells, each = table.cells(), np.arange(len(self.pieces))
        k, x = cells.turns()
        k, t = (
            np.concatenate([each, each, k]),
            np.concatenate(
                [0.0 * cells.halves_s, table.durations_s, cells.halves_s[k] * (1.0 + x)]
            ),
        )
        v = table.at(k, t)
        t += self.breaks_s[k]
        first = np.lexsort((t, -np.abs(v)))[0]
        return _Summary(
            Extent(float(v.min()), float(v.max())),
            Peak(float(abs(v[first])), float(t[first])),
            cells.square_integral(),
        )

    def _joined(self, order: int) -> bool:
        starts, ends = self._ends(order)
        if order:
            starts, ends = np.append(starts, 0.0), np.insert(ends, 0, 0.0)
        else:
            starts = starts[1:]
            ends = ends[:-1]
        span = self.extent(0).high - self.extent(0).low
        scale = max(self.peak(order).value, span / self.duration_s**order)
        return bool(np.all(np.abs(starts - ends) <= JUMP * scale))

    def _ends(self, order: int) -> tuple[FloatArray, FloatArray]:
        """Value at the start and at the end of every piece: (pieces,) each."""
        if self._table is not None:
            table, each = self._table.derivative(order), np.arange(len(self.pieces))
            return table.coefficients[:, 0], table.at(each, table.durations_s)
        ends = [piece.at(np.array([0.0, piece.duration_s]), order) for piece in self.pieces]
        return np.array([e[0] for e in ends]), np.array([e[1] for e in ends])
