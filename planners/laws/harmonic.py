"""Harmonic law: half a cosine; its acceleration starts and ends with a step."""

from __future__ import annotations

import math

from planners import bounds
from planners.trajectories.pieces import ExpPolynomial, ModalTerm
from planners.trajectories.trajectory import Trajectory


def harmonic(duration_s: float) -> Trajectory:
    """Compute the harmonic law (1 - cos(pi t / T)) / 2, from 0 to 1 in T = duration_s.

    Source 004, appendix B. The acceleration is pi^2/(2 T^2) cos(pi t / T); source 000 prints it
    twice as large in one of two places. Raises PlanError for a duration out of bounds.
    """
    bounds.duration(duration_s)
    cosine = ModalTerm(1j * math.pi / duration_s, (-0.5 + 0j,))
    return Trajectory((ExpPolynomial(duration_s, (0.5,), (cosine,)),))
