"""Bounds on the motion of one axis."""

from __future__ import annotations

import math
from dataclasses import dataclass

from planners import bounds
from planners.errors import PlanError

OF_ORDER = {1: "speed_m_s", 2: "acceleration_m_s2", 3: "jerk_m_s3"}


@dataclass(frozen=True, kw_only=True)
class AxisLimits:
    """What an axis may do; a bound left out is infinite. PlanError for a bound that no motion can keep."""

    position_min_m: float = -math.inf
    position_max_m: float = math.inf
    speed_m_s: float = math.inf
    acceleration_m_s2: float = math.inf
    jerk_m_s3: float = math.inf

    def __post_init__(self) -> None:
        if not self.position_min_m < self.position_max_m:
            raise PlanError(
                f"position_min_m = {self.position_min_m}, position_max_m = {self.position_max_m}; the first must be less: "
                "leave out the one that does not bound"
            )
        for name in OF_ORDER.values():
            bounds.limit(name, getattr(self, name))

    def of_order(self, order: int) -> float:
        """Bound of |derivative| of order 1, 2 or 3."""
        bound: float = getattr(self, OF_ORDER[order])
        return bound
