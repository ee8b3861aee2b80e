"""The source's 30 ms interpolation: on a fixed grid the newest reference becomes the goal, reached in six even ticks.

Policy `hold`: when nothing newer came, goal and setpoint stay; a late reference is taken at the next window.
"""

from __future__ import annotations

from comms.channels import MS
from comms.messages import Position

TICK_NS = 5 * MS
TICKS = 6
WINDOW_NS = TICKS * TICK_NS


class Interpolator:
    """Setpoints on the tick grid of t_start_ns, moving linearly from goal to goal."""

    def __init__(self, t_start_ns: int, position_m: Position) -> None:
        self._t_start_ns = t_start_ns
        self._window = -1
        self._last = self._goal = position_m

    def setpoint(self, t_ns: int, newest: Position | None) -> Position:
        """Setpoint of the tick that is due at t_ns; newest = the newest reference accepted so far."""
        window, into_ns = divmod(t_ns - self._t_start_ns, WINDOW_NS)
        if window > self._window:
            self._window = window
            self._last, self._goal = self._goal, self._goal if newest is None else newest
        share = (into_ns // TICK_NS + 1) / TICKS
        last, goal = self._last, self._goal
        return (
            last[0] + (goal[0] - last[0]) * share,
            last[1] + (goal[1] - last[1]) * share,
            last[2] + (goal[2] - last[2]) * share,
        )
