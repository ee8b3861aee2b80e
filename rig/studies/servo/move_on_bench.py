"""One controller moves one bench: a step a sample, everything recorded."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory
from rig.drives.servo.setpoint import DriveController, MotorSetpoint
from rig.errors import RunFailed

SETTLED_SPEED_SHARE = 0.01  # of the largest reference speed
REST_SHARE = 0.2  # of a run's samples after the move: its end, where the torque is that of rest
LIMIT_SHARE = 0.999  # of the limit: torque there is limited
ARRIVED_SHARE = 0.01  # of the move: a load farther than this from its goal has not arrived


class Measurement(Protocol):
    """What the sensors say now."""

    @property
    def motor_angle_rad(self) -> float:
        """By the encoder."""
        ...

    @property
    def load_acceleration_rad_s2(self) -> float:
        """By the accelerometer, at the load's shaft."""
        ...


class JointTruth(Protocol):
    """What only records, analysis and tests may know."""

    @property
    def load_angle_rad(self) -> float:
        """At the load's shaft."""
        ...

    @property
    def load_speed_rad_s(self) -> float:
        """At the load's shaft."""
        ...

    @property
    def applied_torque_n_m(self) -> float:
        """Of the motor, within its limit."""
        ...

    @property
    def integration_error_rad(self) -> float:
        """The bench's bound of its own error, at the motor."""
        ...


class JointPlant(Protocol):
    """A joint behind its drive, real or simulated."""

    def advance(self, torque_n_m: float, duration_s: float) -> None:
        """Hold the torque for one sample."""
        ...

    def read(self) -> Measurement:
        """The sensors."""
        ...

    def truth(self) -> JointTruth:
        """The bench's own state."""
        ...


class Recording(NamedTuple):
    """A run; every array (N,), the load's at its own shaft."""

    t_s: FloatArray
    end_s: float  # of the reference
    reference_rad: FloatArray  # where the load should be
    reference_rad_s: FloatArray
    load_rad: FloatArray  # truth
    load_rad_s: FloatArray  # truth
    measured_rad_s: FloatArray  # the load's speed by integrating its accelerometer
    torque_n_m: FloatArray  # that the motor really made, held from this sample to the next
    integration_error_rad: float  # the bench's own bound, at the motor


class MoveMetrics(NamedTuple):
    """What a run amounts to; the residual is the largest |speed| of the load after the end of the move."""

    residual: float  # share of the largest reference speed
    residual_measured: float  # the same by the accelerometer
    settled_s: float  # from the end of the move as asked until |speed| stays below SETTLED of the largest one; inf if never
    speed_error: float  # rms of move and watch against the move as asked, share likewise
    overshoot_deg: float  # of the load beyond the goal
    final_error_deg: float  # of the load beyond the goal, at the end of the watch
    arrived: bool  # within ARRIVED_SHARE of the move
    peak_torque_n_m: float
    rms_torque_n_m: float  # over the move
    rest_torque_n_m: float  # rms over the end of the watch: what the encoder's steps, or friction, keep the loop doing
    at_limit_s: float  # for how long the torque was all there is


def run_move(
    bench: JointPlant,
    controller: DriveController,
    trajectory: Trajectory,
    gear_ratio: float,
    period_s: float,
    *,
    rest_s: float,
    watch_s: float,
) -> Recording:
    """Rest, move along the trajectory (angle of the motor [rad]), and watch; the bench must be at rest at its start.

    Time is 0 at the start of the move. Raises RunFailed when the bench cannot go on, e.g. under a controller that is unstable.
    """
    before = math.ceil(rest_s / period_s - 1e-9)
    after = math.ceil((trajectory.duration_s + watch_s) / period_s - 1e-9) + 1
    t = period_s * np.arange(-before, after, dtype=np.float64)
    wanted = np.stack(
        [trajectory.at(np.clip(t, 0.0, trajectory.duration_s), order) for order in range(3)], axis=1
    )
    wanted[(t < 0.0) | (t >= trajectory.duration_s), 1:] = 0.0
    rows = np.empty((t.size, 4))
    for k, setpoint in enumerate(wanted.tolist()):
        reading, truth = bench.read(), bench.truth()
        rows[k, :3] = truth.load_angle_rad, truth.load_speed_rad_s, reading.load_acceleration_rad_s2
        _hold(bench, controller.step(MotorSetpoint(*setpoint), reading.motor_angle_rad), period_s)
        rows[k, 3] = bench.truth().applied_torque_n_m
    return Recording(
        t,
        trajectory.duration_s,
        wanted[:, 0] / gear_ratio,
        wanted[:, 1] / gear_ratio,
        rows[:, 0],
        rows[:, 1],
        _speed(rows[:, 2], period_s, before),
        rows[:, 3],
        bench.truth().integration_error_rad,
    )


def move_metrics(
    recording: Recording, delay_s: float = 0.0, torque_limit_n_m: float = math.inf
) -> MoveMetrics:
    """Figures of a run whose reference moves, under a controller that is meant to be delay_s later, with a torque limit."""
    r = recording
    after, moving = r.t_s >= r.end_s + delay_s, (r.t_s >= 0.0) & (r.t_s < r.end_s + delay_s)
    fastest, goal = float(np.abs(r.reference_rad_s).max()), float(r.reference_rad[-1])
    beyond = (r.load_rad - goal) * math.copysign(1.0, goal)
    return MoveMetrics(
        residual=float(np.abs(r.load_rad_s[after]).max()) / fastest,
        residual_measured=float(np.abs(r.measured_rad_s[after]).max()) / fastest,
        settled_s=_settled_s(
            r.t_s[after] - r.end_s, np.abs(r.load_rad_s[after]) > SETTLED_SPEED_SHARE * fastest
        ),
        speed_error=float(np.sqrt(np.mean((r.load_rad_s - r.reference_rad_s)[r.t_s >= 0.0] ** 2)))
        / fastest,
        overshoot_deg=math.degrees(max(0.0, float(beyond.max()))),
        final_error_deg=math.degrees(float(beyond[-1])),
        arrived=bool(abs(beyond[-1]) <= ARRIVED_SHARE * abs(goal)),
        peak_torque_n_m=float(np.abs(r.torque_n_m).max()),
        rms_torque_n_m=float(np.sqrt(np.mean(r.torque_n_m[moving] ** 2))),
        rest_torque_n_m=float(
            np.sqrt(
                np.mean(r.torque_n_m[-max(1, int(REST_SHARE * np.count_nonzero(after))) :] ** 2)
            )
        ),
        at_limit_s=float(
            np.count_nonzero(np.abs(r.torque_n_m) >= LIMIT_SHARE * torque_limit_n_m)
            * (r.t_s[1] - r.t_s[0])
        ),
    )


def _hold(bench: JointPlant, torque_n_m: float, period_s: float) -> None:
    try:
        bench.advance(torque_n_m, period_s)
    except ValueError as error:
        raise RunFailed(f"the bench stopped: {error}") from None


def _settled_s(t_s: FloatArray, moves: NDArray[np.bool_]) -> float:
    """The first instant from which it moves no more."""
    last = np.flatnonzero(moves)
    first = last[-1] + 1 if last.size else 0
    return float(t_s[first]) if first < t_s.size else math.inf


def _speed(acceleration_rad_s2: FloatArray, period_s: float, before: int) -> FloatArray:
    """Trapezoids added up, less the sensor's bias, which is its mean at rest before the move."""
    felt = acceleration_rad_s2 - acceleration_rad_s2[:before].mean()
    return np.concatenate([[0.0], np.cumsum((felt[1:] + felt[:-1]) / 2.0 * period_s)])
