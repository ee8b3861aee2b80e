"""Safety gate on outgoing references: bounds on position, speed and acceleration.

Speed and acceleration are differences of the references themselves.
"""

from __future__ import annotations

import math

import msgspec

from comms.messages import Position
from rig.run.tasks.grid import WINDOW_NS

POSITION_ROUNDING_M = 1e-9  # rounding of the sums that make up a position


class Envelope(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Bounds on references: range of x, largest |y| and |z|; speed and acceleration in space."""

    position_min_m: float
    position_max_m: float
    depth_m: float = 0.25  # |y|
    height_m: float = 0.1  # |z|
    speed_m_s: float
    acceleration_m_s2: float


class Gate:
    """Check of consecutive references; speed and acceleration are those between accepted ones.

    A gap between references allows no higher speed: the controller covers any gap within one
    window.
    """

    def __init__(self, envelope: Envelope) -> None:
        self._envelope = envelope
        self._t_ns = 0
        self._position: Position | None = None
        self._velocity = (0.0, 0.0, 0.0)

    def refusal(self, t_ns: int, position_m: Position) -> str | None:
        """Check a reference; return bound and value that it violates, None when it may be sent."""
        e = self._envelope
        if not e.position_min_m <= position_m[0] <= e.position_max_m:  # NaN is outside
            return f"x = {position_m[0]:.4f} m; must be {e.position_min_m} to {e.position_max_m} m"
        for axis, value, bound in (
            ("y", position_m[1], e.depth_m),
            ("z", position_m[2], e.height_m),
        ):
            if not abs(value) <= bound:
                return f"{axis} = {value:.4f} m; must be within +-{bound} m"
        if self._position is None:
            self._t_ns, self._position = t_ns, position_m
            return None
        dt = (t_ns - self._t_ns) * 1e-9
        if dt <= 0:
            return (
                f"reference {abs(dt) * 1e3:.1f} ms back in time; must be later than the one before"
            )
        velocity = tuple(
            (new - old) / dt for new, old in zip(position_m, self._position, strict=True)
        )
        refusal = self._check_rates(velocity, dt)
        if refusal is None:
            self._t_ns, self._position = t_ns, position_m
            self._velocity = (velocity[0], velocity[1], velocity[2])
        return refusal

    def _check_rates(self, velocity: tuple[float, ...], dt: float) -> str | None:
        e = self._envelope
        window = min(dt, WINDOW_NS * 1e-9)
        speed = math.hypot(*velocity) * dt / window
        # "not <=" refuses a bound that is NaN as well
        if not speed <= e.speed_m_s + POSITION_ROUNDING_M / window:
            return f"speed {speed:.3f} m/s; must be <= {e.speed_m_s:.3f} m/s"
        acceleration = math.dist(velocity, self._velocity) / dt
        if not acceleration <= e.acceleration_m_s2 + 4 * POSITION_ROUNDING_M / dt**2:
            return (
                f"acceleration {acceleration:.2f} m/s2; must be <= {e.acceleration_m_s2:.2f} m/s2"
            )
        return None
