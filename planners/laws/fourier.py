"""Fourier laws, speed as a mean and harmonics of the duration: cycloidal, Gutman, Freudenstein."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from planners import bounds
from planners.errors import PlanError
from planners.trajectories.pieces import ExpPolynomial, ModalTerm
from planners.trajectories.trajectory import Trajectory

SHARE_SUM_TOLERANCE = 1e-12  # largest |sum of shares - 1|
GUTMAN_1_3 = MappingProxyType({1: 15 / 16, 3: 1 / 16})
FREUDENSTEIN_1_3 = MappingProxyType({1: 27 / 28, 3: 1 / 28})
FREUDENSTEIN_1_3_5 = MappingProxyType({1: 1125 / 1192, 3: 1125 / 1192 / 18, 5: 1125 / 1192 / 250})


def fourier(duration_s: float, shares: Mapping[int, float]) -> Trajectory:
    """Compute a Fourier law from 0 to 1 in T = duration_s (source 000).

    Position x - sum_n c_n / (2 pi n) sin(2 pi n x) with x = t / T and shares n -> c_n.
    Raises PlanError unless the shares sum to 1, as the law then begins and ends at rest.
    """
    bounds.duration(duration_s)
    total = math.fsum(shares.values())
    if not abs(total - 1.0) <= SHARE_SUM_TOLERANCE or min(shares) < 1:
        raise PlanError(
            f"shares = {dict(shares)} sum to {total:.9g}; must sum to 1, over harmonics >= 1, "
            "or the ends are not at rest: divide them by their sum"
        )
    turn = 2.0 * math.pi
    modes = tuple(
        ModalTerm(1j * turn * n / duration_s, (1j * c / (turn * n),)) for n, c in shares.items()
    )
    return Trajectory((ExpPolynomial(duration_s, (0.0, 1.0 / duration_s), modes),))


def cycloidal(duration_s: float) -> Trajectory:
    """Compute the cycloidal law, one sine of acceleration, from 0 to 1 (source 000)."""
    return fourier(duration_s, {1: 1.0})


def gutman_1_3(duration_s: float) -> Trajectory:
    """Compute the Gutman 1-3 law from 0 to 1.

    First and third harmonic for a low acceleration (source 000: 15/16, 1/16).
    """
    return fourier(duration_s, GUTMAN_1_3)


def freudenstein_1_3(duration_s: float) -> Trajectory:
    """Compute the Freudenstein 1-3 law from 0 to 1.

    First and third harmonic for a low jerk (source 000: 27/28, 1/28).
    """
    return fourier(duration_s, FREUDENSTEIN_1_3)


def freudenstein_1_3_5(duration_s: float) -> Trajectory:
    """Compute the Freudenstein 1-3-5 law from 0 to 1.

    First, third and fifth harmonic: A (1, 1/18, 1/250) with A = 1125/1192. Source 000 prints
    A = 0.9438, which leaves an end speed of -8.5e-6 / duration_s.
    """
    return fourier(duration_s, FREUDENSTEIN_1_3_5)
