"""Node of the field bus: CiA 402 logic and a controller, around the simulated axis.

As a process, it is the bench of a run with a drive: `python -m rig.run.runtime.drive_node`.
"""

from __future__ import annotations

import math
import sys
from typing import NamedTuple

import msgspec

from comms.task import Task
from rig.drives.cia402.frames import CanFrame
from rig.drives.cia402.node import DriveNode
from rig.drives.cia402.signals import DriveDemand, DriveFeedback, DriveUnits
from rig.drives.servo.setpoint import MotorSetpoint
from rig.run.drive_section import AxisDriveSection, NodeSettings
from rig.run.runtime import bench
from rig.run.runtime.drive_controllers import CONTROLLERS

SAMPLE_S = 1e-3
SPEED_FILTER = 0.5  # share of the newest difference of angles in the measured speed
TURN_RAD = 2.0 * math.pi


class _Motion(NamedTuple):
    """Motor at a sample."""

    angle_rad: float
    speed_rad_s: float


class NodeLogic:
    """Logic of the drive, as the motor side calls it: frames, readings and times in."""

    def __init__(self, drive: AxisDriveSection) -> None:
        self._drive = drive
        units = DriveUnits(
            increments_per_unit=drive.increments_per_m, rated_torque=drive.rated_torque_n_m
        )
        self._units = units
        self._node = DriveNode(drive.node_id, units)
        self._controller = CONTROLLERS[drive.controller](drive, SAMPLE_S)
        self._counts_per_rad = drive.encoder_counts_per_rev / TURN_RAD
        self._last: _Motion | None = None
        self._zero_rad: float | None = None  # angle of the controller; None while it is off
        self._torque_n_m = 0.0
        self._fault_code = 0  # of the power stage
        self._turned_rad = 0.0  # target of the demand `velocity`

    def start(self, t_ns: int) -> list[tuple[int, bytes]]:
        """Power on."""
        return _plain(self._node.on_time(t_ns))

    def frame(
        self, can_id: int, data: bytes, is_remote: bool, t_ns: int
    ) -> list[tuple[int, bytes]]:
        """Take a frame from the bus; return the answers."""
        return _plain(self._node.on_frame(CanFrame(can_id, data, is_remote), t_ns))

    def fail(self, code: int) -> None:
        """Take a fault of the power stage; it is reported at the next sample."""
        self._fault_code = code

    def time(self, t_ns: int) -> list[tuple[int, bytes]]:
        """Return the frames that are due."""
        return _plain(self._node.on_time(t_ns))

    def sample(self, t_ns: int, reading: bench.AxisSensors) -> float:
        """Take the sensors of a sample; return the torque [N m] until the next one."""
        motion = self._measure(reading.motor_angle_rad)
        feedback = DriveFeedback(
            position=motion.angle_rad * self._counts_per_rad,
            velocity=motion.speed_rad_s * self._counts_per_rad,
            torque=self._units.to_permille(self._torque_n_m),
            negative_switch=reading.negative_switch,
            positive_switch=reading.positive_switch,
            drive_fault=self._fault_code,
        )
        self._torque_n_m = self._torque(self._node.step(t_ns, feedback), motion)
        return self._torque_n_m

    def _measure(self, angle_rad: float) -> _Motion:
        last = self._last or _Motion(angle_rad, 0.0)
        difference = (angle_rad - last.angle_rad) / SAMPLE_S
        speed = last.speed_rad_s + SPEED_FILTER * (difference - last.speed_rad_s)
        self._last = _Motion(angle_rad, speed)
        return self._last

    def _torque(self, demand: DriveDemand, motion: _Motion) -> float:
        """Control the motor as demanded; a controller that was off starts from where it stands."""
        if demand.kind == "off":
            self._zero_rad = None
            return 0.0
        if demand.kind == "torque":
            self._zero_rad = None
            return self._units.from_permille(demand.torque)
        if self._zero_rad is None:
            self._zero_rad = self._turned_rad = motion.angle_rad
            self._controller.reset()
        setpoint = self._setpoint(demand, self._zero_rad)
        limit = self._units.from_permille(demand.torque_limit)
        torque = self._controller.step(setpoint, motion.angle_rad - self._zero_rad)
        torque += self._units.from_permille(demand.torque)
        return min(max(torque, -limit), limit)

    def _setpoint(self, demand: DriveDemand, zero_rad: float) -> MotorSetpoint:
        speed = demand.velocity / self._counts_per_rad
        acceleration = demand.acceleration / self._counts_per_rad
        if demand.kind == "velocity":
            self._turned_rad += speed * SAMPLE_S
        else:
            self._turned_rad = demand.position / self._counts_per_rad
        if demand.kind == "brake":
            speed = acceleration = 0.0
        return MotorSetpoint(self._turned_rad - zero_rad, speed, acceleration)


def _plain(frames: list[CanFrame]) -> list[tuple[int, bytes]]:
    return [(frame.can_id, frame.data) for frame in frames]


def task(settings: NodeSettings) -> Task:
    """Make the simulated plant with its node a task of this process."""
    return bench.drive_task(settings.plant, lambda: NodeLogic(settings.drive))


def build(settings: bytes) -> Task:
    """Make the task from its settings in JSON."""
    return task(msgspec.json.decode(settings, type=NodeSettings))


if __name__ == "__main__":
    from comms.runner import main

    sys.exit(main(build))
