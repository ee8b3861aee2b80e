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
from rig.drives.servo.setpoint import DriveController, MotorSetpoint
from rig.run.drive_section import ACCELERATION_UNIT_RAD_S2, AxisDriveSection
from rig.run.joint.controllers import CONTROLLERS as JOINT_CONTROLLERS
from rig.run.joint.sections import JointSection
from rig.run.node_settings import NodeSettings
from rig.run.runtime import bench
from rig.run.runtime.drive_controllers import CONTROLLERS as AXIS_CONTROLLERS

SAMPLE_S = 1e-3
SPEED_FILTER = 0.5  # share of the newest difference of angles in the measured speed
TURN_RAD = 2.0 * math.pi
LOAD_ACCELERATION = 0x2000
MAX_INTEGER32 = 2**31 - 1


class _Motion(NamedTuple):
    """Motor at a sample."""

    angle_rad: float
    speed_rad_s: float


class NodeLogic:
    """Logic of the drive, as the motor side calls it: frames, readings and times in."""

    def __init__(
        self,
        node_id: int,
        units: DriveUnits,
        counts_per_rad: float,
        controller: DriveController,
        inertia_kg_m2: float | None = None,
    ) -> None:
        """counts_per_rad: increments on the bus per angle of the motor.

        inertia_kg_m2: with it, a torque offset enters the controller as the acceleration that it
        gives this inertia, so that the estimator of the controller knows of it; without it, the
        offset is added to the torque.
        """
        self._units = units
        self._node = DriveNode(node_id, units)
        self._controller = controller
        self._counts_per_rad = counts_per_rad
        self._inertia_kg_m2 = inertia_kg_m2
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

    def sample(self, t_ns: int, reading: bench.DriveSensors) -> float:
        """Take the sensors of a sample; return the torque [N m] until the next one."""
        motion = self._measure(reading.motor_angle_rad)
        if reading.load_acceleration_rad_s2 is not None:
            self._publish_acceleration(reading.load_acceleration_rad_s2)
        feedback = DriveFeedback(
            position=motion.angle_rad * self._counts_per_rad,
            velocity=motion.speed_rad_s * self._counts_per_rad,
            torque=self._units.to_permille(self._torque_n_m),
            drive_fault=self._fault_code,
            negative_switch=reading.negative_switch,
            positive_switch=reading.positive_switch,
        )
        self._torque_n_m = self._torque(self._node.step(t_ns, feedback), motion)
        return self._torque_n_m

    def _publish_acceleration(self, acceleration_rad_s2: float) -> None:
        counts = round(acceleration_rad_s2 / ACCELERATION_UNIT_RAD_S2)
        value = max(-MAX_INTEGER32, min(MAX_INTEGER32, counts))
        self._node.dictionary.set(LOAD_ACCELERATION, value)

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
        if self._inertia_kg_m2 is None:
            torque += self._units.from_permille(demand.torque)
        return min(max(torque, -limit), limit)

    def _setpoint(self, demand: DriveDemand, zero_rad: float) -> MotorSetpoint:
        speed = demand.velocity / self._counts_per_rad
        acceleration = demand.acceleration / self._counts_per_rad
        if self._inertia_kg_m2 is not None:
            offset = self._units.from_permille(demand.torque) / self._inertia_kg_m2
            acceleration += offset
            speed += offset * SAMPLE_S / 2.0  # a difference of positions is half a sample old
        if demand.kind == "velocity":
            self._turned_rad += speed * SAMPLE_S
        else:
            self._turned_rad = demand.position / self._counts_per_rad
        if demand.kind == "brake":
            speed = acceleration = 0.0
        return MotorSetpoint(self._turned_rad - zero_rad, speed, acceleration)


def _plain(frames: list[CanFrame]) -> list[tuple[int, bytes]]:
    return [(frame.can_id, frame.data) for frame in frames]


def axis_logic(drive: AxisDriveSection) -> NodeLogic:
    """Make the logic of the drive of a ball-screw axis, powered off."""
    units = DriveUnits(
        increments_per_unit=drive.increments_per_unit, rated_torque=drive.rated_torque_n_m
    )
    controller = AXIS_CONTROLLERS[drive.controller](drive, SAMPLE_S)
    return NodeLogic(drive.node_id, units, drive.encoder_counts_per_rev / TURN_RAD, controller)


def joint_logic(joint: JointSection) -> NodeLogic:
    """Make the logic of the drive of an elastic joint, powered off."""
    drive = joint.drive
    per_rad = drive.increments_per_unit
    units = DriveUnits(increments_per_unit=per_rad, rated_torque=drive.rated_torque_n_m)
    controller = JOINT_CONTROLLERS[joint.controller](joint).controller
    inertia_kg_m2 = joint.joint.rigid_inertia_kg_m2
    return NodeLogic(drive.node_id, units, per_rad, controller, inertia_kg_m2)


def task(settings: NodeSettings) -> Task:
    """Make the simulated plant with its node a task of this process."""
    joint, drive = settings.joint, settings.drive
    make_logic = (lambda: axis_logic(drive)) if joint is None else (lambda: joint_logic(joint))
    return bench.drive_task(settings.plant, make_logic)


def build(settings: bytes) -> Task:
    """Make the task from its settings in JSON."""
    return task(msgspec.json.decode(settings, type=NodeSettings))


if __name__ == "__main__":
    from comms.runner import main

    sys.exit(main(build))
