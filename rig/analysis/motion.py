"""Motion of a run against its bounds: what was asked of the robot, and what it reached.

Speed asked is the step between setpoints over 5 ms; acceleration, asked or reached, is the change
of speed over the 30 ms window of the interpolation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from comms.messages import Command, JointState, Phase, RobotState, Setpoint, Verb
from rig.analysis.delays import tracking_of
from rig.analysis.facts import EnvelopeFacts
from rig.analysis.platform_path import PlatformPath
from rig.analysis.run_log import RunLog
from rig.analysis.summary import MotionPeaks

TICK_NS = 5_000_000
TICKS = 6  # of a window
WINDOW_S = 0.03
SPEED_ROUNDING_M_S = 5e-6
ACCELERATION_ROUNDING_M_S2 = SPEED_ROUNDING_M_S / WINDOW_S
FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class SentPath(NamedTuple):
    """Positions in the order of time."""

    t_ns: IntArray  # (N,)
    position_m: FloatArray  # (N, 3)


class ActualPath(NamedTuple):
    """Positions and velocities in the order of time."""

    t_ns: IntArray  # (N,)
    position_m: FloatArray  # (N, 3)
    velocity_m_s: FloatArray  # (N, 3)


def motion_peaks(run: RunLog) -> MotionPeaks:
    """Compare the motion of a run with its bounds; what was not logged is None."""
    facts = run.controller
    peaks = MotionPeaks(
        policy=facts.policy or None,
        speed_bound_m_s=_finite(facts.envelope.speed_m_s),
        acceleration_bound_m_s2=_finite(facts.envelope.acceleration_m_s2),
        following_error_bound_m=_finite(facts.following_error_m),
    )
    setpoints = _setpoints(run)
    if setpoints.t_ns.size > 1:
        _add_asked(peaks, setpoints, facts.envelope)
    actual = _actual(run)
    if actual.t_ns.size > 1:
        _add_reached(peaks, actual)
    if actual.t_ns.size and setpoints.t_ns.size:
        peaks.following_error_m = _following_error_m(actual, setpoints, facts.servo_lag_ns)
    tracking = tracking_of(run)
    if tracking is not None:
        peaks.tracking_delay_rms_m = tracking.delay_rms
        peaks.tracking_distortion_rms_m = tracking.distortion_rms
    return peaks


def _setpoints(run: RunLog) -> SentPath:
    """Read the setpoints up to the first stop, after which the robot holds."""
    end_ns = _stop_ns(run)
    path = PlatformPath(run.controller.robot)
    sent = list(path.setpoints(run.log.read("/setpoint", Setpoint)))
    t_ns = np.array([t for t, _ in sent], dtype=np.int64)
    position = np.array([place for _, place in sent]).reshape(-1, 3)
    moving = t_ns < end_ns
    return SentPath(t_ns[moving], position[moving])


def _actual(run: RunLog) -> ActualPath:
    """Read what the encoders measured."""
    path = PlatformPath(run.controller.robot)
    states = list(path.states(run.log.read("/joint_state", JointState)))
    t_ns = np.array([t for t, _, _ in states], dtype=np.int64)
    position = np.array([place for _, place, _ in states]).reshape(-1, 3)
    velocity = np.array([v for _, _, v in states]).reshape(-1, 3)
    return ActualPath(t_ns, position, velocity)


def _stop_ns(run: RunLog) -> float:
    """Find the instant of the first order to stop, or of the first state after a stop."""
    end_ns = math.inf
    for order in run.log.read("/command", Command):
        if order.verb in (Verb.STOP, Verb.ESTOP):
            end_ns = min(end_ns, order.t_ns)
    for state in run.log.read("/robot_state", RobotState):
        if state.phase in (Phase.STOPPED, Phase.FAULT):
            end_ns = min(end_ns, state.t_ns)
    return end_ns


def _add_asked(peaks: MotionPeaks, path: SentPath, bounds: EnvelopeFacts) -> None:
    velocity = np.diff(path.position_m, axis=0) / (TICK_NS * 1e-9)
    ticks = path.t_ns // TICK_NS
    # share of the speed that a pause of the controller leaves, by step
    left = np.clip(1.0 - (np.diff(ticks) - 1) / TICKS, 0.0, 1.0)
    before = np.zeros_like(velocity)
    before[TICKS:] = velocity[:-TICKS]
    for k in range(TICKS):
        before[k:] *= left[: left.size - k, np.newaxis]
    speed = np.linalg.norm(velocity, axis=1)
    acceleration = np.linalg.norm(velocity - before, axis=1) / WINDOW_S
    too_fast = speed > bounds.speed_m_s + SPEED_ROUNDING_M_S
    too_sudden = acceleration > bounds.acceleration_m_s2 + ACCELERATION_ROUNDING_M_S2
    peaks.asked_speed_m_s = float(speed.max())
    peaks.asked_acceleration_m_s2 = float(acceleration.max())
    peaks.setpoints_outside = int((too_fast | too_sudden).sum())


def _add_reached(peaks: MotionPeaks, actual: ActualPath) -> None:
    t_s = actual.t_ns * 1e-9
    velocity = actual.velocity_m_s
    peaks.reached_speed_m_s = float(np.linalg.norm(velocity, axis=1).max())
    before = np.empty_like(velocity)
    for axis in range(3):
        before[:, axis] = np.interp(t_s - WINDOW_S, t_s, velocity[:, axis])
    change = np.linalg.norm(velocity - before, axis=1)
    peaks.reached_acceleration_m_s2 = float(change.max()) / WINDOW_S


def _following_error_m(actual: ActualPath, setpoints: SentPath, servo_lag_ns: int) -> float | None:
    """Find the largest distance from the setpoint in force servo_lag_ns before."""
    due_ns = actual.t_ns - servo_lag_ns
    in_force = np.searchsorted(setpoints.t_ns, due_ns, side="right") - 1
    known = in_force >= 0
    if not known.any():
        return None
    error = actual.position_m[known] - setpoints.position_m[in_force[known]]
    return float(np.linalg.norm(error, axis=1).max())


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
