"""Elliptic law: projection of a point on an ellipse; harmonic for a circle."""

from __future__ import annotations

import math
from itertools import accumulate, repeat
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from planners import bounds
from planners.errors import check_range
from planners.trajectories.pieces import FloatArray, Smooth
from planners.trajectories.trajectory import Trajectory

if TYPE_CHECKING:
    from numpy.polynomial import Polynomial

MAX_DERIVATIVE_ORDER = 8
MAX_AXIS_RATIO = 12.0  # up to it speed to snap are resolved; above, the middle is too steep


def elliptic(duration_s: float, axis_ratio: float = 1.2) -> Trajectory:
    """Compute the elliptic law from 0 to 1 in T = duration_s (source 000).

    (1 - cos y / sqrt(1 - alpha sin^2 y)) / 2 with y = pi t / T and alpha = (n^2 - 1) / n^2.
    n = axis_ratio, 1 to MAX_AXIS_RATIO; source 000 leaves alpha open. Peak speed n pi / 2,
    acceleration at the ends pi^2 / (2 n^2).
    """
    from numpy.polynomial import Polynomial

    bounds.duration(duration_s)
    check_range(
        "axis_ratio",
        axis_ratio,
        1.0,
        MAX_AXIS_RATIO,
        "choose a smaller ratio; 1 is the harmonic law",
    )
    alpha = 1.0 - 1.0 / axis_ratio**2
    cosine = _EllipticTerm(Polynomial([1.0]), True, 0.5)
    alphas = repeat(alpha, MAX_DERIVATIVE_ORDER)
    terms = list(accumulate(alphas, _EllipticTerm.derivative, initial=cosine))
    rate_1_s = math.pi / duration_s

    def position(t: FloatArray, order: int) -> FloatArray:
        wave = -0.5 * rate_1_s**order * terms[order].at(rate_1_s * t, alpha)
        return wave + 0.5 if order == 0 else wave

    return Trajectory((Smooth(duration_s, position, MAX_DERIVATIVE_ORDER),))


class _EllipticTerm(NamedTuple):
    """Term p(s) c^odd / (1 - alpha s^2)^power with s = sin y, c = cos y.

    Its derivative has the same form.
    """

    p: Polynomial
    odd: bool  # multiplied by the cosine
    power: float

    def at(self, y: FloatArray, alpha: float) -> FloatArray:
        s = np.sin(y)
        value = self.p(s) / (1.0 - alpha * s * s) ** self.power
        return np.asarray(value * np.cos(y) if self.odd else value)

    def derivative(self, alpha: float) -> _EllipticTerm:
        from numpy.polynomial import Polynomial

        base, s = Polynomial([1.0, 0.0, -alpha]), Polynomial([0.0, 1.0])
        numerator = self.p.deriv() * base + 2.0 * self.power * alpha * s * self.p
        if self.odd:
            numerator = numerator * Polynomial([1.0, 0.0, -1.0]) - s * self.p * base
        return _EllipticTerm(numerator, not self.odd, self.power + 1.0)
