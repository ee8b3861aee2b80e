"""Move of an elastic joint from the log of its run: targets and sensors on the bus, the truth."""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

import msgspec
import numpy as np

from comms.errors import LogError
from comms.messages import CanMessage, Truth
from rig.analysis.joint_move import (
    FloatArray,
    MoveMetrics,
    Recording,
    integrated_speed,
    move_metrics,
)
from rig.analysis.run_log import RunLog
from rig.analysis.summary import JointFigures

RPDO, TPDO_STATUS = 0x200, 0x280  # COB-IDs, plus the node-ID
TARGET = struct.Struct("<Hih")  # control word, position, torque offset
STATUS = struct.Struct("<Hhi")  # status word, torque, acceleration of the load
ACCELERATION_UNIT_RAD_S2 = 1e-6  # of object 2000
PERMILLE = 1000.0
MIN_WATCH_S = 0.05  # after the move
MIN_REST_SAMPLES = 10  # before it, for the bias of the accelerometer


class JointNodeFacts(msgspec.Struct, frozen=True, kw_only=True):
    """Keys of `[joint.drive]` that the analysis uses."""

    rated_torque_n_m: float
    torque_limit_n_m: float


class JointModelFacts(msgspec.Struct, frozen=True, kw_only=True):
    """Keys of `[joint.model]` that the analysis uses."""

    gear_ratio: float


class JointFacts(msgspec.Struct, frozen=True, kw_only=True):
    """Keys of `[joint]` that the analysis uses."""

    controller: str
    drive: JointNodeFacts
    model: JointModelFacts


class _Experiment(msgspec.Struct, frozen=True, kw_only=True):
    joint: JointFacts | None = None


class _Drive(msgspec.Struct, frozen=True, kw_only=True):
    """Keys of `drive.json` that the analysis uses."""

    node_id: int
    increments_per_unit: float
    sync_ns: int


class JointRun(NamedTuple):
    """Recording of a joint, its figures as a comparison computes them, and as a summary has them.

    Without truth, the load of the recording is that of its accelerometer, and metrics is None.
    """

    recording: Recording
    metrics: MoveMetrics | None
    figures: JointFigures


def joint_run(run: RunLog) -> JointRun | None:
    """Analyse the move; None for another kind of run, and for one that ended before the move did.

    Raises LogError for attachments that cannot be read.
    """
    if run.plan.angle_rad is None or run.t_start_s is None:
        return None
    facts, drive = _facts(run)
    samples = _samples(run, drive, facts)
    period_s = drive.sync_ns * 1e-9
    zero_s = run.t_move_s + period_s  # the drive reaches a target one period after its SYNC
    kept = samples.t_s >= run.t_start_s
    t_s = samples.t_s[kept] - zero_s
    before = int(np.count_nonzero(t_s < 0.0))
    end_s = run.plan.time_s
    if before < MIN_REST_SAMPLES or t_s[-1] < end_s + run.plan.controller_delay_s + MIN_WATCH_S:
        return None
    reference = _reference(run, drive, facts)
    reference_rad = np.interp(t_s + zero_s, reference[:, 0] + period_s, reference[:, 1])
    acceleration = samples.acceleration_rad_s2[kept]
    measured = integrated_speed(t_s, acceleration, before)
    truth = _truth(run, t_s + zero_s)
    recording = Recording(
        t_s=t_s,
        end_s=end_s,
        reference_rad=reference_rad,
        reference_rad_s=np.gradient(reference_rad, t_s),
        load_rad=truth[:, 0] if truth.size else _integral(t_s, measured),
        load_rad_s=truth[:, 1] if truth.size else measured,
        measured_rad_s=measured,
        torque_n_m=samples.torque_n_m[kept],
        integration_error_rad=math.nan,
    )
    found = move_metrics(recording, run.plan.controller_delay_s, facts.drive.torque_limit_n_m)
    sigma = _sigma(t_s, acceleration, before) / float(np.abs(recording.reference_rad_s).max())
    figures = JointFigures(
        controller=facts.controller,
        residual_measured=found.residual_measured,
        residual_sigma=sigma,
        peak_torque_n_m=found.peak_torque_n_m,
        rms_torque_n_m=found.rms_torque_n_m,
        rest_torque_n_m=found.rest_torque_n_m,
        at_limit_s=found.at_limit_s,
    )
    if not truth.size:
        return JointRun(recording, None, figures)
    figures.residual = found.residual
    figures.settled_s = found.settled_s if math.isfinite(found.settled_s) else None
    figures.speed_error = found.speed_error
    figures.overshoot_deg = found.overshoot_deg
    figures.final_error_deg = found.final_error_deg
    figures.arrived = found.arrived
    return JointRun(recording, found, figures)


