"""Motion of the platform, as the controller takes it from the encoders."""

from __future__ import annotations

from typing import NamedTuple

from comms.messages import JointState, Position, Velocity


class PlatformState(NamedTuple):
    """Position and velocity of the platform at t_ns, the instant of the measurement."""

    t_ns: int
    position_m: Position
    velocity_m_s: Velocity


def platform_state(joints: JointState) -> PlatformState | None:
    """Read the axes x, y, z as the platform; None for other joints."""
    position_m, velocity_m_s = joints.position_m, joints.velocity_m_s
    if position_m is None or velocity_m_s is None:
        return None
    return PlatformState(joints.t_ns, position_m, velocity_m_s)
