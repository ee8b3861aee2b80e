"""Move of a simulated joint under one controller: one step per sample, all recorded."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory
from rig.drives.servo.setpoint import DriveController, MotorSetpoint
from rig.errors import RunFailed

SETTLED_SPEED_SHARE = 0.01  # band of the settling time, share of the largest reference speed
REST_SHARE = 0.2  # last share of the samples after the move, for the torque at rest
LIMIT_SHARE = 0.999  # share of the torque limit; torque above it counts as limited
CRUISE_SPEED_SHARE = 1.0 - 1e-6  # of the top speed of the reference: it counts as constant
MIN_CRUISE_SAMPLES = 20
ARRIVED_SHARE = 0.01  # final error of a load that reached its goal, share of the move


class Measurement(Protocol):
    """Sensor values of one sample."""

    @property
    def motor_angle_rad(self) -> float:
        """Angle of the motor by the encoder."""
        ...

    @property
    def load_acceleration_rad_s2(self) -> float:
        """Acceleration of the load shaft by the accelerometer."""
        ...


class SimulatedJointState(Protocol):
    """State of the simulated joint, for records, analysis and tests only."""

    @property
    def load_angle_rad(self) -> float:
        """Angle of the load shaft."""
        ...

    @property
    def load_speed_rad_s(self) -> float:
        """Speed of the load shaft."""
        ...

    @property
    def applied_torque_n_m(self) -> float:
        """Torque of the motor, within its limit."""
        ...

    @property
    def integration_error_rad(self) -> float:
        """Bound of the integration error of the simulation, at the motor."""
        ...


class JointPlant(Protocol):
    """Joint with its drive, real or simulated."""

    def advance(self, torque_n_m: float, duration_s: float) -> None:
        """Hold the torque for a duration."""
        ...

    def read(self) -> Measurement:
        """Read the sensors."""
        ...

    def truth(self) -> SimulatedJointState:
        """Return the state of the simulation."""
        ...


class Recording(NamedTuple):
    """Recording of a run; every array (N,), those of the load at its own shaft."""

    t_s: FloatArray
    end_s: float  # of the reference
    reference_rad: FloatArray  # reference of the load
    reference_rad_s: FloatArray
    load_rad: FloatArray  # truth
    load_rad_s: FloatArray  # truth
    measured_rad_s: FloatArray  # speed of the load by integration of its accelerometer
    torque_n_m: FloatArray  # applied torque, held from this sample to the next
    integration_error_rad: float  # bound of the simulation, at the motor


class MoveMetrics(NamedTuple):
    """Figures of a run.

    The residual is the largest |speed| of the load after the end of the move.
    """

    residual: float  # share of the largest reference speed
    residual_measured: float  # the same from the accelerometer
    # settling time from the end of the reference, band SETTLED_SPEED_SHARE; inf if never
    settled_s: float
    speed_error: float  # rms against the reference from the start of the move, share likewise
    overshoot_deg: float  # excess of the load angle over the goal
    final_error_deg: float  # the same at the end of the recording, signed
    arrived: bool  # final error within ARRIVED_SHARE of the move
    peak_torque_n_m: float
    rms_torque_n_m: float  # over the move
    rest_torque_n_m: float  # rms over REST_SHARE: limit cycle by encoder steps or friction
    at_limit_s: float  # duration of limited torque


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
    """Rest, move along the trajectory (angle of the motor [rad]), and watch.

    The bench must be at rest at its start. Time is 0 at the start of the move. Raises RunFailed
    when the bench cannot continue, e.g. with an unstable controller.
    """
    before = math.ceil(rest_s / period_s - 1e-9)
    after = math.ceil((trajectory.duration_s + watch_s) / period_s - 1e-9) + 1
    t = period_s * np.arange(-before, after, dtype=np.float64)
    inside = np.clip(t, 0.0, trajectory.duration_s)
    setpoints = np.stack([trajectory.at(inside, order) for order in range(3)], axis=1)
    setpoints[(t < 0.0) | (t >= trajectory.duration_s), 1:] = 0.0
    rows = np.empty((t.size, 4))
    for k, setpoint in enumerate(setpoints.tolist()):
        reading, truth = bench.read(), bench.truth()
        rows[k, :3] = truth.load_angle_rad, truth.load_speed_rad_s, reading.load_acceleration_rad_s2
        _hold(bench, controller.step(MotorSetpoint(*setpoint), reading.motor_angle_rad), period_s)
        rows[k, 3] = bench.truth().applied_torque_n_m
    return Recording(
        t_s=t,
        end_s=trajectory.duration_s,
        reference_rad=setpoints[:, 0] / gear_ratio,
        reference_rad_s=setpoints[:, 1] / gear_ratio,
        load_rad=rows[:, 0],
        load_rad_s=rows[:, 1],
        measured_rad_s=_speed(rows[:, 2], period_s, before),
        torque_n_m=rows[:, 3],
        integration_error_rad=bench.truth().integration_error_rad,
    )


def move_metrics(
    recording: Recording, delay_s: float = 0.0, torque_limit_n_m: float = math.inf
) -> MoveMetrics:
    """Compute the figures of a run whose reference moves.

    delay_s is the intended delay of the controller; the torque limit is that of drive and bench.
    """
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


def cruise_ripple_rad_s(recording: Recording) -> float | None:
    """Compute the standard deviation of the load speed in the second half of the constant speed.

    None for a move with less than MIN_CRUISE_SAMPLES at its top speed.
    """
    r = recording
    speed = np.abs(r.reference_rad_s)
    cruise = np.flatnonzero(speed >= CRUISE_SPEED_SHARE * speed.max())
    if cruise.size < MIN_CRUISE_SAMPLES:
        return None
    return float(np.std(r.load_rad_s[cruise[cruise.size // 2 :]]))


def _hold(bench: JointPlant, torque_n_m: float, period_s: float) -> None:
    try:
        bench.advance(torque_n_m, period_s)
    except ValueError as error:
        raise RunFailed(f"the simulated joint cannot continue: {error}") from None


def _settled_s(t_s: FloatArray, moves: NDArray[np.bool_]) -> float:
    """Find the first instant after which `moves` is False for good; inf if there is none."""
    last = np.flatnonzero(moves)
    first = last[-1] + 1 if last.size else 0
    return float(t_s[first]) if first < t_s.size else math.inf


def _speed(acceleration_rad_s2: FloatArray, period_s: float, before: int) -> FloatArray:
    """Integrate the acceleration by trapezoids, minus the bias of the sensor.

    The bias is the mean at rest before the move.
    """
    unbiased = acceleration_rad_s2 - acceleration_rad_s2[:before].mean()
    steps = (unbiased[1:] + unbiased[:-1]) / 2.0 * period_s
    return np.concatenate([[0.0], np.cumsum(steps)])
