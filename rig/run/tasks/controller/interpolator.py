"""The 30 ms interpolation of the source.

At the start of each 30 ms window the newest reference becomes the goal, reached in six equal steps.
Without a newer reference goal and setpoint stay; a late reference is taken at the next window.
"""

from __future__ import annotations

from comms.channels import MS
from comms.messages import Position

TICK_NS = 5 * MS
TICKS = 6
WINDOW_NS = TICKS * TICK_NS


class Interpolator:
    """Linear interpolation from goal to goal on the tick grid of t_start_ns."""

    def __init__(self, t_start_ns: int, position_m: Position) -> None:
        self._t_start_ns = t_start_ns
        self._window = -1
        self._last = self._goal = position_m

    def setpoint(self, t_ns: int, newest: Position | None) -> Position:
        """Compute the setpoint of the tick due at t_ns; newest: newest accepted reference."""
        window, into_ns = divmod(t_ns - self._t_start_ns, WINDOW_NS)
        if window > self._window:
            self._window = window
            self._last = self._goal
            if newest is not None:
                self._goal = newest
        share = (into_ns // TICK_NS + 1) / TICKS
        last, goal = self._last, self._goal
        return (
            last[0] + (goal[0] - last[0]) * share,
            last[1] + (goal[1] - last[1]) * share,
            last[2] + (goal[2] - last[2]) * share,
        )
