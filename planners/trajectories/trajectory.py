"""Trajectory of one axis: pieces end to end, with exact extremes and mean squares."""

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

MIN_TABLE_PIECES = 16  # fewer plain polynomials are evaluated piece by piece
BLOCK_INSTANTS = 8192  # evaluated together, to stay in the cache: a third faster for a million
END_ROUNDING_REL = 1e-12  # of the duration; later by less is the end: sums of durations round
JUMP_REL = 1e-9  # of the largest value; a smaller step is rounding


class Peak(NamedTuple):
    """Largest absolute value of a derivative, and the first instant it is reached."""

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
    """Position of one axis [m] over time [s], at rest before the start and after the end.

    A derivative at a joint is that of the piece that begins there; at duration_s that of the
    last piece. Raises PlanError without pieces, or with a piece whose duration is not finite
    and > 0.
    """

    pieces: Sequence[Piece]

    def __post_init__(self) -> None:
        if not self.pieces:
            raise PlanError("a trajectory of 0 pieces; must be >= 1: use Trajectory.hold for rest")
        durations = self._durations_s
        for k in np.flatnonzero(~((durations > 0.0) & (durations < math.inf)))[:1]:
            raise PlanError(
                f"duration_s = {durations[k]} of piece {k}; must be finite and > 0: "
                "leave the piece out"
            )

    @classmethod
    def hold(cls, position_m: float, duration_s: float) -> Trajectory:
        """Build a trajectory at rest at position_m."""
        return cls((polynomial(duration_s, (position_m,)),))

    @cached_property
    def breaks_s(self) -> FloatArray:
        """Start times of the pieces and the end: (pieces + 1,), from 0."""
        return np.concatenate([[0.0], np.cumsum(self._durations_s)])

    @property
    def duration_s(self) -> float:
        """Time from start to end [s]."""
        return float(self.breaks_s[-1])

    def at(self, t_s: ArrayLike, order: int = 0) -> FloatArray:
        """Compute the derivative of that order at times of any shape, in that shape.

        Raises PlanError for a time that is not a number or a derivative that a smooth piece does
        not declare.
        """
        t = np.asarray(t_s, dtype=np.float64)
        flat = t.ravel()
        if np.isnan(flat).any():
            raise PlanError(
                "t_s holds nan; every time must be a number: "
                "correct the clock or the table it comes from"
            )
        if flat.size > 1 and np.any(flat[1:] < flat[:-1]):
            rank = np.argsort(flat, kind="stable")
            values = np.empty_like(flat)
            values[rank] = self._at_sorted(flat[rank], order)
        else:
            values = self._at_sorted(flat, order)
        return values.reshape(t.shape)

    def peak(self, order: int = 0) -> Peak:
        """Compute the largest absolute value, both sides of every joint; exact to rounding."""
        return self._summary(order).peak

    def extent(self, order: int = 0) -> Extent:
        """Compute the lowest and highest value; exact to rounding."""
        return self._summary(order).extent

    def rms(self, order: int = 0) -> float:
        """Compute the root mean square over [0, duration_s]; exact to rounding."""
        return math.sqrt(self._summary(order).square_integral / self.duration_s)

    def continuous(self, order: int) -> bool:
        """Test that derivatives 0..order have no step at a joint or against rest at an end."""
        return all(self._has_no_step(k) for k in range(order + 1))

    def then(self, other: Trajectory) -> Trajectory:
        """Append the other trajectory. Raises PlanError for a step in position."""
        end, start = self._ends(0)[1][-1], other._ends(0)[0][0]
        if abs(start - end) > JUMP_REL * max(1.0, abs(end)):
            raise PlanError(
                f"position steps from {end} m to {start} m; must meet within {JUMP_REL:g} m: "
                "shift the second part"
            )
        return Trajectory((*self.pieces, *other.pieces))

    def scaled(self, factor: float) -> Trajectory:
        """Multiply the position by factor."""
        return Trajectory(tuple(piece.scaled(factor) for piece in self.pieces))

    def shifted(self, offset_m: float) -> Trajectory:
        """Shift the position by offset_m."""
        return Trajectory(
            tuple(add(piece, polynomial(piece.duration_s, (offset_m,))) for piece in self.pieces)
        )

    def _at_sorted(self, t: FloatArray, order: int) -> FloatArray:
        first, last = self.pieces[0], self.pieces[-1]
        cuts = np.searchsorted(t, self.breaks_s)  # (pieces + 1,)
        end = float(self.breaks_s[-1])
        last_instant = end * (1.0 + END_ROUNDING_REL)
        cuts[-1] = np.searchsorted(t, last_instant, side="right")
        t = np.where((t > end) & (t <= last_instant), end, t)
        values = np.zeros_like(t)
        if order == 0 and cuts[0] > 0:
            values[: cuts[0]] = first.at(np.zeros(()))
        if order == 0 and cuts[-1] < t.size:
            values[cuts[-1] :] = last.at(np.asarray(last.duration_s))
        if self._table is not None:
            self._table.derivative(order).evaluate_sorted(t, self.breaks_s, cuts, values)
            return values
        for k in np.flatnonzero(np.diff(cuts)).tolist():
            for begin in range(cuts[k], cuts[k + 1], BLOCK_INSTANTS):
                here = slice(begin, min(begin + BLOCK_INSTANTS, cuts[k + 1]))
                values[here] = self.pieces[k].at(t[here] - self.breaks_s[k], order)
        return values

    @cached_property
    def _table(self) -> Polynomials | None:
        return (
            Polynomials.from_pieces(self.pieces) if len(self.pieces) >= MIN_TABLE_PIECES else None
        )

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
        extent = Extent(float(v.min()), float(v.max()))
        return _Summary(extent, Peak(float(abs(v[k])), float(t[k])), square)

    def _summarize_table(self, table: Polynomials) -> _Summary:
        cells, each = table.cells(), np.arange(len(self.pieces))
        inner, x = cells.stationary_points()
        k = np.concatenate([each, each, inner])
        inner_times = cells.halves_s[inner] * (1.0 + x)
        t = np.concatenate([0.0 * cells.halves_s, table.durations_s, inner_times])
        v = table.at(k, t)
        t += self.breaks_s[k]
        first = np.lexsort((t, -np.abs(v)))[0]
        extent = Extent(float(v.min()), float(v.max()))
        peak = Peak(float(abs(v[first])), float(t[first]))
        return _Summary(extent, peak, cells.square_integral())

    def _has_no_step(self, order: int) -> bool:
        starts, ends = self._ends(order)
        if order:
            starts, ends = np.append(starts, 0.0), np.insert(ends, 0, 0.0)
        else:
            starts = starts[1:]
            ends = ends[:-1]
        span = self.extent(0).high - self.extent(0).low
        scale = max(self.peak(order).value, span / self.duration_s**order)
        return bool(np.all(np.abs(starts - ends) <= JUMP_REL * scale))

    def _ends(self, order: int) -> tuple[FloatArray, FloatArray]:
        """Compute the values at the start and at the end of every piece: (pieces,) each."""
        if self._table is not None:
            table, each = self._table.derivative(order), np.arange(len(self.pieces))
            return table.coefficients[:, 0], table.at(each, table.durations_s)
        ends = [piece.at(np.array([0.0, piece.duration_s]), order) for piece in self.pieces]
        return np.array([e[0] for e in ends]), np.array([e[1] for e in ends])
