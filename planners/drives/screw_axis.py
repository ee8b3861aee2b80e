"""An axis that is to get a screw, and what can be had: the two sides of a sizing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from planners.drives.ball_screw import BallScrew, Mounting, check_sizes
from planners.drives.lead_classes import lead_class
from planners.drives.motor import Motor
from planners.drives.screw_cycle import Cycle
from planners.drives.screw_demand import AxisLoad, Demand, Transmission, demand
from planners.drives.screw_limits import BALLS_M_RPM
from planners.errors import PlanError, check_range
from planners.laws import bounds


@dataclass(frozen=True, kw_only=True)
class Shares:
    """How much of each limit may be used, and how rough the work is. Raises PlanError out of bounds."""

    whirl: float = 0.7  # of the first bending frequency; source 004: 0.65 to 0.85
    buckling: float = 0.5  # of Euler's load; source 004: 0.5 to 0.7
    balls: float = 1.0  # of d x n
    bandwidth: float = 0.5  # of the antiresonance; source 004: 0.5 to 0.7
    service_factor: float = 1.2  # on forces: 1 to 1.2 regular, to 1.5 light shocks, to 3 frequent ones

    def __post_init__(self) -> None:
        for name in ("whirl", "buckling", "balls", "bandwidth"):
            check_range(f"share {name}", getattr(self, name), 0.01, 1.0, "it is a share of the limit, below 1 to be safe")
        check_range("service_factor", self.service_factor, 1.0, 10.0, "1.2 for regular motion, 3 for frequent shocks")


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """What the axis is to reach; None is not asked. Raises PlanError out of bounds."""

    life_h: float | None = None
    lead_class: str = "ISO 5"  # or better: the coarsest whose travel deviation is tabulated
    travel_deviation_m: float | None = None  # over the useful travel
    position_error_m: float | None = None  # from an error of the motor's angle
    angle_error_rad: float | None = None
    sag_m: float | None = None
    stiffness_n_m: float | None = None
    bandwidth_rad_s: float | None = None

    def __post_init__(self) -> None:
        lead_class(self.lead_class)
        for name, value in vars(self).items():
            if isinstance(value, float | int):
                bounds.datum(name, value)
        if (self.position_error_m is None) != (self.angle_error_rad is None):
            raise PlanError(
                f"position_error_m = {self.position_error_m} with angle_error_rad = {self.angle_error_rad}; must be both or "
                "none: the greatest lead is 2 pi times their ratio"
            )


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A screw, or a unit around one, as a catalogue has it; None is not told, and what hangs on it cannot be decided.

    Raises PlanError for a number out of bounds and for an unknown lead class.
    """

    name: str
    diameter_m: float
    lead_m: float
    origin: str
    dynamic_load_n: float | None = None
    static_load_n: float | None = None
    speed_m_s: float | None = None  # the unit's own limit
    stroke_m: float | None = None
    lead_class: str | None = None

    def __post_init__(self) -> None:
        check_sizes(self.diameter_m, self.lead_m)
        for name in ("dynamic_load_n", "static_load_n", "speed_m_s", "stroke_m"):
            value = getattr(self, name)
            if value is not None:
                bounds.datum(name, value)
        if self.lead_class is not None:
            lead_class(self.lead_class)

    def screw(self, mounting: Mounting) -> BallScrew:
        """As a shaft."""
        return BallScrew(diameter_m=self.diameter_m, lead_m=self.lead_m, mounting=mounting)


@dataclass(frozen=True, kw_only=True)
class Axis:
    """All that is known before a screw is chosen. Raises PlanError for a travel beyond the screw's length."""

    mounting: Mounting
    load: AxisLoad
    cycle: Cycle
    transmission: Transmission
    ball_limit_m_rpm: float = BALLS_M_RPM["steel"][0]  # d x n
    shares: Shares = Shares()
    wishes: Wishes = Wishes()
    motor: Motor | None = None
    bearing_n_m: float = math.inf
    nut_n_m: float = math.inf
    carried_kg: float = 0.0  # by the screw, where no guide does

    def __post_init__(self) -> None:
        for name in ("bearing_n_m", "nut_n_m"):
            if getattr(self, name) != math.inf:
                bounds.datum(name, getattr(self, name))
        bounds.datum("carried_kg", self.carried_kg, zero=True)
        if self.cycle.travel_m > self.mounting.length_m:
            raise PlanError(
                f"travel = {self.cycle.travel_m:g} m on a screw of length_m = {self.mounting.length_m:g}; must be shorter: "
                "lengthen the screw, or shorten the strokes"
            )

    @cached_property
    def demand(self) -> Demand:
        """What the cycle asks of the nut."""
        return demand(self.cycle, self.load)

    @property
    def balls_m_rpm(self) -> float:
        """d x n that may be used."""
        return self.shares.balls * self.ball_limit_m_rpm

    def stiffness_n_m(self, screw: BallScrew) -> float:
        """k_eq of the chain with this axis's bearing and nut."""
        return screw.stiffness_n_m(self.bearing_n_m, self.nut_n_m)
