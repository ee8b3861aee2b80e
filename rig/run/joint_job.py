"""The job of a run of an elastic joint: program of the drive, its settings, and checks before it.

There is no streamer and no controller: the plan is a trapezoid of the motor, and the master gives
the drive a target of it with every SYNC.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np

from comms.channels import MS
from comms.plan_record import PlanRecord
from planners.errors import unknown_name
from planners.trajectories.trajectory import Trajectory
from rig.drives.cia402.signals import PERMILLE
from rig.drives.servo.errors import ServoError
from rig.errors import ConfigError, Refused
from rig.run.config import CameraSection, Experiment
from rig.run.drive_settings import shipped_identity, torque_limit_permille
from rig.run.job import Job, Plant
from rig.run.joint.controllers import CONTROLLERS
from rig.run.joint.sections import JointSection
from rig.run.node_settings import NodeSettings
from rig.run.tasks.drive.settings import DriveSettings, ProgramStep

WITHOUT_EFFECT = (
    "move",
    "model",
    "plan",
    "limits",
    "controller",
    "camera",
    "vision",
    "drive",
    "robot",
)  # tables that an experiment of the kind joint does not use
UNUSED_IN_BENCH = (
    "pendulum",
    "links",
    "load",
    "pushes",
    "length_changes",
    "cable",
    "camera",
    "cameras",
)
PLANNER = "trapezoid"
MIN_QUIET_S = 0.02  # rest before the move
MAX_INCREMENTS = 2**31 - 1
MAX_OFFSET_PERMILLE = 2**15 - 1
NO_CAMERA = CameraSection(rate_hz=0.0)


def prepare_joint(experiment: Experiment, plant: Plant) -> Job:
    """Compose the settings of drive and bench; raises ConfigError and Refused before any motion."""
    joint = _joint(experiment)
    _check_tables(experiment)
    e = experiment.experiment
    _check_quiet(e.quiet_s)
    delay_s = _controller_delay_s(joint)
    program = _program(joint, e.quiet_s)
    node = joint.drive
    per_rad = node.increments_per_unit
    limit_rad = math.radians(node.position_limit_deg) * joint.model.gear_ratio
    fastest_rad_s = _path(joint).peak(1).value
    settings = DriveSettings(
        node_id=node.node_id,
        identity=shipped_identity(node.node_id),
        increments_per_unit=per_rad,
        velocity_units_per_unit_s=per_rad,
        acceleration_units_per_unit_s2=per_rad,
        quick_stop=node.quick_stop_rad_s2,
        lower=-limit_rad,
        upper=limit_rad,
        following_error=node.following_error_rad,
        torque_limit_permille=torque_limit_permille(node),
        sync_ns=node.sync_ms * MS,
        heartbeat_ns=node.heartbeat_ms * MS,
        program=program,
        has_accelerometer=True,
    )
    record = PlanRecord(
        planner=PLANNER,
        distance_m=0.0,
        time_s=joint.move.time_s,
        quiet_s=e.quiet_s,
        watch_s=e.watch_s,
        positions_m=[(0.0, 0.0, 0.0)],
        metrics=None,
        controller_delay_s=delay_s,
        angle_rad=math.radians(joint.move.load_angle_deg),
    )
    return Job(
        experiment=msgspec.structs.replace(experiment, camera=NO_CAMERA),
        plan=record,
        calibration_name="none",
        settings={
            "bench": NodeSettings(joint=joint, plant=msgspec.to_builtins(plant.settings)),
            "drive": settings,
        },
        stop_ns=round(abs(fastest_rad_s) / node.quick_stop_rad_s2 * 1e9),
    )


def _joint(experiment: Experiment) -> JointSection:
    if experiment.joint is None:
        raise ConfigError(
            "[joint] is missing in an experiment of the kind joint; must hold move, model and "
            "controller: see `rig run joint_1`"
        )
    return experiment.joint


def _check_tables(experiment: Experiment) -> None:
    """Refuse tables that would have no effect."""
    defaults = Experiment(experiment=experiment.experiment)
    for name in UNUSED_IN_BENCH:
        if getattr(experiment.bench, name):
            raise ConfigError(
                f"[bench.{name}] in an experiment of the kind joint; has no effect there: remove it"
            )
    for name in WITHOUT_EFFECT:
        if getattr(experiment, name) != getattr(defaults, name):
            hint = "give the keys in [joint]" if name in ("move", "model", "drive") else "remove it"
            raise ConfigError(
                f"[{name}] in an experiment of the kind joint; has no effect there: {hint}"
            )


def _check_quiet(quiet_s: float) -> None:
    if quiet_s < MIN_QUIET_S:
        raise ConfigError(
            f"[experiment] quiet_s = {quiet_s:g}; must be >= {MIN_QUIET_S:g} s in an experiment of "
            "the kind joint, for the bias of the accelerometer: raise it"
        )


def _controller_delay_s(joint: JointSection) -> float:
    """Design the controller once, so that what is wrong with it is said before anything starts."""
    if joint.controller not in CONTROLLERS:
        raise unknown_name("[joint] controller", joint.controller, CONTROLLERS)
    try:
        return CONTROLLERS[joint.controller](joint).delay_s
    except ServoError as error:
        raise ConfigError(f"[joint] {joint.controller}: {error}") from error


def _path(joint: JointSection) -> Trajectory:
    """Make the path of the motor angle [rad]; raises ConfigError."""
    return joint.move.trajectory(joint.model.gear_ratio, "[joint.move]")


def _program(joint: JointSection, quiet_s: float) -> list[ProgramStep]:
    """Sample the trapezoid on the grid of the SYNCs, after the quiet time."""
    node = joint.drive
    angle_deg = joint.move.load_angle_deg
    if abs(angle_deg) > node.position_limit_deg:
        raise Refused(
            f"[joint.move] load_angle_deg = {angle_deg:g}; must be within +-"
            f"{node.position_limit_deg:g} (joint.drive.position_limit_deg): shorten the move"
        )
    path = _path(joint)
    before = math.ceil(quiet_s / node.period_s - 1e-9)
    after = math.ceil(path.duration_s / node.period_s - 1e-9) + 1
    t_s = node.period_s * np.arange(-before, after + 1, dtype=np.float64)
    inside_s = np.clip(t_s, 0.0, path.duration_s)
    positions = np.rint(path.at(inside_s, 0) * node.increments_per_unit)
    accelerations = np.where((t_s < 0.0) | (t_s >= path.duration_s), 0.0, path.at(inside_s, 2))
    scale = PERMILLE * joint.joint.rigid_inertia_kg_m2 / node.rated_torque_n_m
    offsets = np.rint(accelerations * scale)
    largest = np.abs(positions).max()
    if largest > MAX_INCREMENTS:
        raise Refused(
            f"[joint.move] ends at {largest:.0f} increments; must be <= {MAX_INCREMENTS}: "
            "lower joint.drive.increments_per_rev"
        )
    if np.abs(offsets).max() > MAX_OFFSET_PERMILLE:
        raise Refused(
            f"[joint.move] asks {np.abs(offsets).max():.0f} thousandths of the rated torque; must "
            f"be <= {MAX_OFFSET_PERMILLE}: raise joint.drive.rated_torque_n_m"
        )
    return [ProgramStep(int(x), int(m)) for x, m in zip(positions, offsets, strict=True)]
