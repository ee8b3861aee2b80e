"""Joints of the robot as the controller believes them: positions out as setpoints, encoders in."""

from __future__ import annotations

from typing import Literal, NamedTuple, Protocol

import msgspec

from comms.messages import (
    JointRates,
    JointState,
    JointValues,
    Position,
    Setpoint,
    Space,
    Velocity,
    axis_setpoint,
    joint_setpoint,
)
from planners.errors import PlanError
from planners.kinematics.placement import WorkspacePlacement
from planners.kinematics.quattro import LEGS, QuattroPose

Kinematics = Literal["axes", "quattro"]


class RobotSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Kinematics of the robot, and height of its home position over its base."""

    kinematics: Kinematics = "axes"
    home_z_m: float = -0.90


class PlatformState(NamedTuple):
    """Position and velocity of the platform at t_ns, the instant of the measurement."""

    t_ns: int
    position_m: Position
    velocity_m_s: Velocity


class RobotJoints(Protocol):
    """Conversion between platform and joints."""

    expected: str  # joints, as a text

    def setpoint(self, seq: int, t_ns: int, position_m: Position) -> Setpoint:
        """Make the setpoint of a position; raises PlanError for one out of reach."""

    def platform(self, joints: JointState) -> PlatformState | None:
        """Compute the platform from the encoders; None for the joints of another robot."""


class Axes:
    """Robot whose joints are the axes x, y, z."""

    expected = "x, y, z in m"

    def setpoint(self, seq: int, t_ns: int, position_m: Position) -> Setpoint:
        """Make the setpoint of a position."""
        return axis_setpoint(seq, t_ns, position_m)

    def platform(self, joints: JointState) -> PlatformState | None:
        """Read the axes as the platform; None for other joints."""
        position_m, velocity_m_s = joints.position_m, joints.velocity_m_s
        if position_m is None or velocity_m_s is None:
            return None
        return PlatformState(joints.t_ns, position_m, velocity_m_s)


class QuattroJoints:
    """Quattro of the nominal geometry, whose platform does not turn."""

    expected = f"{LEGS} joints in rad"

    def __init__(self, home_z_m: float) -> None:
        """home_z_m: height of the home position; raises PlanError for one out of reach."""
        self._placement = WorkspacePlacement(home=QuattroPose(0.0, 0.0, home_z_m, 0.0))
        self._asked_m: Position = (0.0, 0.0, 0.0)
        self._asked_rad = self._placement.joints_of(self._asked_m)
        self._read: tuple[JointValues, JointRates] | None = None
        self._found: tuple[Position, Velocity] = (self._asked_m, (0.0, 0.0, 0.0))

    def setpoint(self, seq: int, t_ns: int, position_m: Position) -> Setpoint:
        """Make the setpoint of a position; raises PlanError for one out of reach."""
        if position_m != self._asked_m:  # a setpoint is often held
            self._asked_rad = self._placement.joints_of(position_m)
            self._asked_m = position_m
        return joint_setpoint(seq, t_ns, self._asked_rad)

    def platform(self, joints: JointState) -> PlatformState | None:
        """Compute the platform by forward kinematics; None for other joints, or none that close."""
        if joints.space is not Space.RADIANS or joints.count != LEGS:
            return None
        read = joints.values, joints.rates
        if read != self._read:  # a robot is often at rest
            placement = self._placement
            try:
                position_m = placement.position_of(joints.values[:LEGS])
                self._found = position_m, placement.rates_of(joints.rates[:LEGS])
            except PlanError:
                return None
            self._read = read
        return PlatformState(joints.t_ns, *self._found)


def robot_joints(settings: RobotSettings) -> RobotJoints:
    """Make the conversion of a robot; raises PlanError for a home position out of reach."""
    if settings.kinematics == "quattro":
        return QuattroJoints(settings.home_z_m)
    return Axes()
