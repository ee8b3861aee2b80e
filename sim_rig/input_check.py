"""Check of the setpoints at the input of the robot, as the last computer before the drives does it.

A setpoint belongs to a tick of 5 ms. Speed is the step over the ticks since the setpoint before,
where setpoints were lost on the way, else over one; acceleration is the change over 30 ms.
"""

from __future__ import annotations

import math
from collections import deque

import msgspec

from comms.messages import Position, Velocity

TICK_NS = 5_000_000
TICK_S = 5e-3
WINDOW_TICKS = 6
WINDOW_S = WINDOW_TICKS * TICK_S
POSITION_MARGIN_M = 1e-9
SPEED_MARGIN_M_S = 5e-6  # rounding of positions to 1 nm
ACCELERATION_MARGIN_M_S2 = SPEED_MARGIN_M_S / WINDOW_S


class InputBounds(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Bounds on setpoints, and whether the robot stops by itself outside them."""

    lower_m: Position
    upper_m: Position
    speed_m_s: float
    acceleration_m_s2: float
    stops: bool = True  # else setpoints outside are counted alone


class InputCheck:
    """Check of consecutive setpoints, from rest at position_m."""

    def __init__(self, bounds: InputBounds, position_m: Position) -> None:
        self._bounds = bounds
        self.stops = bounds.stops
        self._position = position_m
        self._seq: int | None = None  # of the setpoint before
        self._tick = 0
        # (velocity, whether setpoints were lost) of each of the last ticks
        self._past = deque([((0.0, 0.0, 0.0), False)] * WINDOW_TICKS, maxlen=WINDOW_TICKS)
        self.excesses = 0

    def excess(self, seq: int, t_ns: int, position_m: Position) -> str | None:
        """Take a setpoint sent at t_ns; return value and bound where it is outside.

        Only a setpoint that is inside, or that does not stop the robot, becomes the one before.
        """
        tick = t_ns // TICK_NS
        ticks = 1
        if self._seq is not None:
            self._slow_down(tick - self._tick - (seq - self._seq))
            ticks = min(max(seq - self._seq, 1), WINDOW_TICKS)
        velocity = self._velocity(position_m, ticks)
        found = self._outside(position_m) or self._too_fast(velocity, ticks)
        if found is not None:
            self.excesses += 1
        if found is None or not self.stops:
            self._seq, self._tick, self._position = seq, tick, position_m
            self._past.extend([(velocity, ticks > 1)] * ticks)
        return found

    def _slow_down(self, skipped: int) -> None:
        """Take from the speeds what a pause of the sender took: all of it after 30 ms."""
        if skipped <= 0:
            return
        left = max(0.0, 1.0 - skipped / WINDOW_TICKS)
        slowed = [((x * left, y * left, z * left), lost) for (x, y, z), lost in self._past]
        self._past = deque(slowed, maxlen=WINDOW_TICKS)

    def _velocity(self, position_m: Position, ticks: int) -> Velocity:
        dt_s = ticks * TICK_S
        old = self._position
        return (
            (position_m[0] - old[0]) / dt_s,
            (position_m[1] - old[1]) / dt_s,
            (position_m[2] - old[2]) / dt_s,
        )

    def _outside(self, position_m: Position) -> str | None:
        b = self._bounds
        for axis, value, lower, upper in zip("xyz", position_m, b.lower_m, b.upper_m, strict=True):
            inside = lower - POSITION_MARGIN_M <= value <= upper + POSITION_MARGIN_M
            if not inside and position_m != self._position:
                return f"{axis} = {value:.4f} m; must be {lower:g} to {upper:g} m"
        return None

    def _too_fast(self, velocity: Velocity, ticks: int) -> str | None:
        """Check speed and acceleration; a held setpoint is never too fast."""
        b = self._bounds
        speed_m_s = math.hypot(*velocity)
        if speed_m_s == 0.0:
            return None
        if not speed_m_s <= b.speed_m_s + SPEED_MARGIN_M_S:
            return f"speed {speed_m_s:.3f} m/s; must be <= {b.speed_m_s:.3f} m/s"
        before = list(self._past)[:ticks]
        change_m_s = max(math.dist(velocity, old) for old, _ in before)
        acceleration_m_s2 = change_m_s / WINDOW_S
        # a mean over lost setpoints may mix two windows
        windows = 2 if ticks > 1 or any(lost for _, lost in self._past) else 1
        bound_m_s2 = windows * b.acceleration_m_s2
        if not acceleration_m_s2 <= bound_m_s2 + ACCELERATION_MARGIN_M_S2:
            return f"acceleration {acceleration_m_s2:.2f} m/s2; must be <= {bound_m_s2:.2f} m/s2"
        return None
