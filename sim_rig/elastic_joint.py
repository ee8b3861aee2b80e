"""The elastic joint as a bench: a torque command in, what encoder and accelerometer say out. No clock, no sockets.

The physics are in joint_motion.py; the parameters, and where they come from, in joint_params.py.
"""

from __future__ import annotations

import math
import random
from typing import NamedTuple

from sim_rig.joint_motion import JointMotion
from sim_rig.joint_params import DisturbancePulse, Joint

FASTEST_SPEED_RAD_S = 1e6  # of the motor; beyond, whatever commands it has lost it


class SensorReading(NamedTuple):
    """What the sensors say."""

    motor_angle_rad: float
    load_acceleration_rad_s2: float  # at the output shaft


class JointTruth(NamedTuple):
    """What is; for tests and studies, never for a controller."""

    t_s: float
    motor_angle_rad: float
    motor_speed_rad_s: float
    load_angle_rad: float  # of the output shaft
    load_speed_rad_s: float
    applied_torque_n_m: float  # the last command, clipped by the drive
    sticking: bool  # dry friction holds the motor
    integration_error_rad: (
        float  # how far motor_angle_rad may be from the exact motion, or may have been before
    )


class ElasticJoint:
    """Motor, gear and load from rest at zero, advanced by torque commands that are held.

    Exact to rounding: Taylor steps whose truncation is below 1e-17 of their largest term, stopped where the friction switches
    or a pulse begins or ends. What rounding does is not assumed but shown by a second motion beside the first: after every step
    it is pushed, always the same way, by twice the rounding unit of the largest term (more where the friction switches).
    integration_error_rad is the largest distance between the two so far, at the ends of samples; against extended precision
    it bounds the error. It stays under 1e-9 rad over a second of the listed rig, ripple and friction on.
    """

    def __init__(self, params: Joint, seed: int = 0) -> None:
        self.params = params
        self._t_s = self._t_missing_s = self._torque_n_m = self._error_rad = 0.0
        self._motion, self._nudged = JointMotion(params), JointMotion(params, nudged=True)
        self._edges_s = sorted(
            {edge for pulse in params.disturbances for edge in (pulse.start_s, pulse.end_s)}
        )
        self._random = random.Random(seed)
        self._noise = self._random.gauss()

    def advance(self, torque_n_m: float, duration_s: float) -> None:
        """Hold a command for a duration >= 0; each call is a sample of the sensors.

        Raises ValueError for numbers that are not finite, a negative duration, and a motor faster than FASTEST_SPEED_RAD_S.
        """
        if not math.isfinite(torque_n_m):
            raise ValueError(
                f"torque_n_m = {torque_n_m}; must be finite: look for a division by zero in the controller"
            )
        if not 0.0 <= duration_s < math.inf:
            raise ValueError(
                f"duration_s = {duration_s}; must be >= 0 and finite: give the sample time"
            )
        limit_n_m = self.params.torque_limit_n_m
        self._torque_n_m = min(max(torque_n_m, -limit_n_m), limit_n_m)
        edges_s = [
            after_s
            for edge_s in self._edges_s
            if self._slack_s < (after_s := self._until_s(edge_s)) < duration_s
        ]
        for begin_s, end_s in zip([0.0, *edges_s], [*edges_s, duration_s], strict=True):
            self._carry(end_s - begin_s)
        self._noise = self._random.gauss()

    def read(self) -> SensorReading:
        """What the sensors say now; reading again says the same."""
        params, angle_rad = self.params, self._motion.angle_rad
        _, load_n_m = self._pulses_n_m()
        seen_rad = angle_rad + params.encoder_ripple_rad * math.sin(
            params.encoder_ripple_cycles_per_rev * angle_rad
        )
        if params.encoder_counts_per_rev:
            count_rad = 2.0 * math.pi / params.encoder_counts_per_rev
            seen_rad = math.floor(seen_rad / count_rad) * count_rad
        error_rad_s2 = (
            params.accelerometer_bias_rad_s2 + params.accelerometer_noise_rad_s2 * self._noise
        )
        return SensorReading(
            seen_rad,
            self._motion.load_acceleration_rad_s2(load_n_m) / params.gear_ratio + error_rad_s2,
        )

    def truth(self) -> JointTruth:
        """What the joint really does now."""
        motion, ratio = self._motion, self.params.gear_ratio
        return JointTruth(
            t_s=self._t_s,
            motor_angle_rad=motion.angle_rad,
            motor_speed_rad_s=motion.speed_rad_s,
            load_angle_rad=(motion.angle_rad - motion.twist_rad) / ratio,
            load_speed_rad_s=motion.load_speed_rad_s / ratio,
            applied_torque_n_m=self._torque_n_m,
            sticking=motion.stuck,
            integration_error_rad=self._error_rad,
        )

    def _carry(self, duration_s: float) -> None:
        """Both motions over a time in which no pulse begins or ends."""
        motor_n_m, load_n_m = self._pulses_n_m()
        for motion in (self._motion, self._nudged):
            motion.carry(self._torque_n_m + motor_n_m, load_n_m, duration_s)
        self._error_rad = max(self._error_rad, abs(self._motion.angle_rad - self._nudged.angle_rad))
        self._pass(duration_s)
        speed_rad_s = abs(self._motion.speed_rad_s)
        if not speed_rad_s <= FASTEST_SPEED_RAD_S:
            raise ValueError(
                f"motor_speed_rad_s = {speed_rad_s:.3g} at t_s = {self._t_s:g}; must be <= {FASTEST_SPEED_RAD_S:g}: "
                "the controller is unstable, or torque_limit_n_m is missing"
            )

    def _pulses_n_m(self) -> tuple[float, float]:
        """Disturbing torques now, on motor and load, both referred to the motor."""
        acting = [pulse for pulse in self.params.disturbances if self._acts(pulse)]
        return sum(p.motor_n_m for p in acting), sum(
            p.load_n_m for p in acting
        ) / self.params.gear_ratio

    def _acts(self, pulse: DisturbancePulse) -> bool:
        return self._until_s(pulse.start_s) <= self._slack_s < self._until_s(pulse.end_s)

    @property
    def _slack_s(self) -> float:
        """An edge so near is now: it and the sum of the samples are rounded."""
        return 4.0 * math.ulp(self._t_s)

    def _until_s(self, instant_s: float) -> float:
        return (instant_s - self._t_s) - self._t_missing_s

    def _pass(self, duration_s: float) -> None:
        """Time goes by; what rounding leaves out is kept (Kahan)."""
        more_s = duration_s + self._t_missing_s
        before_s, self._t_s = self._t_s, self._t_s + more_s
        self._t_missing_s = more_s - (self._t_s - before_s)
