"""Elastic joint behind a drive, simulated to exact times: plant and motor side of the node."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from comms.messages import Position, Velocity
from sim_rig.drive_faults import DriveFault
from sim_rig.drive_logic import SAMPLE_NS, DriveLogic, DriveReading, PoweredLogic
from sim_rig.elastic_joint import ElasticJoint
from sim_rig.joint_params import Joint
from sim_rig.link_angles import LinkState
from sim_rig.vectors import Vector


class JointBench:
    """Simulated joint at time `t_ns`; its drive is sampled at each whole millisecond.

    The angle is that of the load at the output shaft; the place of the joint does not change.
    """

    position_m: Position = (0.0, 0.0, 0.0)
    velocity_m_s: Velocity = (0.0, 0.0, 0.0)

    def __init__(
        self,
        params: Joint,
        seed: int,
        make_logic: Callable[[], DriveLogic],
        t_ns: int,
        faults: Sequence[DriveFault] = (),
    ) -> None:
        """make_logic: makes the logic, powered on at t_ns and after each reset of the node."""
        self.t_ns = t_ns
        self._joint = ElasticJoint(params, seed)
        self._drive = PoweredLogic(make_logic, t_ns, faults)
        self._torque_n_m = 0.0
        self._sample()

    @property
    def drive(self) -> PoweredLogic:
        """Drive with its frames."""
        return self._drive

    @property
    def angle_rad(self) -> float:
        """Angle of the load."""
        return self._joint.truth().load_angle_rad

    @property
    def angular_velocity_rad_s(self) -> float:
        """Speed of the load."""
        return self._joint.truth().load_speed_rad_s

    @property
    def cable_points_m(self) -> list[Vector]:
        """Nothing hangs on the joint."""
        return []

    @property
    def link_lengths_m(self) -> list[float]:
        """Nothing hangs on the joint."""
        return []

    @property
    def links(self) -> list[LinkState]:
        """Load at the output shaft, as one link."""
        truth = self._joint.truth()
        return [LinkState(truth.load_angle_rad, 0.0, truth.load_speed_rad_s, 0.0)]

    def await_run(self) -> None:
        """Do nothing: the load has no events."""

    def start_run(self, t_ns: int) -> None:
        """Do nothing: the load has no events."""

    def set_setpoint(self, position_m: Position) -> None:
        """Do nothing: the drive takes its targets from the bus."""

    def advance(self, t_ns: int) -> None:
        """Integrate to exactly t_ns; raises ValueError if it is in the past."""
        if t_ns < self.t_ns:
            raise ValueError(
                f"t_ns = {t_ns}; must be >= {self.t_ns}, the time of the bench: "
                "advance in the order of time"
            )
        while self.t_ns < t_ns:
            next_ns = min(t_ns, self.t_ns - self.t_ns % SAMPLE_NS + SAMPLE_NS)
            self._joint.advance(self._torque_n_m, (next_ns - self.t_ns) * 1e-9)
            self.t_ns = next_ns
            if next_ns % SAMPLE_NS == 0:
                self._sample()

    def _sample(self) -> None:
        self._drive.begin_faults(self.t_ns, self._joint.truth().load_speed_rad_s)
        reading = self._joint.read()
        sensors = DriveReading(
            motor_angle_rad=reading.motor_angle_rad + self._drive.step_rad,
            load_acceleration_rad_s2=reading.load_acceleration_rad_s2,
        )
        self._torque_n_m = self._drive.sample(self.t_ns, sensors)
