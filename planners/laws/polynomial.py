"""Polynomial laws in closed form: between any two states, and rest to rest of degree 2 n + 1."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb, factorial

from planners import bounds
from planners.errors import PlanError
from planners.trajectories.pieces import polynomial
from planners.trajectories.trajectory import Trajectory

MAX_END_DERIVATIVES = 7  # beyond, the powers cancel: end derivatives differ from 0 by over 1e-9


def between(start: Sequence[float], end: Sequence[float], duration_s: float) -> Trajectory:
    """Compute the polynomial of least degree between two states.

    start (m,), end (n,): position [m] and its derivatives [m/s^k], at least the position. The
    degree is m + n - 1 (source 000 for 3 and 5). Two-point Taylor expansion: the first m powers
    follow from the start, the others from (q - those) / x^m expanded about the end.
    Raises PlanError for an empty state, numbers out of bounds, and more than
    MAX_END_DERIVATIVES derivatives at an end.
    """
    bounds.duration(duration_s)
    _check_state("start", start)
    _check_state("end", end)
    m, n, origin = len(start), len(end), float(start[0])
    head = _normalised((0.0, *start[1:]), duration_s)  # powers of x = t / T
    goal = _normalised((end[0] - origin, *end[1:]), duration_s)  # powers of x - 1
    defect = [g - sum(comb(i, k) * head[i] for i in range(k, m)) for k, g in enumerate(goal)]
    about_end = [
        sum(defect[j] * (-1) ** (i - j) * comb(m + i - j - 1, i - j) for j in range(i + 1))
        for i in range(n)
    ]
    tail = [sum(about_end[i] * (-1) ** (i - k) * comb(i, k) for i in range(k, n)) for k in range(n)]
    powers = [c / duration_s**k for k, c in enumerate((*head, *tail))]
    return Trajectory((polynomial(duration_s, (powers[0] + origin, *powers[1:])),))


def rest_to_rest(n: int, duration_s: float) -> Trajectory:
    """Compute the polynomial from 0 to 1 with n derivatives of 0 at both ends.

    Degree 2 n + 1, speed (2n+1)! / (n!)^2 x^n (1-x)^n with x = t / duration_s.
    Raises PlanError unless 1 <= n <= MAX_END_DERIVATIVES.
    """
    bounds.duration(duration_s)
    if not 1 <= n <= MAX_END_DERIVATIVES:
        raise PlanError(
            f"n = {n} derivatives at rest; must be 1 to {MAX_END_DERIVATIVES}, "
            "or rounding dominates the end derivatives: use fewer"
        )
    scale = factorial(2 * n + 1) // factorial(n) ** 2
    powers = [0.0] * (n + 1)
    for k in range(n + 1):
        powers.append(scale * comb(n, k) * (-1) ** k / (n + k + 1))
    return Trajectory((polynomial(duration_s, [c / duration_s**j for j, c in enumerate(powers)]),))


def cubic(duration_s: float) -> Trajectory:
    """Compute the cubic law 3 x^2 - 2 x^3 from 0 to 1 in duration_s.

    It has the least mean square acceleration of all rest-to-rest moves.
    """
    return rest_to_rest(1, duration_s)


def quintic(duration_s: float) -> Trajectory:
    """Compute the quintic law 10 x^3 - 15 x^4 + 6 x^5 from 0 to 1 in duration_s.

    It has the least mean square jerk of all moves with speed and acceleration 0 at both ends.
    """
    return rest_to_rest(2, duration_s)


def septic(duration_s: float) -> Trajectory:
    """Compute the septic law 35 x^4 - 84 x^5 + 70 x^6 - 20 x^7 from 0 to 1 in duration_s.

    Its jerk has no step.
    """
    return rest_to_rest(3, duration_s)


def _check_state(name: str, state: Sequence[float]) -> None:
    if not 1 <= len(state) <= MAX_END_DERIVATIVES + 1:
        raise PlanError(
            f"{name} = {tuple(state)}; must hold 1 to {MAX_END_DERIVATIVES + 1} numbers: "
            "give position, speed, ..."
        )
    for k, value in enumerate(state):
        bounds.rate(f"{name}[{k}]", value)


def _normalised(state: Sequence[float], duration_s: float) -> list[float]:
    """Compute Taylor coefficients in normalised time from a state."""
    return [d * duration_s**k / factorial(k) for k, d in enumerate(state)]
