"""The state-space drive: observer, feedback, integral and feed-forward in one step a sample (LQG when both are by cost)."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.servo.errors import check_range
from rig.drives.servo.estimator import ENCODER, Estimator, SampledEstimator
from rig.drives.servo.feed_forward import FeedForward, LoadFilter, feed_forward_block
from rig.drives.servo.loops import LoopAnalysis, analyse_loop
from rig.drives.servo.setpoint import MotorSetpoint
from rig.drives.servo.state_feedback import Feedback, sampled_joint
from rig.drives.servo.two_mass import TwoMass
from rig.drives.servo.wiring import SETPOINT

STATES, INPUTS = 5, 4  # [p (4), xI]; angle, speed and acceleration of the setpoint, encoder angle


class StateSpaceController:
    """u = nominal torque + K (x^ - nominal states) + kI xI, limited; the observer is told the limited one.

    Folded into two small products a step: of v = [p, xI, feed-forward states, setpoint, encoder angle] with a row for the
    torque, and of [v, torque asked for, torque applied] with a matrix for the states of the next sample.

    Raises ServoError for a sample time or a limit out of bounds, an estimator of another sample time and an unknown
    feed-forward, PolesNotAssignable and BeyondNyquist for what the sampling cannot hold, Improper for a load filter of too low a
    relative degree.
    """

    def __init__(
        self,
        joint: TwoMass,
        feedback: Feedback,
        estimator: Estimator | SampledEstimator,
        period_s: float,
        *,
        torque_limit_n_m: float = math.inf,
        feed_forward: str = "none",
        load_filter: LoadFilter | None = None,
    ) -> None:
        check_range(
            "torque_limit_n_m",
            torque_limit_n_m,
            1e-12,
            math.inf,
            "take it from the drive's data sheet",
        )
        self._period_s, self._limit_n_m = period_s, torque_limit_n_m
        ahead = feed_forward_block(feed_forward, joint, period_s, load_filter)
        self._row, self._next = _fold(joint, feedback, estimator, ahead, period_s)
        self._states = STATES + len(ahead.a)
        self._v: FloatArray = np.zeros(self._next.shape[1])

    def step(self, setpoint: MotorSetpoint, motor_angle_rad: float) -> float:
        """Torque [N m] to hold until the next sample, for the encoder's angle now."""
        v, n = self._v, self._states
        v[n : n + 3] = setpoint
        v[n + 3] = motor_angle_rad
        asked = float(self._row @ v[:-2])
        torque = min(max(asked, -self._limit_n_m), self._limit_n_m)
        v[-2] = asked
        v[-1] = torque
        v[:n] = self._next @ v
        return torque

    def reset(self) -> None:
        """Back to rest at 0."""
        self._v[:] = 0.0

    @cached_property
    def system(self) -> Any:
        """See Controller."""
        import control

        n = self._states
        whole = self._next[:, :-2] + np.outer(self._next[:, -2] + self._next[:, -1], self._row)
        return control.ss(
            whole[:, :n],
            whole[:, n:],
            self._row[None, :n],
            self._row[None, n:],
            self._period_s,
            inputs=[*SETPOINT, "motor_angle"],
            outputs=["drive_torque"],
        )


def compensator(joint: TwoMass, feedback: Feedback, estimator: Estimator) -> Any:
    """The continuous design: control.StateSpace from reference, motor_angle and forward_torque to motor_torque.

    u = K x^ + kI xI + forward_torque, xI' = reference - qm, x^' = A x^ + B u + L (qm - C x^).
    """
    import control

    b, k = joint.input_matrix[:, 0], feedback.row
    a = np.zeros((5, 5))
    a[:4, :4] = joint.state_matrix - np.outer(estimator.gains, ENCODER)
    a[:4] += np.outer(b, k)
    inputs = np.zeros((5, 3))
    inputs[4, :2] = 1.0, -1.0
    inputs[:4, 1] = estimator.gains
    inputs[:4, 2] = b
    names = ["reference", "motor_angle", "forward_torque"]
    return control.ss(a, inputs, k[None], [[0.0, 0.0, 1.0]], inputs=names, outputs=["motor_torque"])


def analyse_continuous_loop(
    joint: TwoMass, feedback: Feedback, estimator: Estimator
) -> LoopAnalysis:
    """Of the continuous loop with its observer: opened at the motor's torque, closed from reference to motor angle."""
    import control

    plant, controller = (
        joint.plant["motor_angle", "motor_torque"],
        compensator(joint, feedback, estimator),
    )
    opened = -plant * controller["motor_torque", "motor_angle"]
    closed = control.interconnect(
        [plant, controller], inplist=["reference"], outlist=["motor_angle"], check_unused=False
    )
    return analyse_loop(opened, closed)


def _fold(
    joint: TwoMass,
    feedback: Feedback,
    estimator: Estimator | SampledEstimator,
    ahead: FeedForward,
    period_s: float,
) -> tuple[FloatArray, FloatArray]:
    """The torque's row (n + 4,) and the next states' matrix (n, n + 6), n = 5 + states of the feed-forward."""
    a, b = sampled_joint(joint, period_s)
    gains = feedback.sampled(joint, period_s)
    correction = estimator.sampled(joint, period_s)
    n = STATES + len(ahead.a)
    estimate = np.zeros((4, n + INPUTS))  # x^ = p + M (qm - C p)
    estimate[:, :4] = np.eye(4) - np.outer(correction, ENCODER)
    estimate[:, -1] = correction
    told = np.zeros((6, n + INPUTS))
    told[:, STATES:n], told[:, n : n + 3] = ahead.c, ahead.d
    row = told[4] + np.asarray(gains.gains) @ (estimate - told[:4])
    row[4] += gains.integral_gain_n_m_rad_s
    follow = np.zeros((n, n + INPUTS + 2))
    follow[:4, :-2], follow[:4, -1] = a @ estimate, b
    follow[4, :-2] = period_s * told[5]
    follow[4, 4] = 1.0
    follow[4, -3] -= period_s
    follow[4, -2:] = _unwinding(gains)
    follow[STATES:, STATES:n], follow[STATES:, n : n + 3] = ahead.a, ahead.b
    return row, follow


def _unwinding(gains: Feedback) -> tuple[float, float]:
    """On torque asked for and applied: the integral is set to where it would ask for no more than is applied (Hanus 1987)."""
    share = 1.0 / gains.integral_gain_n_m_rad_s if gains.integral_gain_n_m_rad_s else 0.0
    return -share, share
