"""The gains of least quadratic cost, by doubling a horizon.

scipy's routines, by ordered eigenvectors, lose digits where entries are of unlike size, as rad beside counts of a fine encoder
are: on random joints and noises, in good units, one in eight of their continuous gains was off by more than 1e-3 without a
word, and the median error is fifty times that of doubling.
"""

from __future__ import annotations

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.servo.controllability import Units
from rig.drives.servo.errors import ServoError

DOUBLINGS = 50  # of a horizon that starts with one step: it outlasts every pole that is told from 1
SHIFTS = (
    1.1,
    2.7,
)  # of the Cayley transform, over the fastest pole of the optimum: two ways to the same gains
AGREEMENT = 1e-6  # of those two


def lq_gains(
    a: FloatArray,
    b: FloatArray,
    cost: FloatArray,
    weight: float,
    units: Units,
    given: str,
    advice: str,
) -> FloatArray:
    """k (n,) of u = -k x that minimises the integral of x^T cost x + weight u^2, worked out in the units given.

    Raises ServoError, which starts with what was given, when rounding decides the gains.
    """
    scaled, column = units.matrix(a), b / units.states / units.rate_1_s
    try:
        with np.errstate(all="ignore"):
            g, h = np.outer(column, column) / weight, cost * np.outer(units.states, units.states)
            gains, other = (
                column @ _solve_continuous_riccati(scaled, g, h, shift) / weight for shift in SHIFTS
            )
            slowest = float(np.max(np.linalg.eigvals(scaled - np.outer(column, gains)).real))
    except np.linalg.LinAlgError:
        raise ServoError(f"{given} leaves no gains within floating point: {advice}") from None
    if not (slowest < 0.0 and np.all(np.abs(gains - other) <= AGREEMENT * np.abs(gains))):
        raise ServoError(
            f"{given} has gains that rounding decides: two ways to them must agree to {AGREEMENT:g} and leave no pole "
            f"with a real part >= 0 (here {slowest * units.rate_1_s:.3g} 1/s): {advice}"
        )
    return np.asarray(gains / units.states)


def solve_riccati_by_doubling(a: FloatArray, g: FloatArray, h: FloatArray) -> FloatArray:
    """X (n, n) >= 0 of X = h + a^T X (1 + g X)^-1 a, the cost of an endless horizon, by doubling a finite one (Chu, Fan, Lin
    and Wang 2004).

    Entry by entry about as exact as a, g and h, where routines by eigenvectors lose digits to entries of unlike size.
    """
    for _ in range(DOUBLINGS):
        between = np.linalg.inv(np.eye(len(a)) + g @ h)
        g, h, a = g + a @ between @ g @ a.T, h + a.T @ h @ between @ a, a @ between @ a
    return h


def _solve_continuous_riccati(
    a: FloatArray, g: FloatArray, h: FloatArray, shift: float
) -> FloatArray:
    """X of a^T X + X a - X g X + h = 0, solve_riccati_by_doubling after a Cayley transform (Chu, Fan and Lin 2005)."""
    one = np.eye(len(a))
    rate = shift * float(np.max(np.abs(np.linalg.eigvals(np.block([[a, -g], [-h, -a.T]])))))
    back = np.linalg.inv(a - rate * one)
    whole = np.linalg.inv(a - rate * one + g @ back.T @ h)
    return solve_riccati_by_doubling(
        one + 2.0 * rate * whole, 2.0 * rate * back @ g @ whole.T, 2.0 * rate * whole.T @ h @ back
    )
