"""Record of the executed plan, for the streamer and for the log."""

from __future__ import annotations

import msgspec

from comms.messages import Position


class PlanRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Executed plan: positions on a time grid from t_start; stored in the log."""

    planner: str
    distance_m: float
    time_s: float  # 0 = no move
    quiet_s: float
    watch_s: float
    positions_m: list[Position]
    metrics: dict[str, float | bool] | None
    period_ns: int = 10_000_000  # of the grid
    angle_rad: float | None = None  # of the load of an elastic joint, in place of distance_m
    controller_delay_s: float = 0.0  # intended delay of its controller behind the plan

    @property
    def duration_s(self) -> float:
        """Time from t_start to the end of the watch [s]."""
        return self.quiet_s + self.time_s + self.watch_s
