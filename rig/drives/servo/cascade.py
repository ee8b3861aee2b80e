"""P on position around PI on speed, as most drives have it, with feed-forward, a notch filter and a torque limit.

    speed setpoint = N_up (Kpp (qm* - qm) + share qm*')
    torque = N_in (Kpv (1 + 1 / Tiv s) (speed setpoint - speed) + J qm*'')

with a notch as N_in, inside the speed loop, or as N_up, upstream of it (source 001, notch filter); qm* is the Setpoint's.
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

NotchPlacement = Literal["inside", "upstream"]  # of the speed loop


@dataclass(frozen=True, kw_only=True)
class Cascade:
    """Gains of the cascade. Raises ServoError for values out of bounds."""

    speed_gain_n_m_s_rad: float  # Kpv
    reset_time_s: float  # Tiv
    position_gain_1_s: float  # Kpp
    speed_filter_s: float = 0.0  # first-order, on the speed taken from the encoder
    torque_limit_n_m: float = math.inf
    speed_feed_forward: float = 1.0  # share of the setpoint's speed
    feed_forward_inertia_kg_m2: float = 0.0  # times the setpoint's acceleration

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
            "take it from the drive's data sheet",
        )
        check_range(
            "speed_feed_forward", self.speed_feed_forward, 0.0, 1.0, "1 follows a ramp without lag"
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
        """By omega_cv / omega_z, omega_cp / omega_z and Tiv omega_z: Kpv = omega_cv (Jm + Jlr), Kpp = omega_cp.

        Source 001 gives its gains so without saying which inertia it means; the rigid one is inferred. others are fields.
        """
        omega = joint.antiresonance_rad_s
        return cls(
            speed_gain_n_m_s_rad=speed_loop * omega * joint.rigid_inertia_kg_m2,
            reset_time_s=reset_time / omega,
            position_gain_1_s=position_loop * omega,
            **others,
        )

    def speed_loop(self, joint: TwoMass, notch: Notch | None = None) -> ControlLoop:
        """Continuous, with a notch inside if given: speed_setpoint, motor_torque, load_torque to motor_speed, load_speed."""
        import control

        inner = [*self._inner(notch), _speeds(joint)]
        outputs = ["motor_speed", "load_speed"]
        closed = interconnect([*inner, input_disturbance()], ["speed_setpoint", *TORQUES], outputs)
        forward = interconnect(inner, ["speed_setpoint", "torque"], ["drive_torque"])
        return ControlLoop(
            -control.ss(forward["drive_torque", "torque"]), closed, "speed_setpoint", "motor_speed"
        )

    def position_loop(
        self, joint: TwoMass, notch: Notch | None = None, where: NotchPlacement = "inside"
    ) -> ControlLoop:
        """Continuous: the Setpoint, motor_torque, load_torque to motor_angle, motor_speed, load_angle, load_speed."""
        inside, upstream = _placed(notch, where)
        return position_loop(
            joint, [*self._inner(inside), *self._outer(upstream and upstream.system)]
        )

    def sampled(
        self, period_s: float, notch: Notch | None = None, where: NotchPlacement = "inside"
    ) -> Any:
        """CascadeController as control.StateSpace, without the torque limit: from the Setpoint and motor_angle to drive_torque.

        Raises ServoError for a sample time out of bounds, BeyondNyquist for a notch that it cannot hold.
        """
        import control

        check_period(period_s)
        inside, upstream = (n and n.sampled(period_s) for n in _placed(notch, where))
        a, kp = _filter_pole(self.speed_filter_s, period_s), self.speed_gain_n_m_s_rad
        share = (1.0 - a) / period_s
        ki = kp * period_s / self.reset_time_s
        encoder = control.ss(
            a, 1.0, share * (a - 1.0), share, period_s, inputs="motor_angle", outputs="speed"
        )
        pi = control.ss(1.0, ki, 1.0, kp + ki, period_s, inputs="speed_error", outputs="pi_torque")
        blocks = [encoder, pi, *self._torques(inside), *self._outer(upstream)]
        return interconnect(blocks, [*SETPOINT, "motor_angle"], ["drive_torque"])

    def _inner(self, notch: Notch | None) -> list[Any]:
        """Speed to torque, continuous."""
        import control

        kp, ki = self.speed_gain_n_m_s_rad, self.speed_gain_n_m_s_rad / self.reset_time_s
        lag = control.tf([1.0], [self.speed_filter_s, 1.0]) if self.speed_filter_s else None
        encoder = rename(lag, "motor_speed", "speed")
        pi = control.ss(0.0, ki, 1.0, kp, inputs="speed_error", outputs="pi_torque")
        return [encoder, pi, *self._torques(notch and notch.system)]

    def _torques(self, notch: Any | None) -> list[Any]:
        import control

        j = self.feed_forward_inertia_kg_m2
        return [
            control.summing_junction(["speed_setpoint", "-speed"], "speed_error"),
            control.ss(
                [],
                [],
                [],
                [[1.0, j]],
                inputs=["pi_torque", "setpoint_acceleration"],
                outputs="wanted_torque",
            ),
            rename(notch, "wanted_torque", "drive_torque"),
        ]

    def _outer(self, notch: Any | None) -> list[Any]:
        import control

        gains = [[self.position_gain_1_s, self.speed_feed_forward]]
        return [
            control.summing_junction(["setpoint_angle", "-motor_angle"], "angle_error"),
            control.ss(
                [], [], [], gains, inputs=["angle_error", "setpoint_speed"], outputs="speed_wish"
            ),
            rename(notch, "speed_wish", "speed_setpoint"),
        ]


class CascadeController:
    """The cascade at a sample time; a Controller.

    The speed is the difference of two angles, then filtered. While the torque is limited, the integrator takes no error that
    would drive it further.
    """

    def __init__(
        self,
        design: Cascade,
        period_s: float,
        notch: Notch | None = None,
        where: NotchPlacement = "inside",
    ) -> None:
        """Raises ServoError for a sample time out of bounds, BeyondNyquist for a notch that it cannot hold."""
        check_period(period_s)
        self.design, self.period_s, self._notch = design, period_s, (notch, where)
        self._filter_pole = _filter_pole(design.speed_filter_s, period_s)
        self._integral_gain = design.speed_gain_n_m_s_rad * period_s / design.reset_time_s
        self._inside, self._upstream = (
            n and Block(n.sampled(period_s)) for n in _placed(notch, where)
        )
        self.reset()

    def step(self, setpoint: MotorSetpoint, motor_angle_rad: float) -> float:
        """Torque [N m] to hold until the next sample."""
        d = self.design
        wish = (
            d.position_gain_1_s * (setpoint.angle_rad - motor_angle_rad)
            + d.speed_feed_forward * setpoint.speed_rad_s
        )
        if self._upstream:
            wish = self._upstream.step(wish)
        error = wish - self._speed(motor_angle_rad)
        push = self._integral_gain * error
        torque = d.speed_gain_n_m_s_rad * error + self._integral + push
        torque += d.feed_forward_inertia_kg_m2 * setpoint.acceleration_rad_s2
        if self._inside:
            torque = self._inside.step(torque)
        limited = min(max(torque, -d.torque_limit_n_m), d.torque_limit_n_m)
        if limited == torque or push * torque < 0.0:
            self._integral += push
        return limited

    def reset(self) -> None:
        """Back to rest at 0."""
        self._integral = self._last_angle = self._last_speed = 0.0
        for block in (self._inside, self._upstream):
            if block:
                block.reset()

    @cached_property
    def system(self) -> Any:
        """See Controller."""
        return self.design.sampled(self.period_s, *self._notch)

    def _speed(self, motor_angle_rad: float) -> float:
        raw = (motor_angle_rad - self._last_angle) / self.period_s
        self._last_angle = motor_angle_rad
        self._last_speed = raw + self._filter_pole * (self._last_speed - raw)
        return self._last_speed


def _placed(notch: Notch | None, where: NotchPlacement) -> tuple[Notch | None, Notch | None]:
    """(inside, upstream)"""
    return (notch, None) if where == "inside" else (None, notch)


def _filter_pole(filter_s: float, period_s: float) -> float:
    return math.exp(-period_s / filter_s) if filter_s else 0.0


def _speeds(joint: TwoMass) -> Any:
    """The joint without the pole of its angle: states qm', n ql' and qm - n ql."""
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
