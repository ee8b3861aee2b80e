"""Servos of the simulated Quattro: four cascades of position and speed, sampled at 1 kHz.

A second-order filter turns each setpoint step into a smooth reference; its bandwidth gives the
response of the robot, while the loops behind it are several times faster. So gravity, friction and
load disturb the motion little, and speed and acceleration for the feed-forward are known exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sim_rig import params as bench_params
from sim_rig.quattro_geometry import (
    JointAngles,
    LegGeometry,
    PlatePose,
    joint_angles,
    nominal_legs,
    pose_of,
    rate_matrix,
)
from sim_rig.quattro_params import QuattroParams
from sim_rig.robot import ServoLoop

SAMPLE_NS = 1_000_000
SAMPLE_S = SAMPLE_NS * 1e-9
REST_RAD = 1e-9  # a reference closer to its setpoint, and slower, is at rest
REST_RAD_S = 1e-9


class QuattroServos:
    """Controllers of the four joints, with the nominal geometry and the payload known.

    torque = J (acceleration) + gravity + viscous friction x speed
             + speed gain x (speed error + its integral / reset time)
    speed command = reference speed + position gain x position error, limited
    """

    def __init__(self, params: QuattroParams, payload_kg: float, pose: PlatePose) -> None:
        """pose: nominal pose at the start, at rest."""
        self._params = params
        self._legs: tuple[LegGeometry, ...] = nominal_legs(params)
        self._masses_kg = np.full(4, params.moving_mass_kg + payload_kg)
        self._masses_kg[3] = params.turning_inertia_kg_m2
        robot = bench_params.RobotParams(bandwidth_hz=params.bandwidth_hz, damping=params.damping)
        self._filter = ServoLoop(robot).propagator(SAMPLE_S)
        self._pose = pose
        self._setpoint = self._reference = self._last = joint_angles(self._legs, pose)
        self._speeds = [0.0] * len(self._legs)
        self._integrals_n_m = [0.0] * len(self._legs)
        self._set_feed_forward()

    def set_position(self, pose: PlatePose) -> bool:
        """Set the setpoint of a nominal pose; return whether it changed."""
        return self._set(joint_angles(self._legs, pose), pose)

    def set_joints(self, joints_rad: Sequence[float]) -> bool:
        """Set the setpoint of the joints; return whether it changed.

        Raises ValueError for angles at which the forearms do not reach the plate.
        """
        q0, q1, q2, q3 = joints_rad
        joints = (q0, q1, q2, q3)
        if joints == self._setpoint:
            return False
        return self._set(joints, pose_of(self._legs, joints, self._pose))

    @property
    def holding_torques_n_m(self) -> JointAngles:
        """Torques that hold the nominal robot at the setpoint."""
        g0, g1, g2, g3 = self._gravity_n_m
        return g0, g1, g2, g3

    @property
    def settled(self) -> bool:
        """True if all references are at rest at their setpoints."""
        gaps = zip(self._reference, self._setpoint, self._speeds, strict=True)
        return all(abs(q - end) < REST_RAD and abs(v) < REST_RAD_S for q, end, v in gaps)

    def setpoint_error_rad(self, joints_rad: Sequence[float]) -> float:
        """Compute the largest distance of joints from their setpoints."""
        return max(abs(q - end) for q, end in zip(joints_rad, self._setpoint, strict=True))

    def torques(self, joints_rad: Sequence[float], rates_rad_s: Sequence[float]) -> JointAngles:
        """Compute the motor torques [N m] of a sample from encoder readings."""
        params = self._params
        before, past = self._reference, self._last
        accelerations, speeds = self._advance_reference()
        torques = []
        for i, row in enumerate(self._inertia_kg_m2):
            r0, r1, r2, r3 = row
            a0, a1, a2, a3 = accelerations
            torque = r0 * a0 + r1 * a1 + r2 * a2 + r3 * a3 + self._gravity_n_m[i]
            torque += params.viscous_n_m_s_rad * speeds[i]
            command = params.position_gain_1_s * (before[i] - joints_rad[i])
            command += (before[i] - past[i]) / SAMPLE_S  # as the encoder reads the speed
            error = _limited(command, params.speed_limit_rad_s) - rates_rad_s[i]
            torques.append(self._limit_torque(i, torque, error, rates_rad_s[i]))
        return torques[0], torques[1], torques[2], torques[3]

    def _limit_torque(
        self, index: int, feed_forward_n_m: float, error_rad_s: float, rate_rad_s: float
    ) -> float:
        """Add the speed controller; the integral is held while the torque is limited.

        A motor at its largest speed gives no torque that raises it.
        """
        params = self._params
        proportional = params.speed_gain_n_m_s_rad * error_rad_s
        integral = self._integrals_n_m[index] + proportional * SAMPLE_S / params.reset_time_s
        wanted = feed_forward_n_m + proportional + integral
        torque = _limited(wanted, params.torque_limit_n_m)
        if abs(rate_rad_s) >= params.speed_limit_rad_s and torque * rate_rad_s > 0.0:
            torque = 0.0
        if torque == wanted:
            self._integrals_n_m[index] = integral
        return torque

    def _set(self, joints_rad: JointAngles, pose: PlatePose) -> bool:
        if joints_rad == self._setpoint:
            return False
        self._setpoint, self._pose = joints_rad, pose
        self._set_feed_forward()
        return True

    def _set_feed_forward(self) -> None:
        """Compute inertia matrix and gravity torques at the setpoint.

        With the rate matrix R: I + R^-T M R^-1, and R^-T (weight) minus the torque of the arms.
        """
        params = self._params
        inverse = np.linalg.inv(rate_matrix(self._legs, self._pose))
        inertia = inverse.T @ (self._masses_kg[:, None] * inverse)
        inertia += params.joint_inertia_kg_m2 * np.eye(len(self._legs))
        self._inertia_kg_m2: list[list[float]] = inertia.tolist()
        weight_n = self._masses_kg[2] * params.gravity_m_s2
        arms_n_m = params.gravity_m_s2 * params.arm_moment_kg_m * np.cos(self._setpoint)
        self._gravity_n_m: list[float] = (weight_n * inverse[2] - arms_n_m).tolist()

    def _advance_reference(self) -> tuple[list[float], list[float]]:
        """Advance the references by a sample; return mean accelerations and mean speeds."""
        ee, ev, ve, vv = self._filter
        accelerations, means, moved, speeds = [], [], [], []
        for q, end, speed in zip(self._reference, self._setpoint, self._speeds, strict=True):
            error = q - end
            new_q, new_speed = end + ee * error + ev * speed, ve * error + vv * speed
            accelerations.append((new_speed - speed) / SAMPLE_S)
            means.append((new_q - q) / SAMPLE_S)
            moved.append(new_q)
            speeds.append(new_speed)
        self._last = self._reference
        self._reference = (moved[0], moved[1], moved[2], moved[3])
        self._speeds = speeds
        return accelerations, means


def encoder_angles(joints_rad: JointAngles, count_rad: float) -> JointAngles:
    """Round joint angles down to the steps of the encoders; 0 = no steps."""
    if count_rad == 0.0:
        return joints_rad
    q0, q1, q2, q3 = (math.floor(q / count_rad) * count_rad for q in joints_rad)
    return q0, q1, q2, q3


def _limited(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
