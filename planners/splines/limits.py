"""Limits on the motion of one axis."""

from __future__ import annotations

import math
from dataclasses import dataclass

from planners import bounds
from planners.errors import PlanError

LIMIT_NAMES = {1: "speed_m_s", 2: "acceleration_m_s2", 3: "jerk_m_s3"}  # by order of derivative


@dataclass(frozen=True, kw_only=True)
class AxisLimits:
    """Limits of position, speed, acceleration and jerk of one axis; infinite by default.

    Raises PlanError for limits that no motion can satisfy.
    """

    position_min_m: float = -math.inf
    position_max_m: float = math.inf
    speed_m_s: float = math.inf
    acceleration_m_s2: float = math.inf
    jerk_m_s3: float = math.inf

    def __post_init__(self) -> None:
        if not self.position_min_m < self.position_max_m:
            raise PlanError(
                f"position_min_m = {self.position_min_m}, position_max_m = {self.position_max_m}; "
                "the first must be less: leave out the one that does not bound"
            )
        for name in LIMIT_NAMES.values():
            bounds.limit(name, getattr(self, name))

    def peak_limit(self, order: int) -> float:
        """Look up the limit of |derivative| of order 1, 2 or 3."""
        limit: float = getattr(self, LIMIT_NAMES[order])
        return limit
