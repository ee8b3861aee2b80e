"""Friction compensation from the estimate of a disturbance observer.

    s(w, b) = sign(w) clip(|w| / b - 1, 0, 1)          direction, 0 in the deadband |w| <= b
    d^      = Q u - Q Pn^-1 w                          torque to add, by the observer
    r       = Q s(w, w_d)                              direction, as late as the estimate
    F^'     = r (d^ - r F^) / T_F,   0 <= F^ <= F_max  dry friction
    torque added = F^ s(w*, SETPOINT_DEADBAND_SHARE w_d)

w is the speed of the encoder, w* that of the setpoint, which has no noise. In motion F^ is the
estimate of the observer, low-passed with T_F; at a reversal the torque changes its sign with the
setpoint, where the observer alone is late by Q. Inside the deadband nothing is learnt and nothing
is added: at standstill the compensation is no feedback, so it adds no limit cycle. The torque never
exceeds F_max.

The adaptation is the gradient method with a filtered regressor (Astrom and Wittenmark 1995,
Adaptive Control); the use of the setpoint's direction is common (Armstrong-Helouvry, Dupont and
Canudas de Wit 1994). The combination of both with the observer is ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rig.drives.servo.block import Block, discretise
from rig.drives.servo.disturbance_design import ObserverDesign
from rig.drives.servo.disturbance_observer import DisturbanceObserver
from rig.drives.servo.errors import ServoError, check_datum, check_range
from rig.drives.servo.setpoint import DriveController, MotorSetpoint
from rig.drives.servo.wiring import SETPOINT, interconnect

# narrower than that of the encoder: a torque that ends before the motion does excites the load
SETPOINT_DEADBAND_SHARE = 0.2


@dataclass(frozen=True, kw_only=True)
class FrictionDesign:
    """Observer, time constant of the adaptation, deadband and bound of the compensation.

    Raises ServoError for values out of bounds, and for an observer that does not measure a speed.
    """

    observer: ObserverDesign
    time_constant_s: float  # T_F
    deadband_rad_s: float  # w_d at the motor; more than one encoder step per sample
    max_torque_n_m: float  # F_max

    def __post_init__(self) -> None:
        for name in ("time_constant_s", "deadband_rad_s", "max_torque_n_m"):
            check_datum(name, getattr(self, name))
        if self.observer.measured != "speed":
            raise ServoError(
                f"observer measures {self.observer.measured!r}; must be 'speed': the direction of "
                "the friction is that of the motor"
            )


def direction(speed_rad_s: float, deadband_rad_s: float) -> float:
    """Compute s(w, b): -1 to 1, 0 in the deadband, -1 or 1 from twice its width on."""
    share = abs(speed_rad_s) / deadband_rad_s - 1.0
    return math.copysign(min(max(share, 0.0), 1.0), speed_rad_s)


class FrictionCompensated:
    """DriveController with friction compensation; a DriveController itself.

    The torque of the controller and the compensation together keep the torque limit. An observer
    inside the controller sees the compensation as a torque that balances the friction.
    """

    def __init__(
        self,
        controller: DriveController,
        design: FrictionDesign,
        period_s: float,
        torque_limit_n_m: float = math.inf,
        setpoint_filter: Any | None = None,
    ) -> None:
        """Sample the design.

        setpoint_filter is the continuous control.TransferFunction from the setpoint to the angle
        that the motor is to follow, e.g. F0; none by default. Raises ServoError for a limit that is
        not > 0 and for a sample time out of bounds, BeyondNyquist for a Q whose corner frequency is
        at or above the Nyquist frequency.
        """
        check_range(
            "torque_limit_n_m",
            torque_limit_n_m,
            1e-12,
            math.inf,
            "take it from the data sheet of the drive",
        )
        self.controller = controller
        self.design = design
        self._limit_n_m = torque_limit_n_m
        self._setpoint_deadband_rad_s = SETPOINT_DEADBAND_SHARE * design.deadband_rad_s
        self._period_s = period_s
        self._observer = DisturbanceObserver(design.observer, period_s)
        self._regressor = _low_pass_block(design.observer, period_s)
        self._setpoint_filter = None
        if setpoint_filter is not None:
            self._setpoint_filter = Block(discretise(setpoint_filter, period_s))
        self._gain = -math.expm1(-period_s / design.time_constant_s)
        self.reset()

    @property
    def friction_n_m(self) -> float:
        """Present estimate F^ of the dry friction."""
        return self._friction_n_m

    def step(self, setpoint: MotorSetpoint, motor_angle_rad: float) -> float:
        """Compute the torque [N m] to hold until the next sample."""
        self._adapt(motor_angle_rad)
        wanted_rad_s = setpoint.speed_rad_s
        if self._setpoint_filter:
            wanted_rad_s = self._setpoint_filter.step(wanted_rad_s)
        added = self._friction_n_m * direction(wanted_rad_s, self._setpoint_deadband_rad_s)
        total = self.controller.step(setpoint, motor_angle_rad) + added
        self._applied = min(max(total, -self._limit_n_m), self._limit_n_m)
        return self._applied

    def reset(self) -> None:
        """Set the state to rest at angle 0, the estimate to 0."""
        self.controller.reset()
        self._observer.reset()
        self._regressor.reset()
        if self._setpoint_filter:
            self._setpoint_filter.reset()
        self._applied = self._last_angle = self._friction_n_m = 0.0

    @property
    def system(self) -> Any:
        """Linear system, see DriveController: that of the controller, as at standstill."""
        return self.controller.system

    @property
    def moving_system(self) -> Any:
        """Linear system beyond the deadband while no bound is active.

        The compensation is then a disturbance observer with Q / (1 + s T_F).
        """
        import control

        t, gain = self._period_s, self._gain
        controller = control.ss(
            self.controller.system, inputs=[*SETPOINT, "motor_angle"], outputs="controller_torque"
        )
        observer = control.ss(
            self._observer.system, inputs=["applied_before", "motor_angle"], outputs="estimate"
        )
        low_pass = control.ss(
            1.0 - gain, gain, 1.0 - gain, gain, t, inputs="estimate", outputs="added_torque"
        )
        delay = control.ss(0.0, 1.0, 1.0, 0.0, t, inputs="drive_torque", outputs="applied_before")
        total = control.summing_junction(["controller_torque", "added_torque"], "drive_torque")
        blocks = [controller, observer, low_pass, delay, total]
        return interconnect(blocks, [*SETPOINT, "motor_angle"], ["drive_torque"])

    def _adapt(self, motor_angle_rad: float) -> None:
        """Adapt F^ by one sample."""
        estimate = self._observer.step(self._applied, motor_angle_rad)
        speed_rad_s = (motor_angle_rad - self._last_angle) / self._period_s
        self._last_angle = motor_angle_rad
        regressor = self._regressor.step(direction(speed_rad_s, self.design.deadband_rad_s))
        error = estimate - regressor * self._friction_n_m
        friction_n_m = self._friction_n_m + self._gain * regressor * error
        self._friction_n_m = min(max(friction_n_m, 0.0), self.design.max_torque_n_m)


def _low_pass_block(design: ObserverDesign, period_s: float) -> Block:
    """Sample Q alone."""
    import control

    return Block(discretise(control.tf([1.0], design.low_pass.denominator), period_s))
