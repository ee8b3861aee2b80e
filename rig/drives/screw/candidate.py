"""Catalogue entries: screws, and linear units with a screw."""

from __future__ import annotations

from dataclasses import dataclass

from planners import bounds
from planners.errors import PlanError
from rig.drives.screw.lead_classes import lead_class
from rig.drives.screw.shaft import BallScrew, Mounting, Thread


@dataclass(frozen=True, kw_only=True)
class CatalogueEntry(Thread):
    """Screw or linear unit of a catalogue; a check whose datum is None cannot be decided.

    Raises PlanError for an empty name, a number out of bounds and an unknown lead class.
    """

    name: str
    origin: str  # source of the figures
    dynamic_load_n: float | None = None
    static_load_n: float | None = None
    preload_n: float | None = None  # of its nut; 0 is no preload
    speed_m_s: float | None = None  # the unit's own limit
    stroke_m: float | None = None
    limit_m_rpm: float | None = None  # d x n of its balls
    lead_class: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.name.strip():
            raise PlanError(
                f"name = {self.name!r}; must not be empty: give the entry a name for `choice`"
            )
        for name in (
            "dynamic_load_n",
            "static_load_n",
            "speed_m_s",
            "stroke_m",
            "limit_m_rpm",
            "preload_n",
        ):
            value = getattr(self, name)
            if value is not None:
                bounds.datum(name, value, zero=name == "preload_n")
        if self.lead_class is not None:
            lead_class(self.lead_class)

    def screw(self, mounting: Mounting) -> BallScrew:
        """Build the shaft of the entry in a mounting."""
        return BallScrew(
            diameter_m=self.diameter_m,
            lead_m=self.lead_m,
            core_diameter_m=self.core_diameter_m,
            ball_circle_m=self.ball_circle_m,
            mounting=mounting,
        )
