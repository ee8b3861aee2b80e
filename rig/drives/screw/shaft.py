"""Shaft of a ball screw: mass, inertia, whirling, buckling, sag and stiffness.

Equations are those of source 004, appendix C.0.2. Core and ball circle have the nominal diameter d,
as in the source, unless they are given. Bending, buckling and stiffness are those of the core, as
in makers' rules (general knowledge); mass and inertia are those of the nominal diameter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from planners.errors import check_range
from rig.drives.screw.supports import SUPPORTS, Support

GRAVITY_M_S2 = 9.81
MIN_SIZE_M = 1e-4  # of any length or diameter of a screw
MAX_DIAMETER_M = 10.0
MAX_LENGTH_M = 100.0


@dataclass(frozen=True, kw_only=True)
class Mounting:
    """Length, material and supports of a screw.

    free_length_m is the part under compression; None is the whole length. Raises PlanError for a
    number out of bounds.
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
            MIN_SIZE_M,
            MAX_LENGTH_M,
            "measure the screw between its supports",
        )
        if self.free_length_m is not None:
            advice = "give the part under compression, at most the screw's length"
            check_range("free_length_m", self.free_length_m, MIN_SIZE_M, self.length_m, advice)
        check_range("density_kg_m3", self.density_kg_m3, 100.0, 3e4, "steel has 7800")
        for name in ("youngs_modulus_pa", "shear_modulus_pa"):
            check_range(name, getattr(self, name), 1e8, 1e13, "steel has 200e9 and 79.3e9")
        for name, value in self.support._asdict().items():
            check_range(f"support {name}", value, 1e-3, 1e4, "take one of the named supports")


@dataclass(frozen=True, kw_only=True)
class Thread:
    """Diameters and lead of a screw.

    Raises PlanError for one that is not 0.1 mm to 10 m, and for a core thicker than the screw.
    """

    diameter_m: float  # nominal
    lead_m: float  # travel per revolution
    core_diameter_m: float | None = None  # None is the nominal diameter
    ball_circle_m: float | None = None  # circle of the balls' centres; None is the nominal diameter

    def __post_init__(self) -> None:
        for name in ("diameter_m", "lead_m"):
            check_range(
                name,
                getattr(self, name),
                MIN_SIZE_M,
                MAX_DIAMETER_M,
                "give it in metres, as in the screw's designation",
            )
        if self.core_diameter_m is not None:
            advice = "it is about a tenth less than the nominal diameter"
            check_range(
                "core_diameter_m", self.core_diameter_m, MIN_SIZE_M, self.diameter_m, advice
            )
        if self.ball_circle_m is not None:
            check_range(
                "ball_circle_m",
                self.ball_circle_m,
                MIN_SIZE_M,
                MAX_DIAMETER_M,
                "it is a little more than the nominal diameter",
            )

    @property
    def core_m(self) -> float:
        """Diameter of the core."""
        return self.diameter_m if self.core_diameter_m is None else self.core_diameter_m

    @property
    def circle_m(self) -> float:
        """Diameter of the ball circle, the d of d n."""
        return self.diameter_m if self.ball_circle_m is None else self.ball_circle_m


