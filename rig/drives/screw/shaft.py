"""A ball screw as a shaft: mass, inertia, whirling, buckling, sag and stiffness (source 004, appendix C.0.2).

One diameter d stands for the nominal one, the core's and the circle of the balls' centres, as in the source, unless those are
given. The core bends, buckles and gives way, as in makers' rules (general knowledge); mass and inertia are the nominal shaft's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from planners.errors import check_range
from rig.drives.screw.supports import SUPPORTS, Support

GRAVITY_M_S2 = 9.81
SMALLEST_M, THICKEST_M, LONGEST_M = 1e-4, 10.0, 100.0  # of a screw


@dataclass(frozen=True, kw_only=True)
class Mounting:
    """Length, material and supports of a screw: all but its diameter and its lead.

    Raises PlanError for a number out of bounds; free_length_m (under compression) is the whole length unless given.
    """

    length_m: float
    support: Support = SUPPORTS["fixed-supported"]
    free_length_m: float | None = None
    density_kg_m3: float = 7800.0
    youngs_modulus_pa: float = 200e9
    shear_modulus_pa: float = 79.3e9

    def __post_init__(self) -> None:
        check_range(
            "length_m",
            self.length_m,
            SMALLEST_M,
            LONGEST_M,
            "measure the screw between its supports",
        )
        if self.free_length_m is not None:
            advice = "give the part under compression, no longer than the screw"
            check_range("free_length_m", self.free_length_m, SMALLEST_M, self.length_m, advice)
        check_range("density_kg_m3", self.density_kg_m3, 100.0, 3e4, "steel has 7800")
        for name in ("youngs_modulus_pa", "shear_modulus_pa"):
            check_range(name, getattr(self, name), 1e8, 1e13, "steel has 200e9 and 79.3e9")
        for name, value in self.support._asdict().items():
            check_range(f"support {name}", value, 1e-3, 1e4, "take one of the named supports")


@dataclass(frozen=True, kw_only=True)
class Thread:
    """Sizes of a screw. Raises PlanError for one that is not 0.1 mm to 10 m, and for a core thicker than the screw."""

    diameter_m: float  # nominal
    lead_m: float  # travel of one turn
    core_diameter_m: float | None = None  # the nominal one unless given
    ball_circle_m: float | None = None  # likewise; of the balls' centres

    def __post_init__(self) -> None:
        for name in ("diameter_m", "lead_m"):
            check_range(
                name,
                getattr(self, name),
                SMALLEST_M,
                THICKEST_M,
                "read it off the screw's name, in metres",
            )
        if self.core_diameter_m is not None:
            advice = "it is some tenth thinner than the screw"
            check_range(
                "core_diameter_m", self.core_diameter_m, SMALLEST_M, self.diameter_m, advice
            )
        if self.ball_circle_m is not None:
            check_range(
                "ball_circle_m",
                self.ball_circle_m,
                SMALLEST_M,
                THICKEST_M,
                "it is a little wider than the screw",
            )

    @property
    def core_m(self) -> float:
        """Diameter of the shaft that bends."""
        return self.diameter_m if self.core_diameter_m is None else self.core_diameter_m

    @property
    def circle_m(self) -> float:
        """Diameter d of the balls' d n."""
        return self.diameter_m if self.ball_circle_m is None else self.ball_circle_m


