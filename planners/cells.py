"""A piece resolved to rounding error: Legendre series on cells short enough that no extreme can hide.

On a cell where |rate| x half-length <= 1, a series of 16 terms leaves less than 1/(2^15 16!) = 1e-18 of a mode, and
a polynomial is met exactly; so the extremes are the roots of a known polynomial, and the mean square is Parseval's sum
(Trefethen, Approximation Theory and Approximation Practice, 2013, chapters 8 and 18).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from planners.errors import PlanError
from planners.pieces import FloatArray, Piece, Smooth

TERMS = 16
TAIL = 1e-13  # a smooth cell is resolved when its last terms are below this share of the largest value
SHORTEST = 2.0**-20  # of the duration; a smooth function needs no shorter cell
ROUNDING = 4e-16


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
        from numpy.polynomial.legendre import legder, legroots

        slopes = legder(self.series, axis=1)  # (cells, terms - 1)
        rest = np.sum(np.abs(slopes[:, 1:]), axis=1)  # |P_k| <= 1: the slope has no zero where its mean outweighs the rest
        times = [self.middles_s - self.halves_s, self.middles_s + self.halves_s]
        for k in np.flatnonzero((np.abs(slopes[:, 0]) <= rest) & (rest > 0)):
            slope = np.trim_zeros(np.where(np.abs(slopes[k]) > ROUNDING * np.abs(self.series[k]).max(), slopes[k], 0.0), "b")
            roots = legroots(slope).real if slope.size > 1 else np.zeros(0)  # a spurious one costs a look, no more
            times.append(self.middles_s[k] + self.halves_s[k] * roots[np.abs(roots) <= 1.0])
        return np.concatenate(times)


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
        if h.size and h.min() < SHORTEST * piece.duration_s:
            raise PlanError(
                f"derivative {order} of a smooth piece jumps or bends near its {float(m[0]):.6g} s; "
                f"its cells must resolve at {SHORTEST * piece.duration_s:.3g} s: split the piece there"
            )
        cells = _series(piece, order, np.concatenate([m - h, m]), np.concatenate([m, m + h]), TERMS)
    return Cells(*(np.concatenate(fields) for fields in zip(*done, strict=True)))


def exponential_integral(piece: Piece, order: int, rate_1_s: complex) -> complex:
    """Integral over the piece of its derivative times exp(-rate t), by Gauss-Legendre on the cells."""
    cells = resolve(piece, order)
    x, w, _ = _gauss_legendre(TERMS)
    parts = max(1, int(np.ceil(float(cells.halves_s.max()) * abs(rate_1_s))))
    sub = (2.0 * np.arange(parts) + 1.0) / parts - 1.0  # middles of the parts of a cell, in [-1, 1]
    middles = (cells.middles_s[:, None] + cells.halves_s[:, None] * sub).ravel()
    halves = np.repeat(cells.halves_s / parts, parts)
    t = middles[:, None] + halves[:, None] * x
    return complex(np.sum(halves[:, None] * w * piece.at(t, order) * np.exp(-rate_1_s * t)))


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
