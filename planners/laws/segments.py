"""Integration of a piecewise constant highest derivative: trapezoidal, double S and smoother."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from math import factorial

from planners.trajectories.pieces import polynomial
from planners.trajectories.trajectory import Trajectory

HOLD_S = 1e-9  # one run clock tick, for a move over 0 m: a trajectory cannot last 0 s
MIN_SEGMENT_REL = 1e-14  # of the total; a shorter segment is rounding and gets no piece


def integrated(
    start: Sequence[float], segments: Iterable[tuple[float | Fraction, float]]
) -> Trajectory:
    """Integrate segments of (duration [s], constant highest derivative) from a start state.

    start: position [m], speed, ...; the constant is the derivative after its last one. The
    state is carried as fractions, as a rounding error of the acceleration would grow with the
    square of a long time at constant speed. Without a segment that lasts, the trajectory holds
    the start position for HOLD_S.
    """
    state, pieces = [Fraction(d) for d in start], []
    kept = [(Fraction(duration_s), Fraction(top)) for duration_s, top in segments if duration_s > 0]
    total = sum(duration for duration, _ in kept)
    for duration, top in kept:
        taylor = [d / factorial(k) for k, d in enumerate((*state, top))]
        if duration > MIN_SEGMENT_REL * total:
            pieces.append(polynomial(float(duration), [float(c) for c in taylor]))
        state = [_derivative(taylor, duration, k) for k in range(len(state))]
    return Trajectory(tuple(pieces)) if pieces else Trajectory.hold(float(state[0]), HOLD_S)


def _derivative(coefficients: Sequence[Fraction], t: Fraction, order: int) -> Fraction:
    """Compute a derivative of the polynomial at t."""
    total = Fraction(0)
    for j in range(len(coefficients) - 1, order - 1, -1):
        total = total * t + coefficients[j] * (factorial(j) // factorial(j - order))
    return total
