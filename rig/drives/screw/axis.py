"""Specification of an axis that needs a ball screw."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

from planners import bounds
from planners.errors import PlanError
from rig.drives.motor import Motor
from rig.drives.screw.balls import Balls
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.cycle import Cycle
from rig.drives.screw.demand import Demand, demand, equivalent_load_n
from rig.drives.screw.load import AxisLoad
from rig.drives.screw.preload import drag_torque_n_m
from rig.drives.screw.requirements import Requirements, Utilisation
from rig.drives.screw.shaft import BallScrew, Mounting
from rig.drives.screw.transmission import Transmission


@dataclass(frozen=True, kw_only=True)
class AxisSpec:
    """Data of an axis that are known before a screw is chosen.

    Raises PlanError for a number out of bounds, and for a travel that is not below the screw's
    length.
    """

    mounting: Mounting
    load: AxisLoad
    cycle: Cycle
    transmission: Transmission
    balls: Balls = field(default_factory=Balls)
    utilisation: Utilisation = field(default_factory=Utilisation)
    requirements: Requirements = field(default_factory=Requirements)
    motor: Motor | None = None
    bearing_n_m: float = math.inf  # axial stiffness of the bearing; inf is rigid
    nut_n_m: float = math.inf  # axial stiffness of the nut; inf is rigid
    carried_kg: float = 0.0  # mass that the screw carries itself, without a guide

    def __post_init__(self) -> None:
        for name in ("bearing_n_m", "nut_n_m"):
            if getattr(self, name) != math.inf:
                bounds.datum(name, getattr(self, name))
        bounds.datum("carried_kg", self.carried_kg, zero=True)
        if self.cycle.travel_m >= self.mounting.length_m:
            raise PlanError(
                f"travel = {self.cycle.travel_m:g} m on a screw of "
                f"length_m = {self.mounting.length_m:g}; must be below the screw's length, which "
                "also holds the nut: lengthen the screw, or shorten the strokes"
            )

    @cached_property
    def demand(self) -> Demand:
        """Speed, force and travel that the cycle requires of the nut."""
        return demand(self.cycle, self.load)

    @property
    def support_stiffness_n_m(self) -> float:
        """Stiffness of bearing and nut in series; inf where both are rigid."""
        compliance_m_n = 1.0 / self.bearing_n_m + 1.0 / self.nut_n_m
        return 1.0 / compliance_m_n if compliance_m_n else math.inf

    def balls_m_rpm(self, candidate: CatalogueEntry | None = None) -> float:
        """Compute the usable d x n of the balls, from the candidate's own limit if it has one."""
        limit_m_rpm = candidate.limit_m_rpm if candidate else None
        if limit_m_rpm is None:
            limit_m_rpm = self.balls.allowed_m_rpm
        return self.utilisation.balls * limit_m_rpm

    def stiffness_n_m(self, screw: BallScrew) -> float:
        """Compute k_eq of the chain with this axis's bearing and nut."""
        return screw.stiffness_n_m(self.support_stiffness_n_m)

    def preload_n(self, candidate: CatalogueEntry) -> float:
        """Compute the preload of a candidate.

        Its own preload, else the set share of its dynamic load rating; 0 without such a rating.
        """
        if candidate.preload_n is not None:
            return candidate.preload_n
        return self.utilisation.preload * (candidate.dynamic_load_n or 0.0)

    def equivalent_load_n(self, candidate: CatalogueEntry) -> float:
        """Compute the equivalent load of the cycle on the balls, with the candidate's preload."""
        preload_n = self.preload_n(candidate)
        if preload_n:
            return equivalent_load_n(self.cycle, self.load, preload_n)
        return self.demand.equivalent_force_n

    def transmission_for(self, candidate: CatalogueEntry) -> Transmission:
        """Return the transmission with the candidate's preload drag, unless a drag is given."""
        if self.transmission.drag_torque_n_m is not None:
            return self.transmission
        drag_n_m = drag_torque_n_m(
            self.preload_n(candidate), candidate.lead_m, candidate.diameter_m
        )
        return replace(self.transmission, drag_torque_n_m=drag_n_m)
