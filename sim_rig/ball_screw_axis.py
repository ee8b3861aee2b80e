"""Ball-screw axis with its sensors: encoder, linear scale and end switches from torque commands.

The equations of motion are in ball_screw_motion.py, the parameters and their source in
ball_screw_params.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_rig.ball_screw_motion import STEP_ROUNDING_REL, ScrewMotion
from sim_rig.ball_screw_params import BallScrewParams
from sim_rig.ball_screw_series import ScrewState

MAX_SCREW_SPEED_RAD_S = 1e6  # beyond, the controller is unstable


class AxisReading(NamedTuple):
    """Readings of the sensors."""

    motor_angle_rad: float
    table_position_m: float | None  # None without a linear scale
    negative_switch: bool  # closed
    positive_switch: bool


class AxisTruth(NamedTuple):
    """State of the simulated axis; for tests and studies, not for a controller."""

    t_s: float
    motor_angle_rad: float
    motor_speed_rad_s: float
    position_m: float
    velocity_m_s: float
    acceleration_m_s2: float  # under the torque and force of the last sample
    applied_torque_n_m: float  # behind limit and lag
    sticking: bool  # dry friction holds motor and table
    # bound of the error of position_m and of tau x motor_angle_rad, over all samples so far
    integration_error_m: float
    overspeed: bool  # speed_limit_m_s was exceeded at the end of a sample; stays set
    at_stop: bool  # the table touches an end stop


class BallScrewAxis:
    """Motor, screw and table, at rest at start_m at first; each torque is held over its sample.

    Exact to rounding: matrix exponentials while motor and table slide, Taylor steps whose
    truncation is below 1e-17 of their largest term otherwise, stopped at each switch of friction,
    sign of the nut force and stops. The effect of rounding is measured as in ElasticJoint, with a
    second motion displaced after every step, always in the same direction, by twice the rounding
    unit of the largest term (more at a switch). integration_error_m is the largest difference of
    the two so far, and the rounding of the position; compared with extended precision it bounds
    the error.
    """

    def __init__(self, params: BallScrewParams, *, measures_error: bool = True) -> None:
        """measures_error: False saves the second motion; integration_error_m is then 0."""
        self.params = params
        self._t_s = 0.0
        self._t_rest_s = 0.0  # rounding error of the sum of the samples (Kahan)
        self._error_m = 0.0
        self._overspeed = False
        self._tau_m_rad = params.tau_m_rad
        self._motion = ScrewMotion(params)
        self._perturbed = ScrewMotion(params, perturbed=True) if measures_error else None

    def advance(self, torque_n_m: float, duration_s: float, force_n: float = 0.0) -> None:
        """Hold a torque command [N m] and a force on the table along +X [N] for a duration >= 0.

        Raises ValueError for numbers that are not finite, a negative duration, and a motor faster
        than MAX_SCREW_SPEED_RAD_S.
        """
        _check_finite("torque_n_m", torque_n_m, "look for a division by zero in the controller")
        _check_finite("force_n", force_n, "look for a division by zero in the load")
        if not 0.0 <= duration_s < math.inf:
            raise ValueError(
                f"duration_s = {duration_s}; must be >= 0 and finite: give the sample time"
            )
        limit_n_m = self.params.torque_limit_n_m
        command_n_m = min(max(float(torque_n_m), -limit_n_m), limit_n_m)
        force_n, duration_s = float(force_n), float(duration_s)  # numpy's scalars are slower
        self._motion.advance(command_n_m, force_n, duration_s)
        if self._perturbed is not None:
            self._perturbed.advance(command_n_m, force_n, duration_s)
        self._add_time(duration_s)
        self._measure()

    def read(self) -> AxisReading:
        """Read the sensors; a second reading at the same time is the same.

        Encoder and scale round down to their last step.
        """
        params = self.params
        state = self._motion.state
        angle_rad = state.motor_angle_rad
        if params.encoder_counts_per_rev:
            angle_rad = _round_down(angle_rad, 2.0 * math.pi / params.encoder_counts_per_rev)
        position_m = None
        if params.scale_resolution_m is not None:
            position_m = _round_down(state.position_m, params.scale_resolution_m)
        return AxisReading(
            angle_rad,
            position_m,
            state.position_m <= params.negative_switch_m,
            state.position_m >= params.positive_switch_m,
        )

    def truth(self) -> AxisTruth:
        """Return the state of the axis."""
        motion = self._motion
        state = motion.state
        return AxisTruth(
            t_s=self._t_s,
            motor_angle_rad=state.motor_angle_rad,
            motor_speed_rad_s=state.motor_speed_rad_s,
            position_m=state.position_m,
            velocity_m_s=state.table_speed_m_s,
            acceleration_m_s2=motion.acceleration_m_s2(),
            applied_torque_n_m=state.torque_n_m,
            sticking=motion.held,
            integration_error_m=self._error_m,
            overspeed=self._overspeed,
            at_stop=motion.regime.stop != 0,
        )

    def _add_time(self, duration_s: float) -> None:
        """Add a duration to the time by compensated summation (Kahan)."""
        more_s = duration_s + self._t_rest_s
        before_s = self._t_s
        self._t_s = before_s + more_s
        self._t_rest_s = more_s - (self._t_s - before_s)

    def _measure_error(self, state: ScrewState, other: ScrewState) -> None:
        rounding_m = STEP_ROUNDING_REL * abs(state.position_m)
        error_m = abs(state.position_m - other.position_m)
        angle_error_rad = abs(state.motor_angle_rad - other.motor_angle_rad)
        error_m = max(error_m, self._tau_m_rad * angle_error_rad) + rounding_m
        self._error_m = max(self._error_m, error_m)

    def _measure(self) -> None:
        """Update error bound and overspeed at the end of a sample."""
        state = self._motion.state
        if self._perturbed is not None:
            self._measure_error(state, self._perturbed.state)
        speed_rad_s = abs(state.motor_speed_rad_s)
        if self._tau_m_rad * speed_rad_s > self.params.speed_limit_m_s:
            self._overspeed = True
        if not speed_rad_s <= MAX_SCREW_SPEED_RAD_S:
            raise ValueError(
                f"motor_speed_rad_s = {speed_rad_s:.3g} at t_s = {self._t_s:g}; "
                f"must be <= {MAX_SCREW_SPEED_RAD_S:g}: "
                "stabilise the controller, or lower torque_limit_n_m"
            )


def _check_finite(name: str, number: float, hint: str) -> None:
    if not math.isfinite(number):
        raise ValueError(f"{name} = {number}; must be finite: {hint}")


def _round_down(number: float, step: float) -> float:
    return math.floor(number / step) * step if step else number
