"""State-space controller: observer, state feedback, integral action and feed-forward.

One step per sample. It is LQG if observer and feedback are both optimal.
"""

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

STATES = 5  # [p (4), xI]
INPUTS = 4  # angle, speed and acceleration of the setpoint; encoder angle


class StateSpaceController:
    """Controller u = nominal torque + K (x^ - nominal states) + kI xI, limited.

    The observer receives the limited torque. A step takes two matrix products: the torque row times
    v = [p, xI, feed-forward states, setpoint, encoder angle], and the matrix of the next states
    times [v, torque requested, torque applied].

    Raises ServoError for a sample time or a limit out of bounds, an estimator of another sample
    time and an unknown feed-forward; PolesNotAssignable and BeyondNyquist for poles and resonances
    at or above the Nyquist frequency; Improper for a load filter of too low a relative degree.
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
            "take it from the data sheet of the drive",
        )
        self._period_s, self._limit_n_m = period_s, torque_limit_n_m
        forward = feed_forward_block(feed_forward, joint, period_s, load_filter)
        self._row, self._next = _step_matrices(joint, feedback, estimator, forward, period_s)
        self._states = STATES + len(forward.a)
        self._v: FloatArray = np.zeros(self._next.shape[1])

    def step(self, setpoint: MotorSetpoint, motor_angle_rad: float) -> float:
        """Compute the torque [N m] to hold until the next sample.

        From setpoint and encoder angle of this sample.
        """
        v, n = self._v, self._states
        v[n : n + 3] = setpoint
        v[n + 3] = motor_angle_rad
        requested = float(self._row @ v[:-2])
        torque = min(max(requested, -self._limit_n_m), self._limit_n_m)
        v[-2] = requested
        v[-1] = torque
        v[:n] = self._next @ v
        return torque

    def reset(self) -> None:
        """Set the state to rest at angle 0."""
        self._v[:] = 0.0

    @cached_property
    def system(self) -> Any:
        """Linear system, see DriveController."""
        import control

        n = self._states
        a_and_b = self._next[:, :-2] + np.outer(self._next[:, -2] + self._next[:, -1], self._row)
        return control.ss(
            a_and_b[:, :n],
            a_and_b[:, n:],
            self._row[None, :n],
            self._row[None, n:],
            self._period_s,
            inputs=[*SETPOINT, "motor_angle"],
            outputs=["drive_torque"],
        )


def compensator(joint: TwoMass, feedback: Feedback, estimator: Estimator) -> Any:
    """Build the continuous design as control.StateSpace.

    From reference, motor_angle and forward_torque to motor_torque:
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
    """Analyse the continuous loop with its observer.

    Opened at the motor torque, closed from reference to motor angle.
    """
    import control

    plant = joint.plant["motor_angle", "motor_torque"]
    controller = compensator(joint, feedback, estimator)
    opened = -plant * controller["motor_torque", "motor_angle"]
    closed = control.interconnect(
        [plant, controller], inplist=["reference"], outlist=["motor_angle"], check_unused=False
    )
    return analyse_loop(opened, closed)


def _step_matrices(
    joint: TwoMass,
    feedback: Feedback,
    estimator: Estimator | SampledEstimator,
    forward: FeedForward,
    period_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Compute the row of the torque (n + 4,) and the matrix of the next states (n, n + 6).

    n = 5 + number of feed-forward states.
    """
    a, b = sampled_joint(joint, period_s)
    gains = feedback.sampled(joint, period_s)
    correction = estimator.sampled(joint, period_s)
    n = STATES + len(forward.a)
    estimate = np.zeros((4, n + INPUTS))  # x^ = p + M (qm - C p)
    estimate[:, :4] = np.eye(4) - np.outer(correction, ENCODER)
    estimate[:, -1] = correction
    nominal = np.zeros((6, n + INPUTS))  # nominal states (4), torque, reference of the integral
    nominal[:, STATES:n] = forward.c
    nominal[:, n : n + 3] = forward.d
    row = nominal[4] + np.asarray(gains.gains) @ (estimate - nominal[:4])
    row[4] += gains.integral_gain_n_m_rad_s
    next_states = np.zeros((n, n + INPUTS + 2))
    next_states[:4, :-2] = a @ estimate
    next_states[:4, -1] = b
    next_states[4, :-2] = period_s * nominal[5]
    next_states[4, 4] = 1.0
    next_states[4, -3] -= period_s
    next_states[4, -2:] = _anti_windup_gains(gains)
    next_states[STATES:, STATES:n] = forward.a
    next_states[STATES:, n : n + 3] = forward.b
    return row, next_states


def _anti_windup_gains(gains: Feedback) -> tuple[float, float]:
    """Compute the anti-windup gains on torque requested and torque applied.

    The integral is set to the value that requests the torque applied (Hanus 1987).
    """
    share = 1.0 / gains.integral_gain_n_m_rad_s if gains.integral_gain_n_m_rad_s else 0.0
    return -share, share