class _Samples(NamedTuple):
    """Status PDOs in the order of time, each array (N,)."""

    t_s: FloatArray
    torque_n_m: FloatArray  # applied until the sample
    acceleration_rad_s2: FloatArray  # of the load


def _facts(run: RunLog) -> tuple[JointFacts, _Drive]:
    try:
        experiment = msgspec.json.decode(run.log.attachments["experiment.json"], type=_Experiment)
        drive = msgspec.json.decode(run.log.attachments["drive.json"], type=_Drive)
    except (msgspec.MsgspecError, KeyError) as error:
        raise LogError(
            f"{run.log.path}: the run of a joint without its parameters ({error}): damaged, or of "
            "another version"
        ) from error
    if experiment.joint is None:
        raise LogError(f"{run.log.path}: the run of a joint without [joint] in its experiment")
    return experiment.joint, drive


def _samples(run: RunLog, drive: _Drive, facts: JointFacts) -> _Samples:
    can_id = TPDO_STATUS + drive.node_id
    rows = [
        (frame.t_ns * 1e-9, *STATUS.unpack(frame.data)[1:])
        for frame in run.log.read("/can_up", CanMessage)
        if frame.can_id == can_id and len(frame.data) == STATUS.size
    ]
    t_s, torque, acceleration = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    later = np.concatenate([[True], np.diff(t_s) > 0.0])[: t_s.size]
    return _Samples(
        t_s[later],
        torque[later] / PERMILLE * facts.drive.rated_torque_n_m,
        acceleration[later] * ACCELERATION_UNIT_RAD_S2,
    )


def _reference(run: RunLog, drive: _Drive, facts: JointFacts) -> FloatArray:
    """Read instant [s] and target of the load [rad] of every SYNC (N, 2)."""
    scale = 1.0 / (drive.increments_per_unit * facts.model.gear_ratio)
    rows = [
        (frame.t_ns * 1e-9, scale * TARGET.unpack(frame.data)[1])
        for frame in run.log.read("/can_down", CanMessage)
        if frame.can_id == RPDO + drive.node_id and len(frame.data) == TARGET.size
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _truth(run: RunLog, t_s: FloatArray) -> FloatArray:
    """Interpolate angle [rad] and speed [rad/s] of the load at t_s (N, 2); (0, 2) without truth."""
    rows = [
        (truth.t_ns * 1e-9, truth.links[0].angle_x_rad, truth.links[0].rate_x_rad_s)
        for truth in run.log.read("/truth", Truth)
        if truth.links
    ]
    if not rows:
        return np.empty((0, 2))
    t, angle, speed = np.array(rows, dtype=np.float64).T
    return np.stack([np.interp(t_s, t, angle), np.interp(t_s, t, speed)], axis=1)


def _integral(t_s: FloatArray, speed: FloatArray) -> FloatArray:
    steps = (speed[1:] + speed[:-1]) / 2.0 * np.diff(t_s)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _sigma(t_s: FloatArray, acceleration_rad_s2: FloatArray, before: int) -> float:
    """Estimate the standard deviation of the integrated speed at the end of the recording.

    White noise of the sensor gives a random walk, an error of the bias a ramp, and an error of the
    stamps a sum over the changes of the acceleration a_k:
    sigma^2 = s^2 (T t + t^2 / n) + s_t^2 sum (a_k+1 - a_k)^2, with s the deviation of the n samples
    at rest, T the period of the samples and s_t its deviation.
    """
    noise = float(np.std(acceleration_rad_s2[:before], ddof=1))
    periods_s = np.diff(t_s)
    time_s = float(t_s[-1])
    walk = noise**2 * (float(np.median(periods_s)) * time_s + time_s**2 / before)
    changes = np.diff(acceleration_rad_s2[before:])
    jitter = float(np.var(periods_s)) * float(changes @ changes)
    return math.sqrt(walk + jitter)
