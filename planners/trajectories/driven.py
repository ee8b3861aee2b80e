"""What a mode does while a push acts: q' = rate q + push(t) in closed form, near and at resonance too."""

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


class Term(NamedTuple):
    """p(t) exp(rate t) with a complex polynomial p."""

    rate_1_s: complex
    coefficients: tuple[complex, ...]  # of p, ascending powers of t

    def at(self, t: float) -> complex:
        """Value at local time t."""
        return cmath.exp(self.rate_1_s * t) * sum(
            (c * t**k for k, c in enumerate(self.coefficients)), 0j
        )


def driven(push: ExpPolynomial, rate_1_s: complex, start: complex) -> list[Term]:
    """q(t) from `start` on, as a sum of terms: what the push forces, then the free motion."""
    sources = [Term(0j, tuple(complex(c) for c in push.coefficients))]
    for rate, p in push.modes:  # the real part of a wave is half of it and half of its conjugate
        sources.append(Term(rate, tuple(c / 2.0 for c in p)))
        sources.append(Term(rate.conjugate(), tuple(c.conjugate() / 2.0 for c in p)))
    forced = [Term(s, _particular(s - rate_1_s, p, push.duration_s)) for s, p in sources]
    return [*forced, Term(rate_1_s, (start - sum(term.coefficients[0] for term in forced),))]


def real_part(parts: Iterable[tuple[complex, Term]], duration_s: float) -> ExpPolynomial:
    """Re(sum of factor x term) as a piece; a wave and its conjugate are one mode."""
    modes: dict[complex, list[complex]] = {}
    for factor, (rate, p) in parts:
        c = [factor * a for a in p]
        if rate.imag < 0.0:
            rate, c = rate.conjugate(), [a.conjugate() for a in c]
        modes[rate] = [a + b for a, b in zip_longest(modes.get(rate, ()), c, fillvalue=0j)]
    line = tuple(a.real for a in modes.pop(0j, [0j]))
    return ExpPolynomial(
        duration_s, line, tuple(ModalTerm(rate, tuple(c)) for rate, c in modes.items())
    )


def accelerations(piece: Piece) -> list[ExpPolynomial]:
    """The acceleration of a piece in closed form; a smooth piece as the polynomials that resolve it to rounding."""
    if isinstance(piece, ExpPolynomial):
        return [piece.derivative().derivative()]
    from numpy.polynomial.legendre import leg2poly

    cells, out = resolve(piece, 2), []
    for k in cells.middles_s.argsort():
        half = float(cells.halves_s[k])
        local = polynomial(
            2.0 * half, [c / half**j for j, c in enumerate(leg2poly(cells.series[k]))]
        )
        out.append(local.window(-half, 2.0 * half))
    return out


def _particular(slip: complex, p: tuple[complex, ...], duration_s: float) -> tuple[complex, ...]:
    """q with q' + slip q = p: by parts, or as a power series where the push almost meets the mode.

    The two lose equally little where |slip| x duration is a third of the degree.
    """
    reach = abs(slip) * duration_s
    if reach > max(1.0, (len(p) - 1) / 3.0):
        return exponential_antiderivative(slip, p)
    term = total = polynomial_integral(p)
    m, size = 1, 1.0
    while slip and size > 1e-18:
        term = tuple(-slip * c for c in polynomial_integral(term))
        total = tuple(a + b for a, b in zip_longest(total, term, fillvalue=0j))
        m, size = m + 1, size * reach / (m + 1)
    return total
