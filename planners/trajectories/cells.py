"""Legendre series of a piece on cells, accurate to rounding, short enough to show every extreme.

On a cell where |rate| x half-length <= 1, a series of 16 terms leaves less than
1/(2^15 16!) = 1e-18 of a mode, and a polynomial is represented exactly. So the extremes are
roots of a known polynomial, and the mean square is Parseval's sum (Trefethen, Approximation
Theory and Approximation Practice, 2013, chapters 8 and 18).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from planners.errors import PlanError
from planners.trajectories.pieces import ComplexArray, ExpPolynomial, FloatArray, Piece, Smooth

TERMS = 16  # of a series
START_CELLS = 4  # of a smooth piece, before halving
TAIL_REL = 1e-13  # of the largest value: last two terms of a resolved cell of a smooth piece
MIN_CELL_REL = 2.0**-20  # of the duration; a smooth function needs no shorter cell
COEFFICIENT_ROUNDING_REL = 4e-16  # of the largest coefficient of a series
BLOCK_PIECES = 512  # evaluated together: 1e6 times in 10,000 pieces take 4 ms, unblocked 15 ms
MAX_HELD_NUMBERS = 2_000_000  # entries of one matrix of exponentials


class Cells(NamedTuple):
    """One derivative of a piece as a Legendre series per cell."""

    middles_s: FloatArray  # (cells,)
    halves_s: FloatArray  # (cells,)
    series: FloatArray  # (cells, terms)

    def square_integral(self) -> float:
        """Compute the integral of the square over the piece (Parseval)."""
        norms = 2.0 / (2.0 * np.arange(self.series.shape[1]) + 1.0)
        return float(np.sum(self.halves_s[:, None] * self.series**2 * norms))

    def candidates_s(self) -> FloatArray:
        """List the local times that include every extreme: cell ends and stationary points."""
        k, x = self.stationary_points()
        ends = self.middles_s - self.halves_s, self.middles_s + self.halves_s
        return np.concatenate([*ends, self.middles_s[k] + self.halves_s[k] * x])

    def stationary_points(self) -> tuple[NDArray[np.intp], FloatArray]:
        """Find candidates for zeros of the slope: cells and places in them, -1..1, (M,) each.

        A spurious candidate does no harm: its value lies between the extremes.
        """
        from numpy.polynomial.legendre import legder, legroots

        slopes = legder(self.series, axis=1)  # (cells, terms - 1)
        # |P_k| <= 1: the slope has no zero where its mean outweighs the other terms
        others = np.sum(np.abs(slopes[:, 1:]), axis=1)
        cells, places = [np.zeros(0, dtype=np.intp)], [np.zeros(0)]
        for k in np.flatnonzero((np.abs(slopes[:, 0]) <= others) & (others > 0)):
            rounding = COEFFICIENT_ROUNDING_REL * np.abs(self.series[k]).max()
            significant = np.where(np.abs(slopes[k]) > rounding, slopes[k], 0.0)
            slope = np.trim_zeros(significant, "b")
            roots = legroots(slope).real if slope.size > 1 else np.zeros(0)
            places.append(roots[np.abs(roots) <= 1.0])
            cells.append(np.full(places[-1].size, k))
        return np.concatenate(cells), np.concatenate(places)


@dataclass(frozen=True, eq=False)
class Polynomials(Sequence[ExpPolynomial]):
    """Table of the polynomial pieces of a trajectory; fast for ten thousand pieces too."""

    durations_s: FloatArray  # (K,)
    coefficients: FloatArray  # (K, powers) ascending

    def __len__(self) -> int:
        return self.durations_s.size

    @overload
    def __getitem__(self, k: int) -> ExpPolynomial: ...
    @overload
    def __getitem__(self, k: slice) -> Polynomials: ...
    def __getitem__(self, k: int | slice) -> ExpPolynomial | Polynomials:
        if isinstance(k, slice):
            return Polynomials(self.durations_s[k], self.coefficients[k])
        return ExpPolynomial(float(self.durations_s[k]), tuple(self.coefficients[k].tolist()))

    def __iter__(self) -> Iterator[ExpPolynomial]:
        rows = zip(self.durations_s.tolist(), self.coefficients.tolist(), strict=True)
        return (ExpPolynomial(duration_s, tuple(row)) for duration_s, row in rows)

    @classmethod
    def from_pieces(cls, pieces: Sequence[Piece]) -> Polynomials | None:
        """Build the table; return None when a piece is not a plain polynomial."""
        if isinstance(pieces, Polynomials):
            return pieces
        rows: list[tuple[float, ...]] = []
        for piece in pieces:
            if not isinstance(piece, ExpPolynomial) or piece.modes:
                return None
            rows.append(piece.coefficients)
        powers = max(map(len, rows))
        padded = [(*c, *(0.0,) * (powers - len(c))) for c in rows]
        return cls(np.array([p.duration_s for p in pieces]), np.array(padded))

    def derivative(self, order: int) -> Polynomials:
        """Compute the derivative of that order."""
        c = self.coefficients
        for _ in range(order):
            c = c[:, 1:] * np.arange(1.0, c.shape[1]) if c.shape[1] > 1 else np.zeros_like(c)
        return Polynomials(self.durations_s, c)

    def at(self, k: NDArray[np.intp], t: FloatArray) -> FloatArray:
        """Compute piece k[i] at its local time t[i]: (M,)."""
        out: FloatArray = self.coefficients[k, -1]
        for c in self.coefficients.T[-2::-1]:
            out *= t
            out += c[k]
        return out

    def evaluate_sorted(
        self, t: FloatArray, breaks_s: FloatArray, cuts: NDArray[np.intp], out: FloatArray
    ) -> None:
        """Fill out (M,) with the values at ascending times t (M,).

        Piece k starts at breaks_s[k] and has the times from cuts[k] to cuts[k + 1].
        """
        for k in range(0, len(self), BLOCK_PIECES):
            last = min(k + BLOCK_PIECES, len(self))
            here, counts = slice(cuts[k], cuts[last]), np.diff(cuts[k : last + 1])
            if here.start < here.stop:
                x = t[here] - np.repeat(breaks_s[k:last], counts)
                values = np.repeat(self.coefficients[k:last, -1], counts)
                for c in self.coefficients[k:last].T[-2::-1]:
                    values *= x
                    values += np.repeat(c, counts)
                out[here] = values

    def cells(self) -> Cells:
        """Compute the Legendre series, one cell per piece; exact."""
        powers = self.coefficients.shape[1]
        x, _, to_series = _gauss_legendre(powers)
        halves = self.durations_s / 2.0
        scaled = self.coefficients * halves[:, None] ** np.arange(powers)
        values = scaled @ np.power.outer(x + 1.0, np.arange(powers)).T
        return Cells(halves, halves, values @ to_series)


def resolve(piece: Piece, order: int) -> Cells:
    """Compute the cells of a derivative of a piece.

    Closed forms have equal cells, their number known from the fastest mode. Cells of a smooth
    piece are halved until resolved; raises PlanError when they would become shorter than
    MIN_CELL_REL of the piece, as the derivative then has a step or a kink.
    """
    if not isinstance(piece, Smooth):
        edges = np.linspace(0.0, piece.duration_s, piece.cell_count + 1)
        return _series(piece, order, edges[:-1], edges[1:], TERMS + piece.degree)
    edges = np.linspace(0.0, piece.duration_s, START_CELLS + 1)
    cells = _series(piece, order, edges[:-1], edges[1:], TERMS)
    scale, done = 0.0, []
    while cells.middles_s.size:
        scale = max(scale, float(np.abs(cells.series).max()))
        tail = TAIL_REL * scale + float(np.finfo(np.float64).tiny)  # below it no digit is sure
        unresolved = np.abs(cells.series[:, -2:]).max(axis=1) > tail
        done.append(Cells(*(field[~unresolved] for field in cells)))
        m, h = cells.middles_s[unresolved], cells.halves_s[unresolved]
        if h.size and h.min() < MIN_CELL_REL * piece.duration_s:
            raise PlanError(
                f"derivative {order} of a smooth piece has a step or a kink near its "
                f"{float(m[0]):.6g} s; its cells must resolve at "
                f"{MIN_CELL_REL * piece.duration_s:.3g} s: split the piece there"
            )
        cells = _series(piece, order, np.concatenate([m - h, m]), np.concatenate([m, m + h]), TERMS)
    return Cells(*(np.concatenate(fields) for fields in zip(*done, strict=True)))


def exponential_integral(piece: Piece, order: int, eigenvalues_1_s: ComplexArray) -> ComplexArray:
    """Compute int_0^T q^(order)(t) exp(rate (T - t)) dt over a piece, for rates (R,).

    Gauss-Legendre on the cells of the piece.
    """
    cells = resolve(piece, order)
    x, w, _ = _gauss_legendre(TERMS)
    parts = max(1, math.ceil(float(cells.halves_s.max() * np.abs(eigenvalues_1_s).max())))
    sub = (2.0 * np.arange(parts) + 1.0) / parts - 1.0  # middles of the parts of a cell, in [-1, 1]
    middles = (cells.middles_s[:, None] + cells.halves_s[:, None] * sub).reshape(-1, 1)
    halves = np.repeat(cells.halves_s / parts, parts)[:, None]
    t = middles + halves * x  # (parts of cells, nodes)
    forcings = (halves * w * piece.at(t, order)).ravel()
    left = piece.duration_s - t.ravel()  # time to the end of the piece
    block_count = math.ceil(left.size * eigenvalues_1_s.size / MAX_HELD_NUMBERS)
    blocks = np.array_split(eigenvalues_1_s, block_count)
    return np.concatenate([forcings @ np.exp(np.outer(left, block)) for block in blocks])


def _series(piece: Piece, order: int, starts: FloatArray, ends: FloatArray, terms: int) -> Cells:
    x, _, to_series = _gauss_legendre(terms)
    middles, halves = (starts + ends) / 2, (ends - starts) / 2
    values = piece.at(middles[:, None] + halves[:, None] * x, order)  # (cells, terms)
    return Cells(middles, halves, values @ to_series)


@lru_cache(maxsize=32)
def _gauss_legendre(terms: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute nodes (terms,), weights (terms,) and the matrix (terms, terms) to a series.

    The matrix maps values at the nodes to Legendre coefficients.
    """
    from numpy.polynomial.legendre import leggauss, legvander

    x, w = leggauss(terms)
    to_series = w[:, None] * legvander(x, terms - 1) * (np.arange(terms) + 0.5)
    return x, w, to_series
