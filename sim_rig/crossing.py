"""Where a polynomial on [0, 1] first falls below a floor: found by enclosure, so that no short dip is missed."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from math import comb

NARROW = 2.0**-50  # of the interval: as close as a crossing is located


def value(terms: list[float], at: float) -> float:
    """The sum of terms[k] at^k."""
    total = 0.0
    for term in reversed(terms):
        total = total * at + term
    return total


def first_below(terms: list[float], floor: float) -> float | None:
    """The last place in [0, 1] before the sum of terms[k] t^k is first below the floor; None where it never is.

    On any interval a polynomial lies between its smallest and largest Bernstein coefficient (Farin, Curves and Surfaces for
    CAGD, section 5); intervals that these leave in doubt are halved (de Casteljau), the leftmost first.
    """
    if terms[0] - sum(map(abs, terms[1:])) >= floor:
        return None
    pending = [(0.0, 1.0, _bernstein(terms))]
    while pending:
        left, width, ordinates = pending.pop()
        if min(ordinates) >= floor:
            continue
        if ordinates[0] < floor or width <= NARROW:
            return left
        first, second = _halves(ordinates)
        width *= 0.5
        pending += ((left + width, width, second), (left, width, first))
    return None


def _bernstein(terms: list[float]) -> list[float]:
    """Ordinates b_i = sum over k of C(i, k) / C(n, k) terms[k]."""
    return [
        sum(share * term for share, term in zip(row, terms, strict=False))
        for row in _shares(len(terms) - 1)
    ]


@cache
def _shares(degree: int) -> list[list[float]]:
    return [[comb(i, k) / comb(degree, k) for k in range(i + 1)] for i in range(degree + 1)]


def _halves(ordinates: list[float]) -> tuple[list[float], list[float]]:
    """The same polynomial on the first and on the second half of its interval."""
    first, second = [ordinates[0]], [ordinates[-1]]
    while len(ordinates) > 1:
        ordinates = [0.5 * (a + b) for a, b in pairwise(ordinates)]
        first.append(ordinates[0])
        second.append(ordinates[-1])
    return first, second[::-1]