@dataclass(frozen=True, kw_only=True)
class BallScrew(Thread):
    """Solid shaft with a thread, in its mounting."""

    mounting: Mounting

    @property
    def ratio_m_rad(self) -> float:
        """Travel per radian: tau = p / 2 pi."""
        return self.lead_m / (2.0 * math.pi)

    @property
    def mass_kg(self) -> float:
        """Mass M_v = rho pi d^2 L / 4."""
        return _area_m2(self.diameter_m) * self.mounting.density_kg_m3 * self.mounting.length_m

    @property
    def inertia_kg_m2(self) -> float:
        """Moment of inertia J_v = M_v d^2 / 8."""
        return self.mass_kg * self.diameter_m**2 / 8.0

    @property
    def bending_stiffness_n_m2(self) -> float:
        """Bending stiffness E I of the core, I = pi d^4 / 64."""
        return self.mounting.youngs_modulus_pa * math.pi * self.core_m**4 / 64.0

    @property
    def whirl_rad_s(self) -> float:
        """First bending frequency of the core, the nut at one end: K_v sqrt(E I / (M L^3)) (C.0.6).

        It is proportional to d.
        """
        mounting = self.mounting
        return mounting.support.whirl * math.sqrt(
            self.bending_stiffness_n_m2 / (self._core_mass_kg * mounting.length_m**3)
        )

    @property
    def buckling_load_n(self) -> float:
        """Euler load f_eu pi^2 E I / L_c^2, without a safety factor (C.0.14)."""
        free_m = self.mounting.free_length_m or self.mounting.length_m
        return self.mounting.support.buckling * math.pi**2 * self.bending_stiffness_n_m2 / free_m**2

    @property
    def torsional_stiffness_n_m_rad(self) -> float:
        """Torsional stiffness G pi d^4 / (32 L), the nut at the end away from the motor."""
        return (
            self.mounting.shear_modulus_pa
            * math.pi
            * self.core_m**4
            / (32.0 * self.mounting.length_m)
        )

    @property
    def axial_stiffness_n_m(self) -> float:
        """Axial stiffness E A / L_eq at the nut's worst place: L_eq = L, or L / 4 fixed-fixed."""
        mounting = self.mounting
        return (
            mounting.youngs_modulus_pa
            * _area_m2(self.core_m)
            * mounting.support.axial_paths
            / mounting.length_m
        )

    def sag_m(self, slope_rad: float = 0.0, carried_kg: float = 0.0) -> float:
        """Compute the deflection of the core under its weight and a carried load (C.0.16).

        carried_kg is a load without a guide, at its worst place; slope_rad is the axis's slope.
        """
        support = self.mounting.support
        reach = self.mounting.length_m**3 / self.bending_stiffness_n_m2
        across = GRAVITY_M_S2 * math.cos(slope_rad)
        return (
            across * reach * (self._core_mass_kg / support.own_sag + carried_kg / support.load_sag)
        )

    def stiffness_n_m(self, support_stiffness_n_m: float = math.inf) -> float:
        """Compute the stiffness k_eq at the nut with the motor held (C.0.17).

        In series: bearing and nut (support_stiffness_n_m), shaft in tension, shaft in torsion.
        """
        twist = self.ratio_m_rad**2 / self.torsional_stiffness_n_m_rad
        return 1.0 / (1.0 / support_stiffness_n_m + 1.0 / self.axial_stiffness_n_m + twist)

    def antiresonance_rad_s(self, mass_kg: float, stiffness_n_m: float) -> float:
        """Compute the antiresonance omega_z = sqrt(k_eq / (M + M_v / 3)) (C.0.18).

        The load oscillates while the motor is at rest: a zero of the transfer function from the
        motor's torque to its own motion. That to the load has only the resonance; source 004 states
        otherwise.
        """
        return math.sqrt(stiffness_n_m / (mass_kg + self.mass_kg / 3.0))

    def resonance_rad_s(
        self, mass_kg: float, stiffness_n_m: float, rotary_inertia_kg_m2: float
    ) -> float:
        """Compute the resonance omega_p = omega_z sqrt(1 + M tau^2 / J).

        Motor and load oscillate against each other. J is the inertia of motor, coupling and screw.
        """
        ratio = (mass_kg + self.mass_kg / 3.0) * self.ratio_m_rad**2 / rotary_inertia_kg_m2
        return self.antiresonance_rad_s(mass_kg, stiffness_n_m) * math.sqrt(1.0 + ratio)

    def equivalent_mass_kg(self, mass_kg: float, rotary_inertia_kg_m2: float) -> float:
        """Compute the equivalent mass at the nut: M + J / tau^2 (source 004, section 4.2).

        J is the inertia of motor, coupling and screw.
        """
        return mass_kg + rotary_inertia_kg_m2 / self.ratio_m_rad**2

    @property
    def _core_mass_kg(self) -> float:
        return _area_m2(self.core_m) * self.mounting.density_kg_m3 * self.mounting.length_m


def _area_m2(diameter_m: float) -> float:
    return math.pi * diameter_m**2 / 4.0
