"""Polynomials between two states: any derivatives at both ends, and rest to rest of degree 2 n + 1, in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb, factorial

from planners import bounds
from planners.errors import PlanError
from planners.trajectories.pieces import polynomial
from planners.trajectories.trajectory import Trajectory

SMOOTHEST = 7  # of rest_to_rest: beyond it the powers cancel and the end derivatives miss 0 by more than 1e-9


def between(start: Sequence[float], end: Sequence[float], duration_s: float) -> Trajectory:
    """The polynomial of least degree with given position, speed, acceleration, ... at both ends.

    start (m,), end (n,): position [m] and its derivatives [m/s^k], as many as are to be met, at least the position;
    the degree is m + n - 1 (source 000 for 3 and 5). Two-point Taylor expansion: first m powers from the start, the others
    from (q - those) / x^m expanded about the end. Raises PlanError for an empty state, numbers out of bounds, and
    more than SMOOTHEST derivatives at an end.
    """
    bounds.duration(duration_s)
    for name, state in (("start", start), ("end", end)):
        if not 1 <= len(state) <= SMOOTHEST + 1:
            raise PlanError(
                f"{name} = {tuple(state)}; must hold 1 to {SMOOTHEST + 1} numbers: give position, speed, ..."
            )
        for k, value in enumerate(state):
            bounds.rate(f"{name}[{k}]", value)
    m, n, origin = len(start), len(end), float(start[0])
    head = [
        d * duration_s**k / factorial(k) for k, d in enumerate((0.0, *start[1:]))
    ]  # powers of x = t / T
    goal = [
        d * duration_s**k / factorial(k) for k, d in enumerate((end[0] - origin, *end[1:]))
    ]  # powers of x - 1
    lack = [g - sum(comb(i, k) * head[i] for i in range(k, m)) for k, g in enumerate(goal)]
    rest = [
        sum(lack[j] * (-1) ** (i - j) * comb(m + i - j - 1, i - j) for j in range(i + 1))
        for i in range(n)
    ]
    tail = [sum(rest[i] * (-1) ** (i - k) * comb(i, k) for i in range(k, n)) for k in range(n)]
    powers = [c / duration_s**k for k, c in enumerate((*head, *tail))]
    return Trajectory((polynomial(duration_s, (powers[0] + origin, *powers[1:])),))


def rest_to_rest(n: int, duration_s: float) -> Trajectory:
    """Degree 2 n + 1, speed (2n+1)! / (n!)^2 x^n (1-x)^n, x = t / duration_s, from 0 to 1: n derivatives are 0 at both ends.

    Raises PlanError unless 1 <= n <= SMOOTHEST.
    """
    bounds.duration(duration_s)
    if not 1 <= n <= SMOOTHEST:
        raise PlanError(
            f"n = {n} derivatives at rest; must be 1 to {SMOOTHEST}, or rounding spoils the ends: take fewer"
        )
    scale = factorial(2 * n + 1) // factorial(n) ** 2
    powers = [0.0] * (n + 1) + [scale * comb(n, k) * (-1) ** k / (n + k + 1) for k in range(n + 1)]
    return Trajectory((polynomial(duration_s, [c / duration_s**j for j, c in enumerate(powers)]),))


def cubic(duration_s: float) -> Trajectory:
    """3 x^2 - 2 x^3: the least mean square acceleration of all moves from rest to rest; from 0 to 1 in duration_s."""
    return rest_to_rest(1, duration_s)


def quintic(duration_s: float) -> Trajectory:
    """10 x^3 - 15 x^4 + 6 x^5: the least mean square jerk; from 0 to 1 in duration_s."""
    return rest_to_rest(2, duration_s)


def septic(duration_s: float) -> Trajectory:
    """35 x^4 - 84 x^5 + 70 x^6 - 20 x^7: jerk without a step; from 0 to 1 in duration_s."""
    return rest_to_rest(3, duration_s)
