"""An axis that is to get a screw."""

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
from rig.drives.screw.requirements import Shares, Wishes
from rig.drives.screw.shaft import BallScrew, Mounting
from rig.drives.screw.transmission import Transmission


@dataclass(frozen=True, kw_only=True)
class AxisSpec:
    """All that is known before a screw is chosen. Raises PlanError for a travel that leaves no screw for the nut."""

    mounting: Mounting
    load: AxisLoad
    cycle: Cycle
    transmission: Transmission
    balls: Balls = field(default_factory=Balls)
    shares: Shares = field(default_factory=Shares)
    wishes: Wishes = field(default_factory=Wishes)
    motor: Motor | None = None
    bearing_n_m: float = math.inf
    nut_n_m: float = math.inf
    carried_kg: float = 0.0  # by the screw, where no guide does

    def __post_init__(self) -> None:
        for name in ("bearing_n_m", "nut_n_m"):
            if getattr(self, name) != math.inf:
                bounds.datum(name, getattr(self, name))
        bounds.datum("carried_kg", self.carried_kg, zero=True)
        if self.cycle.travel_m >= self.mounting.length_m:
            raise PlanError(
                f"travel = {self.cycle.travel_m:g} m on a screw of length_m = {self.mounting.length_m:g}; must be shorter, as "
                "the nut has a length: lengthen the screw, or shorten the strokes"
            )

    @cached_property
    def demand(self) -> Demand:
        """What the cycle asks of the nut."""
        return demand(self.cycle, self.load)

    @property
    def support_stiffness_n_m(self) -> float:
        """Stiffness of bearing and nut in series; inf where both are rigid."""
        soft = 1.0 / self.bearing_n_m + 1.0 / self.nut_n_m
        return 1.0 / soft if soft else math.inf

    def balls_m_rpm(self, candidate: CatalogueEntry | None = None) -> float:
        """d x n that may be used, of a candidate's own limit where it tells one."""
        own = candidate.limit_m_rpm if candidate else None
        return self.shares.balls * (self.balls.allowed_m_rpm if own is None else own)

    def stiffness_n_m(self, screw: BallScrew) -> float:
        """k_eq of the chain with this axis's bearing and nut."""
        return screw.stiffness_n_m(self.support_stiffness_n_m)

    def preload_n(self, candidate: CatalogueEntry) -> float:
        """Its own, else the usual share of its dynamic load; 0 where that is not told."""
        if candidate.preload_n is not None:
            return candidate.preload_n
        return self.shares.preload * (candidate.dynamic_load_n or 0.0)

    def equivalent_load_n(self, candidate: CatalogueEntry) -> float:
        """Of the cycle, with its preload."""
        preload_n = self.preload_n(candidate)
        return (
            equivalent_load_n(self.cycle, self.load, preload_n)
            if preload_n
            else self.demand.equivalent_force_n
        )

    def drive(self, candidate: CatalogueEntry) -> Transmission:
        """The transmission with the drag of the candidate's preload, unless a drag is given."""
        if self.transmission.drag_torque_n_m is not None:
            return self.transmission
        return replace(
            self.transmission,
            drag_torque_n_m=drag_torque_n_m(
                self.preload_n(candidate), candidate.lead_m, candidate.diameter_m
            ),
        )
