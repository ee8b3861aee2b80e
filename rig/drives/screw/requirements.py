"""Utilisation of the limits, and requirements of an axis."""

from __future__ import annotations

from dataclasses import dataclass

from planners import bounds
from planners.errors import PlanError, check_range
from rig.drives.screw.lead_classes import lead_class


@dataclass(frozen=True, kw_only=True)
class Utilisation:
    """Share of each limit that a design may use, and the service factor on forces.

    Raises PlanError for a number out of bounds.
    """

    whirl: float = 0.7  # of the first bending frequency; source 004: 0.65 to 0.85
    buckling: float = 0.5  # of Euler's load; source 004: 0.5 to 0.7
    balls: float = 1.0  # of d x n
    bandwidth: float = 0.5  # of the antiresonance; source 004: 0.5 to 0.7
    # on forces: 1 to 1.2 for regular motion, to 1.5 for light shocks, to 3 for frequent ones
    service_factor: float = 1.2
    # preload over dynamic load rating, of nuts without a preload of their own; source 004: 0.05 to
    # 0.1
    preload: float = 0.0

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
            "it is a share of the dynamic load rating, usually 0.05 to 0.1",
        )


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """Bounds that the axis must meet; None sets no bound.

    Raises PlanError for a number out of bounds, an unknown lead class, and one of the two errors
    of accuracy without the other.
    """

    life_h: float | None = None
    lead_class: str | None = None  # coarsest class allowed
    travel_deviation_m: float | None = None  # over the useful travel
    position_error_m: float | None = None  # caused by angle_error_rad
    angle_error_rad: float | None = None  # of the motor
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
                    "leave it out where nothing is required",
                )
        if (self.position_error_m is None) != (self.angle_error_rad is None):
            raise PlanError(
                f"position_error_m = {self.position_error_m} with "
                f"angle_error_rad = {self.angle_error_rad}; must be given together: add the other "
                "one, as the greatest lead is 2 pi times their ratio"
            )
