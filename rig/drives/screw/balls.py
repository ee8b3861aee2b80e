"""Balls of a nut: material and allowed speed (source 004, C.0.8)."""

from __future__ import annotations

from dataclasses import dataclass

from planners import bounds
from planners.errors import unknown_name

# lowest and highest d x n that makers usually allow
BALLS_M_RPM = {"steel": (70.0, 120.0), "ceramic": (190.0, 220.0)}


@dataclass(frozen=True, kw_only=True)
class Balls:
    """Material of the balls, and the maker's limit of d x n where it is known.

    Raises PlanError for an unknown material or a d x n not above 0.
    """

    material: str = "steel"
    limit_m_rpm: float | None = None

    def __post_init__(self) -> None:
        if self.material not in BALLS_M_RPM:
            raise unknown_name("material", self.material, BALLS_M_RPM)
        if self.limit_m_rpm is not None:
            bounds.datum("limit_m_rpm", self.limit_m_rpm)

    @property
    def allowed_m_rpm(self) -> float:
        """Limit of d x n: the maker's, else the lower end of the material's range."""
        return BALLS_M_RPM[self.material][0] if self.limit_m_rpm is None else self.limit_m_rpm

    @property
    def usual(self) -> bool:
        """True if the limit of d x n is within the material's range."""
        low, high = BALLS_M_RPM[self.material]
        return low <= self.allowed_m_rpm <= high
