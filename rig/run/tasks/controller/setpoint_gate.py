"""Gate at the last hop: each setpoint sent to the servos against the envelope, in Cartesian space.

Speed is the step from the setpoint sent before over 5 ms, whatever time lay between; acceleration
is the change of that speed over the 30 ms window.
"""

from __future__ import annotations

import math
from collections import deque

from comms.messages import Position, Velocity
from rig.run.tasks.controller.vectors import ZERO, rate, scaled
from rig.run.tasks.controller.workspace import Workspace
from rig.run.tasks.grid import TICK_S, TICKS, WINDOW_S, slowed_by_pause
from rig.run.tasks.safety import POSITION_ROUNDING_M, Envelope

SPEED_ROUNDING_M_S = 4e-6  # references rounded to 1 nm are 10 ms apart
ACCELERATION_ROUNDING_M_S2 = SPEED_ROUNDING_M_S / WINDOW_S


class SetpointGate:
    """Check of consecutive setpoints, from rest at position_m.

    Setpoints that lie outside the bounds of position no farther than position_m does are inside.
    """

    def __init__(self, envelope: Envelope, tick: int, position_m: Position) -> None:
        self._workspace = Workspace(envelope, position_m)
        self._envelope = envelope
        self._tick = tick  # of the setpoint before
        self._position = position_m
        self._past = deque([ZERO] * TICKS, maxlen=TICKS)  # velocity of each of the last steps
        self.excesses = 0  # setpoints outside the envelope

    def excess(self, tick: int, position_m: Position) -> str | None:
        """Take the setpoint of a tick; return value and bound where it leaves the envelope."""
        skipped = tick - self._tick - 1
        if skipped > 0:
            self._slow_down(slowed_by_pause(skipped))
        velocity = rate(self._position, position_m, TICK_S)
        acceleration_m_s2 = math.dist(velocity, self._past[0]) / WINDOW_S
        self._past.append(velocity)
        self._tick, self._position = tick, position_m
        found = self._outside(position_m) or self._too_fast(velocity, acceleration_m_s2)
        if found is not None:
            self.excesses += 1
        return found

    def _slow_down(self, share: float) -> None:
        for _ in range(TICKS):
            self._past.append(scaled(self._past[0], share))

    def _outside(self, position_m: Position) -> str | None:
        for axis, value, lower, upper in zip(
            "xyz", position_m, self._workspace.lower, self._workspace.upper, strict=True
        ):
            inside = lower - POSITION_ROUNDING_M <= value <= upper + POSITION_ROUNDING_M
            if not inside:  # NaN as well
                return f"{axis} = {value:.4f} m; must be {lower:g} to {upper:g} m"
        return None

    def _too_fast(self, velocity: Velocity, acceleration_m_s2: float) -> str | None:
        e = self._envelope
        speed_m_s = math.hypot(*velocity)
        if not speed_m_s <= e.speed_m_s + SPEED_ROUNDING_M_S:
            return f"speed {speed_m_s:.3f} m/s over 5 ms; must be <= {e.speed_m_s:.3f} m/s"
        if not acceleration_m_s2 <= e.acceleration_m_s2 + ACCELERATION_ROUNDING_M_S2:
            return (
                f"acceleration {acceleration_m_s2:.2f} m/s2 over 30 ms; "
                f"must be <= {e.acceleration_m_s2:.2f} m/s2"
            )
        return None
