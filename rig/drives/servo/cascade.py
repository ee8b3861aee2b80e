"""Cascade of P control of the position and PI control of the speed.

With feed-forward, a notch filter and a torque limit:

    speed setpoint = N_up (Kpp (qm* - qm) + share qm*')
    torque = N_in (Kpv (1 + 1 / Tiv s) (speed setpoint - speed) + J qm*'')

The notch is N_in (inside the speed loop) or N_up (upstream of it); the other one is 1 (source 001,
notch filter). qm* is the angle of the MotorSetpoint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from rig.drives.servo.block import Block, check_period
from rig.drives.servo.errors import check_datum, check_range
from rig.drives.servo.notch import Notch
from rig.drives.servo.setpoint import MotorSetpoint
from rig.drives.servo.two_mass import TwoMass
from rig.drives.servo.wiring import (
    SETPOINT,
    TORQUES,
    ControlLoop,
    input_disturbance,
    interconnect,
    position_loop,
    rename,
)

NotchPlacement = Literal["inside", "upstream"]  # relative to the speed loop


@dataclass(frozen=True, kw_only=True)
class Cascade:
    """Gains of the cascade; raises ServoError for values out of bounds."""

    speed_gain_n_m_s_rad: float  # Kpv
    reset_time_s: float  # Tiv
    position_gain_1_s: float  # Kpp
    speed_filter_s: float = 0.0  # time constant of the first-order filter on the encoder speed
    torque_limit_n_m: float = math.inf
    speed_feed_forward: float = 1.0  # share of the speed of the setpoint
    feed_forward_inertia_kg_m2: float = 0.0  # times the acceleration of the setpoint

    def __post_init__(self) -> None:
        for name in ("speed_gain_n_m_s_rad", "reset_time_s", "position_gain_1_s"):
            check_datum(name, getattr(self, name))
        check_datum("speed_filter_s", self.speed_filter_s, zero=True)
        check_datum("feed_forward_inertia_kg_m2", self.feed_forward_inertia_kg_m2, zero=True)
        check_range(
            "torque_limit_n_m",
            self.torque_limit_n_m,
            1e-12,
            math.inf,
            "take it from the data sheet of the drive",
        )
        check_range(
            "speed_feed_forward", self.speed_feed_forward, 0.0, 1.0, "1 tracks a ramp without lag"
        )

    @classmethod
    def normalised(
        cls,
        joint: TwoMass,
        speed_loop: float = 1.0,
        position_loop: float = 0.1,
        reset_time: float = 10.0,
        **others: float,
    ) -> Cascade:
        """Compute the gains from omega_cv / omega_z, omega_cp / omega_z and Tiv omega_z.

        Kpv = omega_cv (Jm + Jlr), Kpp = omega_cp; others are further fields of the class. Source
        001 gives its gains in this form but not the inertia; the total inertia Jm + Jlr is
        inferred.
        """
        omega = joint.antiresonance_rad_s
        return cls(
            speed_gain_n_m_s_rad=speed_loop * omega * joint.rigid_inertia_kg_m2,
            reset_time_s=reset_time / omega,
            position_gain_1_s=position_loop * omega,
            **others,
        )

    def speed_loop(self, joint: TwoMass, notch: Notch | None = None) -> ControlLoop:
        """Build the continuous speed loop, with a notch inside it if given.

        Inputs speed_setpoint, motor_torque, load_torque; outputs motor_speed, load_speed.
        """
        import control

        inner = [*self._speed_blocks(notch), _speeds(joint)]
        outputs = ["motor_speed", "load_speed"]
        closed = interconnect([*inner, input_disturbance()], ["speed_setpoint", *TORQUES], outputs)
        forward = interconnect(inner, ["speed_setpoint", "torque"], ["drive_torque"])
        return ControlLoop(
            -control.ss(forward["drive_torque", "torque"]), closed, "speed_setpoint", "motor_speed"
        )

    def position_loop(
        self, joint: TwoMass, notch: Notch | None = None, where: NotchPlacement = "inside"
    ) -> ControlLoop:
        """Build the continuous position loop.

        Inputs: those of the MotorSetpoint, motor_torque, load_torque; outputs: motor_angle,
        motor_speed, load_angle, load_speed.
        """
        inside, upstream = _split_notch(notch, where)
        return position_loop(
            joint,
            [*self._speed_blocks(inside), *self._position_blocks(upstream and upstream.system)],
        )

    def sampled(
        self, period_s: float, notch: Notch | None = None, where: NotchPlacement = "inside"
    ) -> Any:
        """Build the CascadeController without torque limit as control.StateSpace.

        From the MotorSetpoint and motor_angle to drive_torque. Raises ServoError for a sample time
        out of bounds, BeyondNyquist for a notch at or above the Nyquist frequency.
        """
        import control

        check_period(period_s)
        inside, upstream = (n and n.sampled(period_s) for n in _split_notch(notch, where))
        a, kp = _filter_pole(self.speed_filter_s, period_s), self.speed_gain_n_m_s_rad
        share = (1.0 - a) / period_s
        ki = kp * period_s / self.reset_time_s
        encoder = control.ss(
            a, 1.0, share * (a - 1.0), share, period_s, inputs="motor_angle", outputs="speed"
        )
        pi = control.ss(1.0, ki, 1.0, kp + ki, period_s, inputs="speed_error", outputs="pi_torque")
        blocks = [encoder, pi, *self._torque_blocks(inside), *self._position_blocks(upstream)]
        return interconnect(blocks, [*SETPOINT, "motor_angle"], ["drive_torque"])

    def _speed_blocks(self, notch: Notch | None) -> list[Any]:
        """Build the continuous blocks from speed to torque."""
        import control

        kp, ki = self.speed_gain_n_m_s_rad, self.speed_gain_n_m_s_rad / self.reset_time_s
        lag = control.tf([1.0], [self.speed_filter_s, 1.0]) if self.speed_filter_s else None
        encoder = rename(lag, "motor_speed", "speed")
        pi = control.ss(0.0, ki, 1.0, kp, inputs="speed_error", outputs="pi_torque")
        return [encoder, pi, *self._torque_blocks(notch and notch.system)]

    def _torque_blocks(self, notch: Any | None) -> list[Any]:
        """Build the blocks from speed error to torque, with a notch if given."""
        import control

        j = self.feed_forward_inertia_kg_m2
        inputs = ["pi_torque", "setpoint_acceleration"]
        return [
            control.summing_junction(["speed_setpoint", "-speed"], "speed_error"),
            control.ss([], [], [], [[1.0, j]], inputs=inputs, outputs="controller_torque"),
            rename(notch, "controller_torque", "drive_torque"),
        ]

    def _position_blocks(self, notch: Any | None) -> list[Any]:
        """Build the blocks from angle error to speed setpoint, with a notch if given."""
        import control

        gains = [[self.position_gain_1_s, self.speed_feed_forward]]
        inputs = ["angle_error", "setpoint_speed"]
        return [
            control.summing_junction(["setpoint_angle", "-motor_angle"], "angle_error"),
            control.ss([], [], [], gains, inputs=inputs, outputs="unfiltered_speed_setpoint"),
            rename(notch, "unfiltered_speed_setpoint", "speed_setpoint"),
        ]


class CascadeController:
    """Sampled cascade; a DriveController.

    The speed is the difference of two encoder angles, then filtered. Anti-windup: while the torque
    is limited, the integrator accepts no error that would drive it further into the limit.
    """

    def __init__(
        self,
        design: Cascade,
        period_s: float,
        notch: Notch | None = None,
        where: NotchPlacement = "inside",
    ) -> None:
        """Sample the design.

        Raises ServoError for a sample time out of bounds, BeyondNyquist for a notch at or above the
        Nyquist frequency.
        """
        check_period(period_s)
        self.design = design
        self.period_s = period_s
        self._notch = (notch, where)
        self._filter_pole = _filter_pole(design.speed_filter_s, period_s)
        self._integral_gain = design.speed_gain_n_m_s_rad * period_s / design.reset_time_s
        self._inside, self._upstream = (
            n and Block(n.sampled(period_s)) for n in _split_notch(notch, where)
        )
        self.reset()

    def step(self, setpoint: MotorSetpoint, motor_angle_rad: float) -> float:
        """Compute the torque [N m] to hold until the next sample."""
        d = self.design
        speed_setpoint = (
            d.position_gain_1_s * (setpoint.angle_rad - motor_angle_rad)
            + d.speed_feed_forward * setpoint.speed_rad_s
        )
        if self._upstream:
            speed_setpoint = self._upstream.step(speed_setpoint)
        error = speed_setpoint - self._speed(motor_angle_rad)
        increment = self._integral_gain * error
        torque = d.speed_gain_n_m_s_rad * error + self._integral + increment
        torque += d.feed_forward_inertia_kg_m2 * setpoint.acceleration_rad_s2
        if self._inside:
            torque = self._inside.step(torque)
        limited = min(max(torque, -d.torque_limit_n_m), d.torque_limit_n_m)
        if limited == torque or increment * torque < 0.0:
            self._integral += increment
        return limited

    def reset(self) -> None:
        """Set the state to rest at angle 0."""
        self._integral = self._last_angle = self._last_speed = 0.0
        for block in (self._inside, self._upstream):
            if block:
                block.reset()

    @cached_property
    def system(self) -> Any:
        """Linear system, see DriveController."""
        return self.design.sampled(self.period_s, *self._notch)

    def _speed(self, motor_angle_rad: float) -> float:
        raw = (motor_angle_rad - self._last_angle) / self.period_s
        self._last_angle = motor_angle_rad
        self._last_speed = raw + self._filter_pole * (self._last_speed - raw)
        return self._last_speed


def _split_notch(notch: Notch | None, where: NotchPlacement) -> tuple[Notch | None, Notch | None]:
    """Sort a notch into (inside, upstream); the other one is None."""
    return (notch, None) if where == "inside" else (None, notch)


def _filter_pole(filter_s: float, period_s: float) -> float:
    return math.exp(-period_s / filter_s) if filter_s else 0.0


def _speeds(joint: TwoMass) -> Any:
    """Build the joint without its pole at 0: states qm', n ql' and qm - n ql."""
    import control

    a, b = joint.state_matrix, joint.input_matrix
    return control.ss(
        [[a[1, 1], a[1, 3], a[1, 0]], [a[3, 1], a[3, 3], a[3, 0]], [1.0, -1.0, 0.0]],
        [b[1], b[3], [0.0, 0.0]],
        np.eye(2, 3),
        np.zeros((2, 2)),
        inputs=["torque", "load_torque"],
        outputs=["motor_speed", "load_speed"],
    )
