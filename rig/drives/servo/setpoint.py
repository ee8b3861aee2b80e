"""What a drive is asked for at one sample, and the contract of everything that answers with a torque."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol


class MotorSetpoint(NamedTuple):
    """Where the load should be, told at the motor's shaft: n times the load's angle and its derivatives."""

    angle_rad: float
    speed_rad_s: float = 0.0
    acceleration_rad_s2: float = 0.0


class DriveController(Protocol):
    """One step a sample, no input or output of its own. Starts at rest at 0."""

    def step(self, setpoint: MotorSetpoint, motor_angle_rad: float) -> float:
        """Torque [N m] to hold until the next sample, for the encoder's angle now."""
        ...

    def reset(self) -> None:
        """Back to rest at 0."""
        ...

    @property
    def system(self) -> Any:
        """While no limit is met: control.StateSpace from setpoint_angle, setpoint_speed, setpoint_acceleration and motor_angle
        to drive_torque. For design and tests, not for the loop."""
        ...
