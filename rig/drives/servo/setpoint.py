"""Setpoint of a drive for one sample, and the interface of every drive controller."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol


class MotorSetpoint(NamedTuple):
    """Setpoint of the load, seen at the motor shaft.

    n times the angle of the load, and its derivatives.
    """

    angle_rad: float
    speed_rad_s: float = 0.0
    acceleration_rad_s2: float = 0.0


class DriveController(Protocol):
    """Controller with one step per sample, without input or output of its own.

    Starts at rest at angle 0.
    """

    def step(self, setpoint: MotorSetpoint, motor_angle_rad: float) -> float:
        """Compute the torque [N m] to hold until the next sample.

        From setpoint and encoder angle of this sample.
        """
        ...

    def reset(self) -> None:
        """Set the state to rest at angle 0."""
        ...

    @property
    def system(self) -> Any:
        """Linear system while no limit is active, for design and tests.

        control.StateSpace from setpoint_angle, setpoint_speed, setpoint_acceleration and
        motor_angle to drive_torque.
        """
        ...