@dataclass(frozen=True, kw_only=True)
class BallScrew(Thread):
    """A solid shaft of steel with a thread."""

    mounting: Mounting

    @property
    def ratio_m_rad(self) -> float:
        """tau = p / 2 pi: travel for a radian."""
        return self.lead_m / (2.0 * math.pi)

    @property
    def mass_kg(self) -> float:
        """M_v = rho pi d^2 L / 4."""
        return _area_m2(self.diameter_m) * self.mounting.density_kg_m3 * self.mounting.length_m

    @property
    def inertia_kg_m2(self) -> float:
        """J_v = M_v d^2 / 8."""
        return self.mass_kg * self.diameter_m**2 / 8.0

    @property
    def bending_stiffness_n_m2(self) -> float:
        """E I, I = pi d^4 / 64."""
        return self.mounting.youngs_modulus_pa * math.pi * self.core_m**4 / 64.0

    @property
    def whirl_rad_s(self) -> float:
        """First bending frequency K_v sqrt(E I / (M L^3)) of the core, the nut at one end (C.0.6); proportional to d."""
        mounting = self.mounting
        return mounting.support.whirl * math.sqrt(
            self.bending_stiffness_n_m2 / (self._core_mass_kg * mounting.length_m**3)
        )

    @property
    def buckling_load_n(self) -> float:
        """Euler's load f_eu pi^2 E I / L_c^2, without a safety factor (C.0.14)."""
        free_m = self.mounting.free_length_m or self.mounting.length_m
        return self.mounting.support.buckling * math.pi**2 * self.bending_stiffness_n_m2 / free_m**2

    @property
    def torsional_stiffness_n_m_rad(self) -> float:
        """G pi d^4 / (32 L), the nut at the end away from the motor."""
        return (
            self.mounting.shear_modulus_pa
            * math.pi
            * self.core_m**4
            / (32.0 * self.mounting.length_m)
        )

    @property
    def axial_stiffness_n_m(self) -> float:
        """E A / L_eq at the nut's worst place: L_eq = L, or L / 4 fixed-fixed."""
        mounting = self.mounting
        return (
            mounting.youngs_modulus_pa
            * _area_m2(self.core_m)
            * mounting.support.axial_paths
            / mounting.length_m
        )

    def sag_m(self, slope_rad: float = 0.0, carried_kg: float = 0.0) -> float:
        """Deflection of the core at that slope under its weight, and that of a load which no guide carries (C.0.16)."""
        support, reach = (
            self.mounting.support,
            self.mounting.length_m**3 / self.bending_stiffness_n_m2,
        )
        across = GRAVITY_M_S2 * math.cos(slope_rad)
        return (
            across * reach * (self._core_mass_kg / support.own_sag + carried_kg / support.load_sag)
        )

    def stiffness_n_m(self, support_stiffness_n_m: float = math.inf) -> float:
        """k_eq at the nut, the motor held: bearing and nut (support_stiffness_n_m), shaft in tension and in torsion in series (C.0.17)."""
        twist = self.ratio_m_rad**2 / self.torsional_stiffness_n_m_rad
        return 1.0 / (1.0 / support_stiffness_n_m + 1.0 / self.axial_stiffness_n_m + twist)

    def antiresonance_rad_s(self, mass_kg: float, stiffness_n_m: float) -> float:
        """omega_z = sqrt(k_eq / (M + M_v / 3)): the load swings, the motor stands still (C.0.18).

        It is a zero of the motor's own motion over its torque; the load's has the resonance only, where source 004 says
        otherwise.
        """
        return math.sqrt(stiffness_n_m / (mass_kg + self.mass_kg / 3.0))

    def resonance_rad_s(
        self, mass_kg: float, stiffness_n_m: float, rotary_inertia_kg_m2: float
    ) -> float:
        """omega_p = omega_z sqrt(1 + M tau^2 / J): motor and load against each other; J is all that turns."""
        ratio = (mass_kg + self.mass_kg / 3.0) * self.ratio_m_rad**2 / rotary_inertia_kg_m2
        return self.antiresonance_rad_s(mass_kg, stiffness_n_m) * math.sqrt(1.0 + ratio)

    def equivalent_mass_kg(self, mass_kg: float, rotary_inertia_kg_m2: float) -> float:
        """What the motor moves, felt at the nut: M + J / tau^2 (source 004, section 4.2); J is all that turns."""
        return mass_kg + rotary_inertia_kg_m2 / self.ratio_m_rad**2

    @property
    def _core_mass_kg(self) -> float:
        return _area_m2(self.core_m) * self.mounting.density_kg_m3 * self.mounting.length_m


def _area_m2(diameter_m: float) -> float:
    return math.pi * diameter_m**2 / 4.0
