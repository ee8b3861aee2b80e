"""A point mass on a cable under a platform whose acceleration is the input."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planners.errors import PlanError
from planners.pieces import FloatArray


class StateSpace(NamedTuple):
    """x' = a x + b u with named states; units stand in the names."""

    states: tuple[str, ...]  # n
    input: str
    a: FloatArray  # (n, n)
    b: FloatArray  # (n, 1)


@dataclass(frozen=True, kw_only=True)
class PendulumModel:
    """Cable of length_m with viscous damping; angle 0 = hanging, positive = load ahead in +X.

    Raises PlanError unless length_m > 0, 0 <= damping_ratio < 1, gravity_m_s2 > 0, all finite.
    """

    length_m: float
    damping_ratio: float = 0.0
    gravity_m_s2: float = 9.81

    def __post_init__(self) -> None:
        if not 0.0 < self.length_m < math.inf:
            raise PlanError(f"length_m = {self.length_m}; must be > 0 and finite: measure pivot to load")
        if not 0.0 <= self.damping_ratio < 1.0:
            raise PlanError(f"damping_ratio = {self.damping_ratio}; must be >= 0 and < 1: use 0 where it was not measured")
        if not 0.0 < self.gravity_m_s2 < math.inf:
            raise PlanError(f"gravity_m_s2 = {self.gravity_m_s2}; must be > 0 and finite: use 9.81")

    @property
    def natural_frequency_rad_s(self) -> float:
        """Undamped, for small swings: sqrt(g/l)."""
        return math.sqrt(self.gravity_m_s2 / self.length_m)

    @property
    def swing_rate_1_s(self) -> complex:
        """Eigenvalue of the small swing in the upper half plane: -zeta w + j w sqrt(1 - zeta^2)."""
        z = self.damping_ratio
        return self.natural_frequency_rad_s * complex(-z, math.sqrt(1.0 - z * z))

    def state_space(self) -> StateSpace:
        """Small swings: theta'' = -(g/l) theta - 2 zeta w theta' - a/l (source 004, equation 3.1.10)."""
        w, z = self.natural_frequency_rad_s, self.damping_ratio
        a = np.zeros((4, 4))
        a[0, 1] = a[2, 3] = 1.0
        a[3, 2], a[3, 3] = -w * w, -2.0 * z * w
        b = np.array([[0.0], [1.0], [0.0], [-1.0 / self.length_m]])
        return StateSpace(("position_m", "speed_m_s", "angle_rad", "angular_velocity_rad_s"), "acceleration_m_s2", a, b)

    def angular_acceleration_rad_s2(self, angle_rad: float, angular_velocity_rad_s: float, acceleration_m_s2: float) -> float:
        """Any swing: theta'' = -(g/l) sin theta - 2 zeta w theta' - (a/l) cos theta (Lagrange, platform on rails)."""
        w, z = self.natural_frequency_rad_s, self.damping_ratio
        pull = acceleration_m_s2 / self.length_m * math.cos(angle_rad)
        return -w * w * math.sin(angle_rad) - 2.0 * z * w * angular_velocity_rad_s - pull

    def amplitude_rad(self, angle_rad: float, angular_velocity_rad_s: float) -> float:
        """Swing that an angle and its rate amount to: sqrt(theta^2 + (theta'/w)^2)."""
        return math.hypot(angle_rad, angular_velocity_rad_s / self.natural_frequency_rad_s)
