"""First crossing of a polynomial on [0, 1] below a bound, by enclosure: no short dip is missed."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from math import comb

MIN_WIDTH_REL = 2.0**-50  # of the interval: resolution of a crossing


def value(terms: list[float], t: float) -> float:
    """Evaluate the sum of terms[k] t^k."""
    total = 0.0
    for term in reversed(terms):
        total = total * t + term
    return total


def first_below(terms: list[float], bound: float) -> float | None:
    """Find the last t in [0, 1] before the sum of terms[k] t^k first falls below the bound.

    Returns None if it does not. On an interval a polynomial lies between its smallest and largest
    Bernstein coefficient (Farin, Curves and Surfaces for CAGD, section 5); intervals for which
    these do not decide are halved (de Casteljau), the left half first.
    """
    if terms[0] - sum(map(abs, terms[1:])) >= bound:
        return None
    pending = [(0.0, 1.0, _bernstein(terms))]
    while pending:
        left, width, coefficients = pending.pop()
        if min(coefficients) >= bound:
            continue
        if coefficients[0] < bound or width <= MIN_WIDTH_REL:
            return left
        first, second = _halve(coefficients)
        width *= 0.5
        pending += ((left + width, width, second), (left, width, first))
    return None


def _bernstein(terms: list[float]) -> list[float]:
    """Compute the Bernstein coefficients b_i = sum over k of C(i, k) / C(n, k) terms[k]."""
    return [
        sum(ratio * term for ratio, term in zip(row, terms, strict=False))
        for row in _binomial_ratios(len(terms) - 1)
    ]


@cache
def _binomial_ratios(degree: int) -> list[list[float]]:
    return [[comb(i, k) / comb(degree, k) for k in range(i + 1)] for i in range(degree + 1)]


def _halve(coefficients: list[float]) -> tuple[list[float], list[float]]:
    """Compute the coefficients on the first and on the second half of the interval."""
    first = [coefficients[0]]
    second = [coefficients[-1]]
    while len(coefficients) > 1:
        coefficients = [0.5 * (a + b) for a, b in pairwise(coefficients)]
        first.append(coefficients[0])
        second.append(coefficients[-1])
    return first, second[::-1]
