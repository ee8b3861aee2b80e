"""Load that an axis moves (source 004, fig. C.9)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from planners import bounds
from planners.errors import check_range
from planners.trajectories.pieces import FloatArray
from rig.drives.screw.instants import Instants
from rig.drives.screw.shaft import GRAVITY_M_S2


@dataclass(frozen=True, kw_only=True)
class AxisLoad:
    """Mass on a slope with dry friction of its guides and a constant force.

    Raises PlanError for a mass that is not 1e-12 to 1e12 kg, a slope beyond the vertical or a
    negative friction.
    """

    mass_kg: float  # with the nut
    slope_rad: float = 0.0  # positive: positive travel goes up
    friction_coefficient: float = 0.0
    force_n: float = 0.0  # against positive travel, of either sign

    def __post_init__(self) -> None:
        bounds.datum("mass_kg", self.mass_kg)
        check_range(
            "slope_rad",
            self.slope_rad,
            -math.pi / 2.0,
            math.pi / 2.0,
            "0 is horizontal, positive goes up",
        )
        check_range(
            "friction_coefficient",
            self.friction_coefficient,
            0.0,
            10.0,
            "guides with balls have 0.01 to 0.1",
        )
        check_range("force_n", self.force_n, -bounds.DATUM, bounds.DATUM, "give it in N")

    @property
    def weight_n(self) -> float:
        """Component of the weight along the axis: M g sin(slope)."""
        return self.mass_kg * GRAVITY_M_S2 * math.sin(self.slope_rad)

    @property
    def friction_n(self) -> float:
        """Absolute value of the friction during motion: mu M g cos(slope)."""
        return self.friction_coefficient * self.mass_kg * GRAVITY_M_S2 * math.cos(self.slope_rad)

    def force_at(self, instants: Instants) -> FloatArray:
        """Compute the force on the nut, positive with positive travel [N] (N,).

        Constant force + weight + friction against the motion + M a.
        """
        steady = self.force_n + self.weight_n + self.friction_n * instants.direction
        return steady + self.mass_kg * instants.acceleration_m_s2
