"""Following error: encoders against the setpoint that the servos, with their lag, should reach."""

from __future__ import annotations

import math
from collections import deque

from comms.channels import MS
from comms.messages import Position
from rig.run.tasks.controller.joints import PlatformState
from rig.run.tasks.grid import TICK_NS


class FollowingWatch:
    """Watch of the distance between actual position and delayed setpoint."""

    def __init__(self, lag_ns: int, bound_m: float, allowed_ns: int) -> None:
        self._lag_ns = lag_ns
        self._bound_m = bound_m
        self._allowed_ns = allowed_ns
        kept = lag_ns // TICK_NS + 2  # a tick before the lag, and the newest
        self._sent: deque[tuple[int, Position]] = deque(maxlen=kept + 1)
        self._beyond_since_ns: int | None = None  # instant of measuring
        self._error_m = 0.0

    def add_setpoint(self, t_ns: int, position_m: Position) -> None:
        """Take a setpoint that was sent."""
        self._sent.append((t_ns, position_m))

    def take_platform(self, platform: PlatformState) -> None:
        """Compare a measurement with the setpoint of the lag before it."""
        due_ns = platform.t_ns - self._lag_ns
        setpoint = None
        for t_ns, position_m in self._sent:
            if t_ns <= due_ns:
                setpoint = position_m
        if setpoint is None:
            return
        self._error_m = math.dist(setpoint, platform.position_m)
        if self._error_m <= self._bound_m:
            self._beyond_since_ns = None
        elif self._beyond_since_ns is None:
            self._beyond_since_ns = platform.t_ns

    def fault(self, platform: PlatformState | None) -> str | None:
        """Describe an error that has been beyond its bound for too long; None while it is not."""
        if platform is None or self._beyond_since_ns is None:
            return None
        age_ns = platform.t_ns - self._beyond_since_ns
        if age_ns < self._allowed_ns:
            return None
        return (
            f"following error {self._error_m * 1e3:.1f} mm for {age_ns / MS:.0f} ms; must be <= "
            f"{self._bound_m * 1e3:g} mm (safety.following_error_mm), beyond for less than "
            f"{self._allowed_ns / MS:g} ms (safety.following_error_ms)"
        )
