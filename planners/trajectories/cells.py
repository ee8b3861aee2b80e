"""A piece resolved to rounding error: Legendre series on cells short enough that no extreme can hide.

On a cell where |rate| x half-length <= 1, a series of 16 terms leaves less than 1/(2^15 16!) = 1e-18 of a mode, and
a polynomial is met exactly; so the extremes are the roots of a known polynomial, and the mean square is Parseval's sum
(Trefethen, Approximation Theory and Approximation Practice, 2013, chapters 8 and 18).
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

TERMS = 16
TAIL = (
    1e-13  # a smooth cell is resolved when its last terms are below this share of the largest value
)
MIN_CELL_REL = 2.0**-20  # of the duration; a smooth function needs no shorter cell
COEFFICIENT_ROUNDING_REL = 4e-16
BLOCK = 512  # pieces whose samples are swept together: a million through 10,000 pieces take 4 ms, without blocks 15
HELD = 2_000_000  # numbers held at once


class Cells(NamedTuple):
    """One derivative of a piece as a Legendre series per cell."""

    middles_s: FloatArray  # (cells,)
    halves_s: FloatArray  # (cells,)
    series: FloatArray  # (cells, terms)

    def square_integral(self) -> float:
        """Integral of the square over the piece (Parseval)."""
        norms = 2.0 / (2.0 * np.arange(self.series.shape[1]) + 1.0)
        return float(np.sum(self.halves_s[:, None] * self.series**2 * norms))

    def candidates_s(self) -> FloatArray:
        """Local times among which every extreme is: the ends of the cells and the roots of the slope."""
        k, x = self.turns()
        ends = self.middles_s - self.halves_s, self.middles_s + self.halves_s
        return np.concatenate([*ends, self.middles_s[k] + self.halves_s[k] * x])

    def turns(self) -> tuple[NDArray[np.intp], FloatArray]:
        """Where the slope may be zero: cells and places in them, -1..1, (M,) each."""
        from numpy.polynomial.legendre import legder, legroots

        slopes = legder(self.series, axis=1)  # (cells, terms - 1)
        rest = np.sum(
            np.abs(slopes[:, 1:]), axis=1
        )  # |P_k| <= 1: the slope has no zero where its mean outweighs the rest
        cells, places = [np.zeros(0, dtype=np.intp)], [np.zeros(0)]
        for k in np.flatnonzero((np.abs(slopes[:, 0]) <= rest) & (rest > 0)):
            slope = np.trim_zeros(
                np.where(
                    np.abs(slopes[k]) > COEFFICIENT_ROUNDING_REL * np.abs(self.series[k]).max(),
                    slopes[k],
                    0.0,
                ),
                "b",
            )
            roots = (
                legroots(slope).real if slope.size > 1 else np.zeros(0)
            )  # a spurious one costs a look, no more
            places.append(roots[np.abs(roots) <= 1.0])
            cells.append(np.full(places[-1].size, k))
        return np.concatenate(cells), np.concatenate(places)


@dataclass(frozen=True, eq=False)
class Polynomials(Sequence[ExpPolynomial]):
    """Plain polynomial pieces of a trajectory as one table: ten thousand cost no more than a few."""

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
    def of(cls, pieces: Sequence[Piece]) -> Polynomials | None:
        """The table, or None when a piece is not a plain polynomial."""
        if isinstance(pieces, Polynomials):
            return pieces
        rows = [
            piece.coefficients
            for piece in pieces
            if isinstance(piece, ExpPolynomial) and not piece.modes
        ]
        if len(rows) < len(pieces):
            return None
        powers = max(map(len, rows))
        return cls(
            np.array([p.duration_s for p in pieces]),
            np.array([(*c, *(0.0,) * (powers - len(c))) for c in rows]),
        )

    def derivative(self, order: int) -> Polynomials:
        """The rate of change of that order."""
        c = self.coefficients
        for _ in range(order):
            c = c[:, 1:] * np.arange(1.0, c.shape[1]) if c.shape[1] > 1 else np.zeros_like(c)
        return Polynomials(self.durations_s, c)

    def at(self, k: NDArray[np.intp], t: FloatArray) -> FloatArray:
        """Piece k[i] at its local time t[i]: (M,)."""
        out: FloatArray = self.coefficients[k, -1]
        for c in self.coefficients.T[-2::-1]:
            out *= t
            out += c[k]
        return out

    def sweep(
        self, t: FloatArray, breaks_s: FloatArray, cuts: NDArray[np.intp], out: FloatArray
    ) -> None:
        """Fill out (M,) at ascending times t (M,): piece k, from breaks_s[k] on, has those from cuts[k] to cuts[k + 1]."""
        for k in range(0, len(self), BLOCK):
            last = min(k + BLOCK, len(self))
            here, counts = slice(cuts[k], cuts[last]), np.diff(cuts[k : last + 1])
            if here.start < here.stop:
                x = t[here] - np.repeat(breaks_s[k:last], counts)
                values = np.repeat(self.coefficients[k:last, -1], counts)
                for c in self.coefficients[k:last].T[-2::-1]:
                    values *= x
                    values += np.repeat(c, counts)
                out[here] = values

    def cells(self) -> Cells:
        """A cell a piece; a polynomial is met exactly."""
        x, _, to_series = _gauss_legendre(self.coefficients.shape[1])
        halves = self.durations_s / 2.0
        scaled = self.coefficients * halves[:, None] ** np.arange(self.coefficients.shape[1])
        return Cells(
            halves,
            halves,
            scaled @ np.power.outer(x + 1.0, np.arange(scaled.shape[1])).T @ to_series,
        )


def resolve(piece: Piece, order: int) -> Cells:
    """The cells of a derivative: from the spectrum where it is known, by halving where it is not.

    Raises PlanError when a smooth piece is not smooth.
    """
    if not isinstance(piece, Smooth):
        edges = np.linspace(0.0, piece.duration_s, piece.cells + 1)
        return _series(piece, order, edges[:-1], edges[1:], TERMS + piece.degree)
    edges = np.linspace(0.0, piece.duration_s, 5)
    cells, scale, done = _series(piece, order, edges[:-1], edges[1:], TERMS), 0.0, []
    while cells.middles_s.size:
        scale = max(scale, float(np.abs(cells.series).max()))
        open_ = np.abs(cells.series[:, -2:]).max(axis=1) > TAIL * scale
        done.append(Cells(*(field[~open_] for field in cells)))
        m, h = cells.middles_s[open_], cells.halves_s[open_]
        if h.size and h.min() < MIN_CELL_REL * piece.duration_s:
            raise PlanError(
                f"derivative {order} of a smooth piece jumps or bends near its {float(m[0]):.6g} s; "
                f"its cells must resolve at {MIN_CELL_REL * piece.duration_s:.3g} s: split the piece there"
            )
        cells = _series(piece, order, np.concatenate([m - h, m]), np.concatenate([m, m + h]), TERMS)
    return Cells(*(np.concatenate(fields) for fields in zip(*done, strict=True)))


def exponential_integral(piece: Piece, order: int, eigenvalues_1_s: ComplexArray) -> ComplexArray:
    """Integral over the piece of its derivative times exp(rate (end - t)), for rates (R,), by Gauss-Legendre on the cells."""
    cells = resolve(piece, order)
    x, w, _ = _gauss_legendre(TERMS)
    parts = max(1, math.ceil(float(cells.halves_s.max() * np.abs(eigenvalues_1_s).max())))
    sub = (2.0 * np.arange(parts) + 1.0) / parts - 1.0  # middles of the parts of a cell, in [-1, 1]
    middles = (cells.middles_s[:, None] + cells.halves_s[:, None] * sub).reshape(-1, 1)
    halves = np.repeat(cells.halves_s / parts, parts)[:, None]
    t = middles + halves * x  # (parts of cells, nodes)
    pushes, left = (halves * w * piece.at(t, order)).ravel(), piece.duration_s - t.ravel()
    blocks = np.array_split(eigenvalues_1_s, math.ceil(left.size * eigenvalues_1_s.size / HELD))
    return np.concatenate([pushes @ np.exp(np.outer(left, block)) for block in blocks])


def _series(piece: Piece, order: int, starts: FloatArray, ends: FloatArray, terms: int) -> Cells:
    x, _, to_series = _gauss_legendre(terms)
    middles, halves = (starts + ends) / 2, (ends - starts) / 2
    values = piece.at(middles[:, None] + halves[:, None] * x, order)  # (cells, terms)
    return Cells(middles, halves, values @ to_series)


@lru_cache(maxsize=32)
def _gauss_legendre(terms: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Nodes (terms,), weights (terms,) and the matrix (terms, terms) from values at the nodes to the series."""
    from numpy.polynomial.legendre import leggauss, legvander

    x, w = leggauss(terms)
    to_series = w[:, None] * legvander(x, terms - 1) * (np.arange(terms) + 0.5)
    return x, w, to_series
