"""Time grid of the controller: setpoints every 5 ms, interpolation windows of 30 ms."""

from __future__ import annotations

from comms.channels import MS

TICK_NS = 5 * MS
TICKS = 6  # of a window
WINDOW_NS = TICKS * TICK_NS
TICK_S = TICK_NS * 1e-9
WINDOW_S = WINDOW_NS * 1e-9


def slowed_by_pause(skipped_ticks: int) -> float:
    """Compute the share of the speed that is left after a pause of the controller.

    The speed is that of the last window: after a pause of one window the robot is at rest.
    """
    return max(0.0, 1.0 - skipped_ticks / TICKS)
