"""First crossing of a polynomial on [0, 1] below a bound, by enclosure: no short dip is missed."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from math import comb

MIN_WIDTH_REL = 2.0**-50  # of the interval: resolution of a crossing
FIRST_TERMS = 6  # of a Taylor step these nearly always decide
MIN_FIRST_WIDTH = 2.0**-6


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
    if terms[0] - sum(map(abs, terms[1:])) >= bound or _stays_above(terms, bound):
        return None
    pending = [(0.0, 1.0, _bernstein(terms))]
    while pending:
        left, width, coefficients = pending.pop()
        if min(coefficients) >= bound:
            continue
        if coefficients[0] < bound or width <= MIN_WIDTH_REL:
            return left
        if all(a >= b for a, b in pairwise(coefficients)):  # it falls on all of the interval
            return _bisect(terms, bound, left, width)
        first, second = _halve(coefficients)
        width *= 0.5
        pending += ((left + width, width, second), (left, width, first))
    return None


def _stays_above(terms: list[float], bound: float) -> bool:
    """Tell if the first terms alone show that the sum stays above the bound, which costs less.

    The sum lies at most the magnitudes of the further terms below that of the first ones.
    """
    if len(terms) <= FIRST_TERMS:
        return False
    limit = bound + sum(map(abs, terms[FIRST_TERMS:]))
    pending = [(1.0, _bernstein(terms[:FIRST_TERMS]))]
    while pending:
        width, coefficients = pending.pop()
        if min(coefficients) >= limit:
            continue
        if min(coefficients[0], coefficients[-1]) < limit or width < MIN_FIRST_WIDTH:
            return False
        pending += [(0.5 * width, half) for half in _halve(coefficients)]
    return True


def _bisect(terms: list[float], bound: float, left: float, width: float) -> float:
    """Bisect an interval on which the sum falls through the bound."""
    while width > MIN_WIDTH_REL:
        width *= 0.5
        if value(terms, left + width) >= bound:
            left += width
    return left


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
