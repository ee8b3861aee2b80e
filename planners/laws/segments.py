"""Moves whose highest derivative is constant, segment by segment: trapezoid, double S and their smoother kin."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from math import factorial

from planners.trajectories.pieces import polynomial
from planners.trajectories.trajectory import Trajectory

INSTANT_S = 1e-9  # a tick of the run clock: how long a move of no length stands still, as a trajectory cannot last 0 s
SLIVER = 1e-14  # of the whole; a shorter segment is rounding of a tie and makes no piece of its own


def integrated(
    start: Sequence[float], segments: Iterable[tuple[float | Fraction, float]]
) -> Trajectory:
    """From a state through segments of (duration [s], constant value of the derivative after the state's last).

    start: position [m], speed, ... The state is carried exactly, as a rounding error of the acceleration would grow with the
    square of a long time at constant speed. Without a segment that lasts, the trajectory stands at the start for INSTANT_S.
    """
    state, pieces = [Fraction(d) for d in start], []
    kept = [(Fraction(duration_s), Fraction(top)) for duration_s, top in segments if duration_s > 0]
    whole = sum(duration for duration, _ in kept)
    for duration, top in kept:
        taylor = [d / factorial(k) for k, d in enumerate((*state, top))]
        if duration > SLIVER * whole:
            pieces.append(polynomial(float(duration), [float(c) for c in taylor]))
        state = [_end(taylor, duration, k) for k in range(len(state))]
    return Trajectory(tuple(pieces)) if pieces else Trajectory.hold(float(state[0]), INSTANT_S)


def _end(coefficients: Sequence[Fraction], t: Fraction, order: int) -> Fraction:
    """Derivative of that order at t."""
    total = Fraction(0)
    for j in range(len(coefficients) - 1, order - 1, -1):
        total = total * t + coefficients[j] * (factorial(j) // factorial(j - order))
    return total
