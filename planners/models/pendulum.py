"""Point mass on a cable under a platform."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from planners.errors import PlanError, check_range, unknown_name
from planners.models.model import GRAVITIES_M_S2, LENGTHS_M, MASSES_KG, Equations, Model

FIELDS = {
    "length": "length_m",
    "gravity": "gravity_m_s2",
    "damping_ratio": "damping_ratio",
    "mass": "mass_kg",
    "cart_mass": "cart_mass_kg",
}


@dataclass(frozen=True, kw_only=True)
class PendulumModel(Model):
    """Cable of length_m with viscous damping; angle 0 = hanging, positive = load ahead in +X.

    The masses matter when a force moves the platform; their defaults are those of source 004,
    section 3.1. Raises PlanError unless length, masses and gravity are within the bounds of a
    laboratory and 0 <= damping_ratio < 1.
    """

    length_m: float
    damping_ratio: float = 0.0
    gravity_m_s2: float = 9.81
    mass_kg: float = 0.7
    cart_mass_kg: float = 32.0

    def __post_init__(self) -> None:
        check_range("length_m", self.length_m, *LENGTHS_M, "measure pivot to load")
        if not 0.0 <= self.damping_ratio < 1.0:
            raise PlanError(
                f"damping_ratio = {self.damping_ratio}; must be >= 0 and < 1: "
                "use 0 where it was not measured"
            )
        check_range("gravity_m_s2", self.gravity_m_s2, *GRAVITIES_M_S2, "use 9.81")
        check_range("mass_kg", self.mass_kg, *MASSES_KG, "weigh it")
        check_range("cart_mass_kg", self.cart_mass_kg, *MASSES_KG, "weigh it")

    @property
    def equations(self) -> Equations:
        """Coefficients of theta'' = -(g/l) sin theta - 2 zeta w theta' - (a/l) cos theta.

        Source 004, 3.1.9 and 3.1.10.
        """
        moment = self.mass_kg * self.length_m
        inertia = moment * self.length_m
        friction = 2.0 * self.damping_ratio * inertia * math.sqrt(self.gravity_m_s2 / self.length_m)
        return Equations(
            mass_kg_m2=np.array([[inertia]]),
            coupling_kg_m=np.array([moment]),
            springs_n_m_rad=np.zeros((1, 1)),
            damping_n_m_s_rad=np.array([[friction]]),
            gravity_m_s2=self.gravity_m_s2,
            load_mass_kg=self.mass_kg,
            cart_mass_kg=self.cart_mass_kg,
        )

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values of length, gravity, damping_ratio, mass and cart_mass."""
        return {name: getattr(self, attribute) for name, attribute in FIELDS.items()}

    def with_parameter(self, name: str, value: float) -> Self:
        """Copy the model with another value of one of `parameters`; PlanError for other names."""
        if name not in FIELDS:
            raise unknown_name("parameter", name, FIELDS)
        return replace(self, **{FIELDS[name]: value})

    @property
    def links_count(self) -> int:
        """Number of links: 1."""
        return 1
