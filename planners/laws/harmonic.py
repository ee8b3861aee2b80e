"""Half a cosine: the smoothest-looking law whose acceleration still starts and ends with a step."""

from __future__ import annotations

import math

from planners.errors import PlanError
from planners.pieces import ExpPolynomial, Mode
from planners.trajectory import Trajectory


def harmonic(duration_s: float) -> Trajectory:
    """(1 - cos(pi t / T)) / 2, from 0 to 1 in T = duration_s (source 004, appendix B). PlanError unless finite and > 0."""
    if not 0.0 < duration_s < math.inf:
        raise PlanError(f"duration_s = {duration_s} of a law; must be finite and > 0: give it more time")
    return Trajectory((ExpPolynomial(duration_s, (0.5,), (Mode(1j * math.pi / duration_s, (-0.5 + 0j,)),)),))
