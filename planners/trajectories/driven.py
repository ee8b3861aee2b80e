"""Closed-form forced response of a mode: q' = rate q + forcing(t), near and at resonance too."""

from __future__ import annotations

import cmath
from collections.abc import Iterable
from itertools import zip_longest
from typing import NamedTuple

from planners.trajectories.cells import resolve
from planners.trajectories.pieces import (
    ExpPolynomial,
    ModalTerm,
    Piece,
    exponential_antiderivative,
    polynomial,
    polynomial_integral,
)

SERIES_END_REL = 1e-18  # bound of the last term of the power series


class Term(NamedTuple):
    """Term p(t) exp(rate t) with a complex polynomial p."""

    rate_1_s: complex
    coefficients: tuple[complex, ...]  # of p, ascending powers of t

    def at(self, t: float) -> complex:
        """Compute the value at local time t."""
        p = sum((c * t**k for k, c in enumerate(self.coefficients)), 0j)
        return cmath.exp(self.rate_1_s * t) * p


def forced_response(forcing: ExpPolynomial, rate_1_s: complex, start: complex) -> list[Term]:
    """Compute q(t) from q(0) = start as a sum of terms: the forced ones, then the free motion."""
    sources = [Term(0j, tuple(complex(c) for c in forcing.coefficients))]
    for rate, p in forcing.modes:  # a real wave is half of the mode and half of its conjugate
        sources.append(Term(rate, tuple(c / 2.0 for c in p)))
        sources.append(Term(rate.conjugate(), tuple(c.conjugate() / 2.0 for c in p)))
    forced = [Term(s, _particular(s - rate_1_s, p, forcing.duration_s)) for s, p in sources]
    free = Term(rate_1_s, (start - sum(term.coefficients[0] for term in forced),))
    return [*forced, free]


def real_part(parts: Iterable[tuple[complex, Term]], duration_s: float) -> ExpPolynomial:
    """Compute Re(sum of factor x term) as a piece; conjugate rates become one mode."""
    modes: dict[complex, list[complex]] = {}
    for factor, (rate, p) in parts:
        c = [factor * a for a in p]
        if rate.imag < 0.0:
            rate, c = rate.conjugate(), [a.conjugate() for a in c]
        modes[rate] = [a + b for a, b in zip_longest(modes.get(rate, ()), c, fillvalue=0j)]
    line = tuple(a.real for a in modes.pop(0j, [0j]))
    terms = tuple(ModalTerm(rate, tuple(c)) for rate, c in modes.items())
    return ExpPolynomial(duration_s, line, terms)


def accelerations(piece: Piece) -> list[ExpPolynomial]:
    """Compute the acceleration of a piece in closed form.

    The acceleration of a smooth piece becomes the polynomials that resolve it to rounding.
    """
    if isinstance(piece, ExpPolynomial):
        return [piece.derivative().derivative()]
    from numpy.polynomial.legendre import leg2poly

    cells, out = resolve(piece, 2), []
    for k in cells.middles_s.argsort():
        half = float(cells.halves_s[k])
        powers = [c / half**j for j, c in enumerate(leg2poly(cells.series[k]))]
        out.append(polynomial(2.0 * half, powers).window(-half, 2.0 * half))
    return out


def _particular(
    detuning: complex, p: tuple[complex, ...], duration_s: float
) -> tuple[complex, ...]:
    """Compute a polynomial q with q' + detuning q = p.

    Far from resonance by parts, near it as a power series. The two lose equally many digits
    where |detuning| x duration is a third of the degree.
    """
    span = abs(detuning) * duration_s
    if span > max(1.0, (len(p) - 1) / 3.0):
        return exponential_antiderivative(detuning, p)
    term = total = polynomial_integral(p)
    m, size = 1, 1.0
    while detuning and size > SERIES_END_REL:
        term = tuple(-detuning * c for c in polynomial_integral(term))
        total = tuple(a + b for a, b in zip_longest(total, term, fillvalue=0j))
        m, size = m + 1, size * span / (m + 1)
    return total
