"""The plan as it is played: what the streamer is given and the log keeps."""

from __future__ import annotations

import msgspec

from comms.messages import Position


class PlanRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The plan as it is played: positions on a grid from t_start; travels in the log."""

    planner: str
    distance_m: float
    time_s: float  # 0 = nothing moves
    quiet_s: float
    watch_s: float
    positions_m: list[Position]
    metrics: dict[str, float | bool] | None
    period_ns: int = 10_000_000  # of the grid

    @property
    def duration_s(self) -> float:
        """From t_start to the end of the watch."""
        return self.quiet_s + self.time_s + self.watch_s
