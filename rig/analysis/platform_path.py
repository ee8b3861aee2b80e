"""Positions of the platform from setpoints and joint states, for robots of axes and of joints."""

from __future__ import annotations

from collections.abc import Iterator

from comms.messages import JointState, Position, Setpoint, Space, Velocity
from planners.errors import PlanError
from planners.kinematics.placement import WorkspacePlacement
from planners.kinematics.quattro import LEGS, QuattroPose
from rig.analysis.facts import RobotFacts


class PlatformPath:
    """Conversion by the kinematics that the controller had; what it cannot convert is left out."""

    def __init__(self, robot: RobotFacts) -> None:
        self._placement: WorkspacePlacement | None = None
        if robot.kinematics == "quattro":
            home = QuattroPose(0.0, 0.0, robot.home_z_m, 0.0)
            self._placement = WorkspacePlacement(home=home)
        self._known: dict[tuple[float, ...], Position] = {}  # a robot is often at rest

    def setpoints(self, setpoints: list[Setpoint]) -> Iterator[tuple[int, Position]]:
        """Yield instant [ns] and position of each setpoint."""
        for one in setpoints:
            position_m = self._position(one)
            if position_m is not None:
                yield one.t_ns, position_m

    def states(self, states: list[JointState]) -> Iterator[tuple[int, Position, Velocity]]:
        """Yield instant [ns], position and velocity of each joint state."""
        for one in states:
            position_m = self._position(one)
            velocity_m_s = one.velocity_m_s
            if position_m is None:
                continue
            if velocity_m_s is None and self._placement is not None:
                velocity_m_s = (0.0, 0.0, 0.0)
                if any(one.rates):
                    self._placement.position_of(one.values[:LEGS])
                    velocity_m_s = self._placement.rates_of(one.rates[:LEGS])
            if velocity_m_s is not None:
                yield one.t_ns, position_m, velocity_m_s

    def _position(self, message: Setpoint | JointState) -> Position | None:
        if message.position_m is not None or self._placement is None:
            return message.position_m
        if message.space is not Space.RADIANS or message.count != LEGS:
            return None
        joints = message.values[:LEGS]
        if joints not in self._known:
            try:
                self._known[joints] = self._placement.position_of(joints)
            except PlanError:
                return None
        return self._known[joints]
