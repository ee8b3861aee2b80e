"""Move of a simulated joint under one controller: one step per sample, all recorded."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from planners.trajectories.trajectory import Trajectory
from rig.analysis.joint_move import Recording, integrated_speed
from rig.drives.servo.setpoint import DriveController, MotorSetpoint
from rig.errors import RunFailed


class Measurement(Protocol):
    """Sensor values of one sample."""

    @property
    def motor_angle_rad(self) -> float:
        """Angle of the motor by the encoder."""
        ...

    @property
    def load_acceleration_rad_s2(self) -> float:
        """Acceleration of the load shaft by the accelerometer."""
        ...


class SimulatedJointState(Protocol):
    """State of the simulated joint, for records, analysis and tests only."""

    @property
    def load_angle_rad(self) -> float:
        """Angle of the load shaft."""
        ...

    @property
    def load_speed_rad_s(self) -> float:
        """Speed of the load shaft."""
        ...

    @property
    def applied_torque_n_m(self) -> float:
        """Torque of the motor, within its limit."""
        ...

    @property
    def integration_error_rad(self) -> float:
        """Bound of the integration error of the simulation, at the motor."""
        ...


class JointPlant(Protocol):
    """Joint with its drive, real or simulated."""

    def advance(self, torque_n_m: float, duration_s: float) -> None:
        """Hold the torque for a duration."""
        ...

    def read(self) -> Measurement:
        """Read the sensors."""
        ...

    def truth(self) -> SimulatedJointState:
        """Return the state of the simulation."""
        ...


def run_move(
    bench: JointPlant,
    controller: DriveController,
    trajectory: Trajectory,
    gear_ratio: float,
    period_s: float,
    *,
    rest_s: float,
    watch_s: float,
) -> Recording:
    """Rest, move along the trajectory (angle of the motor [rad]), and watch.

    The bench must be at rest at its start. Time is 0 at the start of the move. Raises RunFailed
    when the bench cannot continue, e.g. with an unstable controller.
    """
    before = math.ceil(rest_s / period_s - 1e-9)
    after = math.ceil((trajectory.duration_s + watch_s) / period_s - 1e-9) + 1
    t = period_s * np.arange(-before, after, dtype=np.float64)
    inside = np.clip(t, 0.0, trajectory.duration_s)
    setpoints = np.stack([trajectory.at(inside, order) for order in range(3)], axis=1)
    setpoints[(t < 0.0) | (t >= trajectory.duration_s), 1:] = 0.0
    rows = np.empty((t.size, 4))
    for k, setpoint in enumerate(setpoints.tolist()):
        reading, truth = bench.read(), bench.truth()
        rows[k, :3] = truth.load_angle_rad, truth.load_speed_rad_s, reading.load_acceleration_rad_s2
        _hold(bench, controller.step(MotorSetpoint(*setpoint), reading.motor_angle_rad), period_s)
        rows[k, 3] = bench.truth().applied_torque_n_m
    return Recording(
        t_s=t,
        end_s=trajectory.duration_s,
        reference_rad=setpoints[:, 0] / gear_ratio,
        reference_rad_s=setpoints[:, 1] / gear_ratio,
        load_rad=rows[:, 0],
        load_rad_s=rows[:, 1],
        measured_rad_s=integrated_speed(t, rows[:, 2], before),
        torque_n_m=rows[:, 3],
        integration_error_rad=bench.truth().integration_error_rad,
    )


def _hold(bench: JointPlant, torque_n_m: float, period_s: float) -> None:
    try:
        bench.advance(torque_n_m, period_s)
    except ValueError as error:
        raise RunFailed(f"the simulated joint cannot continue: {error}") from None
