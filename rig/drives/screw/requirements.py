"""What a sizing asks for: how much of each limit may be used, and what is to be reached."""

from __future__ import annotations

from dataclasses import dataclass

from planners import bounds
from planners.errors import PlanError, check_range
from rig.drives.screw.lead_classes import lead_class


@dataclass(frozen=True, kw_only=True)
class Shares:
    """How much of each limit may be used, and how rough the work is. Raises PlanError out of bounds."""

    whirl: float = 0.7  # of the first bending frequency; source 004: 0.65 to 0.85
    buckling: float = 0.5  # of Euler's load; source 004: 0.5 to 0.7
    balls: float = 1.0  # of d x n
    bandwidth: float = 0.5  # of the antiresonance; source 004: 0.5 to 0.7
    service_factor: float = (
        1.2  # on forces: 1 to 1.2 regular, to 1.5 light shocks, to 3 frequent ones
    )
    preload: float = (
        0.0  # of the dynamic load, of nuts that do not tell their own; source 004: 0.05 to 0.1
    )

    def __post_init__(self) -> None:
        for name in ("whirl", "buckling", "balls", "bandwidth"):
            check_range(
                name,
                getattr(self, name),
                0.01,
                1.0,
                "it is a share of the limit, below 1 to be safe",
            )
        check_range(
            "service_factor",
            self.service_factor,
            1.0,
            10.0,
            "1.2 for regular motion, 3 for frequent shocks",
        )
        check_range(
            "preload",
            self.preload,
            0.0,
            0.5,
            "it is a share of the dynamic load, 0.05 to 0.1 as a rule",
        )


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """What the axis is to reach; None is not asked. Raises PlanError out of bounds."""

    life_h: float | None = None
    lead_class: str | None = None  # or better
    travel_deviation_m: float | None = None  # over the useful travel
    position_error_m: float | None = None  # from an error of the motor's angle
    angle_error_rad: float | None = None
    sag_m: float | None = None
    stiffness_n_m: float | None = None
    bandwidth_rad_s: float | None = None

    def __post_init__(self) -> None:
        if self.lead_class is not None:
            lead_class(self.lead_class)
        for name, value in vars(self).items():
            if isinstance(value, float | int):
                check_range(
                    name,
                    value,
                    1.0 / bounds.DATUM,
                    bounds.DATUM,
                    "leave it out where nothing is asked",
                )
        if (self.position_error_m is None) != (self.angle_error_rad is None):
            raise PlanError(
                f"position_error_m = {self.position_error_m} with angle_error_rad = {self.angle_error_rad}; must be both or "
                "none: the greatest lead is 2 pi times their ratio"
            )
