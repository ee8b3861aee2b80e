"""Sampled torque disturbance observer, and a controller combined with one."""

from __future__ import annotations

import math
from typing import Any

from rig.drives.servo.block import Block, check_period, discretise
from rig.drives.servo.disturbance_design import ObserverDesign
from rig.drives.servo.errors import check_below_nyquist, check_range
from rig.drives.servo.setpoint import DriveController, MotorSetpoint
from rig.drives.servo.wiring import SETPOINT, interconnect


class DisturbanceObserver:
    """Observer at a sample time, by the bilinear transform.

    The speed is the difference of two angles, i.e. its mean while the torque was held: with the
    bilinear transform that is exact for a rigid load without friction. An angle belongs to the end
    of that time, so the torque is led by half a sample. The estimate acts one sample later: the
    loop behaves like the continuous one with a time constant longer by the sample time.
    """

    def __init__(self, design: ObserverDesign, period_s: float) -> None:
        """Sample the design.

        Raises ServoError for a sample time out of bounds, BeyondNyquist for a Q whose corner
        frequency is at or above the Nyquist frequency.
        """
        check_period(period_s)
        corner = 1.0 / design.low_pass.time_constant_s
        check_below_nyquist(
            "1 / time_constant_s",
            corner,
            period_s,
            "reduce the sample time, or use a longer time constant",
        )
        self.design, self.period_s = design, period_s
        self._difference = design.measured == "speed"
        lead_s = 0.0 if self._difference else period_s / 2.0
        self._block = Block(discretise(design.estimator(lead_s), period_s))
        self._last_angle = 0.0

    def step(self, torque_n_m: float, motor_angle_rad: float) -> float:
        """Compute the torque [N m] to add to that of the controller.

        From the torque applied since the last sample and the encoder angle of this sample, or the
        output of the plant if the design measures that.
        """
        if not self._difference:
            return self._block.step(torque_n_m, motor_angle_rad)
        speed = (motor_angle_rad - self._last_angle) / self.period_s
        self._last_angle = motor_angle_rad
        return self._block.step(torque_n_m, speed)

    def reset(self) -> None:
        """Set the state to rest at angle 0."""
        self._block.reset()
        self._last_angle = 0.0

    @property
    def system(self) -> Any:
        """control.StateSpace from applied_before and motor_angle to added_torque."""
        import control

        if not self._difference:
            return control.ss(
                self._block.system, inputs=["applied_before", "motor_angle"], outputs="added_torque"
            )
        t = self.period_s
        difference = control.ss(
            0.0, 1.0, -1.0 / t, 1.0 / t, t, inputs="motor_angle", outputs="speed"
        )
        block = control.ss(
            self._block.system, inputs=["applied_before", "speed"], outputs="added_torque"
        )
        return interconnect(
            [difference, block], ["applied_before", "motor_angle"], ["added_torque"]
        )


class Compensated:
    """DriveController with a disturbance observer; a DriveController itself.

    The observer receives the torque applied, i.e. after the limit.
    """

    def __init__(
        self,
        controller: DriveController,
        observer: DisturbanceObserver,
        torque_limit_n_m: float = math.inf,
    ) -> None:
        """Combine both; raises ServoError for a limit that is not > 0."""
        check_range(
            "torque_limit_n_m",
            torque_limit_n_m,
            1e-12,
            math.inf,
            "take it from the data sheet of the drive",
        )
        self.controller = controller
        self.observer = observer
        self.torque_limit_n_m = torque_limit_n_m
        self._applied = 0.0

    def step(self, setpoint: MotorSetpoint, motor_angle_rad: float) -> float:
        """Compute the torque [N m] to hold until the next sample."""
        added = self.observer.step(self._applied, motor_angle_rad)
        total = self.controller.step(setpoint, motor_angle_rad) + added
        self._applied = min(max(total, -self.torque_limit_n_m), self.torque_limit_n_m)
        return self._applied

    def reset(self) -> None:
        """Set the state to rest at angle 0."""
        self.controller.reset()
        self.observer.reset()
        self._applied = 0.0

    @property
    def system(self) -> Any:
        """Linear system, see DriveController."""
        import control

        controller = control.ss(
            self.controller.system, inputs=[*SETPOINT, "motor_angle"], outputs="controller_torque"
        )
        delay = control.ss(
            0.0,
            1.0,
            1.0,
            0.0,
            self.observer.period_s,
            inputs="drive_torque",
            outputs="applied_before",
        )
        total = control.summing_junction(["controller_torque", "added_torque"], "drive_torque")
        return interconnect(
            [controller, self.observer.system, delay, total],
            [*SETPOINT, "motor_angle"],
            ["drive_torque"],
        )
