"""The shadow of a point on an ellipse: harmonic for a circle, faster in the middle the longer the axis."""

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
LONGEST_AXIS = 12.0  # up to it speed to snap can be analysed; a longer one is too steep in the middle for its rounding


def elliptic(duration_s: float, axis_ratio: float = 1.2) -> Trajectory:
    """(1 - cos y / sqrt(1 - alpha sin^2 y)) / 2, y = pi t / T, alpha = (n^2 - 1) / n^2, from 0 to 1 in T = duration_s.

    axis_ratio is n, 1 to LONGEST_AXIS (source 000, which leaves alpha open). Peak
    speed n pi / 2, acceleration at the ends pi^2 / (2 n^2).
    """
    from numpy.polynomial import Polynomial

    bounds.duration(duration_s)
    check_range(
        "axis_ratio", axis_ratio, 1.0, LONGEST_AXIS, "take a shorter ellipse; 1 is the harmonic law"
    )
    alpha = 1.0 - 1.0 / axis_ratio**2
    cosine = _Term(Polynomial([1.0]), True, 0.5)
    terms = list(accumulate(repeat(alpha, MAX_DERIVATIVE_ORDER), _Term.slope, initial=cosine))
    rate_1_s = math.pi / duration_s

    def position(t: FloatArray, order: int) -> FloatArray:
        wave = -0.5 * rate_1_s**order * terms[order].at(rate_1_s * t, alpha)
        return wave + 0.5 if order == 0 else wave

    return Trajectory((Smooth(duration_s, position, MAX_DERIVATIVE_ORDER),))


class _Term(NamedTuple):
    """p(s) c^odd / (1 - alpha s^2)^power with s = sin y, c = cos y: a form that its derivatives keep."""

    p: Polynomial
    odd: bool  # times the cosine
    power: float

    def at(self, y: FloatArray, alpha: float) -> FloatArray:
        s = np.sin(y)
        value = self.p(s) / (1.0 - alpha * s * s) ** self.power
        return np.asarray(value * np.cos(y) if self.odd else value)

    def slope(self, alpha: float) -> _Term:
        from numpy.polynomial import Polynomial

        base, s = Polynomial([1.0, 0.0, -alpha]), Polynomial([0.0, 1.0])
        rise = self.p.deriv() * base + 2.0 * self.power * alpha * s * self.p
        if self.odd:
            rise = rise * Polynomial([1.0, 0.0, -1.0]) - s * self.p * base
        return _Term(rise, not self.odd, self.power + 1.0)
