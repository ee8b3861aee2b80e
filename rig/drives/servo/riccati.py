"""Gains of least quadratic cost, by doubling the horizon of the Riccati equation.

The routines of scipy, by ordered eigenvectors, lose digits where entries differ much in size, e.g.
rad beside counts of a fine encoder. On random joints and noises, in good units, one in eight of
their continuous gains was wrong by more than 1e-3 without a warning, and the median error was fifty
times that of doubling.
"""

from __future__ import annotations

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.servo.controllability import Units
from rig.drives.servo.errors import ServoError

DOUBLINGS = 50  # of a horizon of one step; exceeds the decay of any pole distinguishable from 1
# shifts of the Cayley transform relative to the fastest optimal pole: gains are computed twice
SHIFTS = (1.1, 2.7)
AGREEMENT_REL = 1e-6  # relative difference of the gains by both shifts


def lq_gains(
    a: FloatArray,
    b: FloatArray,
    cost: FloatArray,
    weight: float,
    units: Units,
    given: str,
    advice: str,
) -> FloatArray:
    """Compute k (n,) of u = -k x that minimises the integral of x^T cost x + weight u^2.

    Computed in the units given. Raises ServoError, whose text starts with given, when rounding
    decides the gains.
    """
    scaled, column = units.matrix(a), b / units.states / units.rate_1_s
    try:
        with np.errstate(all="ignore"):
            g = np.outer(column, column) / weight
            h = cost * np.outer(units.states, units.states)
            gains, other = (
                column @ _solve_continuous_riccati(scaled, g, h, shift) / weight for shift in SHIFTS
            )
            slowest = float(np.max(np.linalg.eigvals(scaled - np.outer(column, gains)).real))
    except np.linalg.LinAlgError:
        raise ServoError(f"{given} has no gains within floating point: {advice}") from None
    if not (slowest < 0.0 and np.all(np.abs(gains - other) <= AGREEMENT_REL * np.abs(gains))):
        raise ServoError(
            f"{given} has gains that rounding decides: two computations must agree to "
            f"{AGREEMENT_REL:g} and leave no pole with a real part >= 0 "
            f"(here {slowest * units.rate_1_s:.3g} 1/s): {advice}"
        )
    return np.asarray(gains / units.states)


def solve_riccati_by_doubling(a: FloatArray, g: FloatArray, h: FloatArray) -> FloatArray:
    """Solve X = h + a^T X (1 + g X)^-1 a for X (n, n) >= 0.

    X is the cost of an infinite horizon, found by doubling a finite one (Chu, Fan, Lin and Wang
    2004). Each entry is about as exact as a, g and h, where routines by eigenvectors lose digits to
    entries that differ much in size.
    """
    for _ in range(DOUBLINGS):
        inverse = np.linalg.inv(np.eye(len(a)) + g @ h)
        g, h, a = g + a @ inverse @ g @ a.T, h + a.T @ h @ inverse @ a, a @ inverse @ a
    return h


def _solve_continuous_riccati(
    a: FloatArray, g: FloatArray, h: FloatArray, shift: float
) -> FloatArray:
    """Solve a^T X + X a - X g X + h = 0 for X.

    Doubling after a Cayley transform (Chu, Fan and Lin 2005).
    """
    one = np.eye(len(a))
    rate = shift * float(np.max(np.abs(np.linalg.eigvals(np.block([[a, -g], [-h, -a.T]])))))
    shifted_inverse = np.linalg.inv(a - rate * one)
    schur_inverse = np.linalg.inv(a - rate * one + g @ shifted_inverse.T @ h)
    return solve_riccati_by_doubling(
        one + 2.0 * rate * schur_inverse,
        2.0 * rate * shifted_inverse @ g @ schur_inverse.T,
        2.0 * rate * schur_inverse.T @ h @ shifted_inverse,
    )
