"""The job of a run: plan on the 10 ms grid, settings of each task, and checks before the start."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from comms.channels import MS, VISION_TASKS, vision_task
from comms.plan_record import PlanRecord
from planners import catalog
from planners.errors import PlanError
from planners.problem import Limits, Plan, Problem
from planners.trajectories.motion import AXES, Motion
from rig.errors import ConfigError, Refused
from rig.run.calibration import camera_file, static_scene
from rig.run.calibration import file as calibration_file
from rig.run.calibration.camera_file import CameraFile
from rig.run.camera_axes import check_axes
from rig.run.cameras import Camera, cameras, check_cameras
from rig.run.config import Experiment
from rig.run.drive_settings import drive_settings
from rig.run.field_of_view import check_field_of_view
from rig.run.joint_space import check_joint_space
from rig.run.load_model import planner_model
from rig.run.node_settings import NodeSettings
from rig.run.tasks import run_out
from rig.run.tasks.angle_watch import WatchedCamera
from rig.run.tasks.controller.joints import Kinematics, RobotSettings
from rig.run.tasks.controller.task import ControllerSettings
from rig.run.tasks.safety import Envelope, Gate
from rig.run.tasks.streamer import PERIOD_NS, StreamerSettings
from rig.run.vision_settings import vision_settings
from rig.run.waypoints import plan_through, read_waypoints

SAFETY_FACTOR = 1.1  # times the limits of the plan, where [safety] has no bound
STALE_PERIODS = 3  # of a slow camera: no angle is stale while two pictures in a row may be lost


class Job(msgspec.Struct, frozen=True, kw_only=True):
    """Input of a runner."""

    experiment: Experiment
    plan: PlanRecord
    calibration_name: str  # of each camera, in one line
    calibrations: list[
        calibration_file.Calibration | None
    ] = []  # by camera; None where it has none
    camera_files: list[CameraFile | None] = []  # likewise
    settings: dict[str, Any]  # by task name
    stop_ns: int = 0  # longest time of a stop
    command: str = ""  # as typed, for the log; "" where no terminal started the run

    def attachments(self) -> dict[str, bytes]:
        """Encode the files attached to the log."""
        encode = msgspec.json.encode
        files = {
            "experiment.json": encode(self.experiment),
            "plan.json": encode(self.plan),
            "bench.json": encode(_plant(self.settings["bench"])),
            "drive.json": encode(self.settings.get("drive")),
            "calibration.toml": b"",
        }
        for number, calibration in enumerate(self.calibrations, start=1):
            if calibration is not None:
                name = "calibration.toml" if number == 1 else f"calibration_{number}.toml"
                files[name] = calibration_file.text(calibration).encode()
        for number, file in enumerate(self.camera_files, start=1):
            if file is not None:
                name = "camera.toml" if number == 1 else f"camera_{number}.toml"
                files[name] = camera_file.text(file).encode()
        present = (name for name in ("controller", *VISION_TASKS) if name in self.settings)
        return files | {f"{name}.json": encode(self.settings[name]) for name in present}


class Plant(NamedTuple):
    """Plant of a run: settings of its task, links of its load, if it has a drive, its joints.

    planes: of the swing that its cameras see.
    """

    settings: Any
    links: int
    has_drive: bool = False
    kinematics: Kinematics = "axes"
    planes: tuple[str, ...] = ("x",)


def _plant(settings: Any) -> Any:
    """Return the parameters of the plant, without those of its node."""
    return settings.plant if isinstance(settings, NodeSettings) else settings


def plan_move(experiment: Experiment, timer: Any = None) -> Plan | None:
    """Plan the move, None without one. Raises ConfigError for a problem without a plan."""
    e = experiment
    if not e.has_move:
        return None
    try:
        if e.move.waypoints:
            return plan_through(e, read_waypoints(Path(e.move.waypoints)), planner_model(e))
        problem = Problem(
            start_m=e.move.start_m,
            distance_m=e.move.distance_m,
            time_s=e.move.time_s,
            axis=e.move.axis,
            model=planner_model(e),
            input=e.plan.input,
            nonlinear=e.plan.nonlinear,
            law=e.plan.law,
            robust=tuple(e.plan.robust),
            state_weights=e.plan.state_weights,
            input_weight=e.plan.input_weight,
            limits=Limits(
                speed_m_s=e.limits.speed_m_s, acceleration_m_s2=e.limits.acceleration_m_s2
            ),
        )
        return catalog.plan(e.experiment.planner, problem, timer)
    except PlanError as error:
        raise ConfigError(str(error)) from error


def prepare(
    experiment: Experiment, plan: Plan | None, plant: Plant, motion: Motion | None = None
) -> Job:
    """Check the plan and compose the settings of each task.

    motion replaces that of the plan (for the calibration tour). Raises Refused when the plan
    exceeds limits, workspace or envelope; nothing has started then.
    """
    if plan is not None and plan.reasons:
        raise Refused(f"the plan exceeds [limits]: {'; '.join(plan.reasons)}")
    _check_policy(experiment)
    links = planner_model(experiment).links_count
    if links != plant.links:
        raise Refused(
            f"[model] has {links} links, the load of [bench] has {plant.links}; they must be "
            "equal: give [model] links and [[bench.links]] alike, or [model] length_m and "
            "[bench.pendulum]; `rig plan --links` shows a plan without a bench"
        )
    watching = cameras(experiment)
    check_cameras(watching, plant.planes)
    record = _record(experiment, plan, motion or (plan.motion if plan else None))
    envelope = safety_envelope(experiment)
    _check_envelope(record, envelope)
    files = [camera_file.find(experiment, camera) for camera in watching]
    found = [
        calibration_file.find(experiment, camera, file.made if file else None)
        for camera, file in zip(watching, files, strict=True)
    ]
    calibrations = [calibration for _, calibration in found]
    if experiment.has_move and experiment.camera.rate_hz > 0:
        check_axes(record.positions_m, watching, files)
    robot = _robot(experiment, plant)
    check_joint_space(record, robot, experiment.robot)
    settings: dict[str, Any] = {
        "bench": plant.settings,
        "controller": _controller_settings(experiment, envelope, robot, len(watching)),
    }
    for camera, (name, calibration), file in zip(watching, found, files, strict=True):
        scene = static_scene.find(name, calibration)
        vision = vision_settings(experiment, camera, calibration, file, scene)
        if plan is not None:
            check_field_of_view(experiment, plan, vision)
        settings[vision_task(camera.number)] = vision
    settings["streamer"] = _streamer_settings(experiment, record, envelope, watching)
    if plant.has_drive:
        settings["bench"] = NodeSettings(
            drive=experiment.drive, plant=msgspec.to_builtins(plant.settings)
        )
        settings["drive"] = drive_settings(experiment.drive, envelope)
    return Job(
        experiment=experiment,
        plan=record,
        calibration_name=", ".join(name for name, _ in found),
        calibrations=calibrations,
        camera_files=files,
        settings=settings,
        stop_ns=run_out.duration_ns(envelope),
    )


def _check_policy(experiment: Experiment) -> None:
    if experiment.controller.policy == "source" and experiment.bench.kind != "simulated":
        raise Refused(
            "[controller] policy = 'source' asks for more than the envelope after lost references; "
            f"must be 'bounded' with [bench] kind = '{experiment.bench.kind}'"
        )


def _record(experiment: Experiment, plan: Plan | None, motion: Motion | None) -> PlanRecord:
    e = experiment.experiment
    time_s = motion.duration_s if motion else 0.0
    ticks = math.ceil((e.quiet_s + time_s) / (PERIOD_NS * 1e-9)) + 1
    t_s = np.arange(ticks) * (PERIOD_NS * 1e-9) - e.quiet_s
    if motion:
        positions = motion.at(t_s)
    else:
        start = [experiment.move.start_m if axis == experiment.move.axis else 0.0 for axis in AXES]
        positions = np.array([start])
    planner = e.planner if motion else "none"
    return PlanRecord(
        planner=plan.planner if plan else planner,
        distance_m=plan.problem.distance_m if plan else 0.0,
        time_s=time_s,
        quiet_s=e.quiet_s,
        watch_s=e.watch_s,
        positions_m=[(float(x), float(y), float(z)) for x, y, z in positions],
        metrics=_metrics(plan),
        period_ns=PERIOD_NS,
    )


def _metrics(plan: Plan | None) -> dict[str, float | bool] | None:
    if plan is None:
        return None
    return asdict(plan.metrics)


def safety_envelope(experiment: Experiment) -> Envelope:
    """Compose the envelope of [safety]; raises ConfigError for an empty range."""
    s = experiment.safety
    limits = experiment.limits
    if s.position_min_m >= s.position_max_m:
        raise ConfigError(
            f"[safety] position_min_m = {s.position_min_m}; "
            f"must be < position_max_m = {s.position_max_m}"
        )
    return Envelope(
        position_min_m=s.position_min_m,
        position_max_m=s.position_max_m,
        depth_m=s.depth_m,
        height_m=s.height_m,
        speed_m_s=s.speed_m_s or SAFETY_FACTOR * limits.speed_m_s,
        acceleration_m_s2=s.acceleration_m_s2 or SAFETY_FACTOR * limits.acceleration_m_s2,
    )


def _check_envelope(record: PlanRecord, envelope: Envelope) -> None:
    gate = Gate(envelope)
    for k, position in enumerate(record.positions_m):
        refusal = gate.refusal(k * PERIOD_NS, position)
        if refusal is not None:
            at_s = k * PERIOD_NS * 1e-9 - record.quiet_s
            raise Refused(
                f"the plan leaves the [safety] envelope {at_s:.2f} s into the move: {refusal}; "
                f"{'start it inside: move.start_m' if k == 0 else 'shorten or slow it'}"
            )


def _robot(experiment: Experiment, plant: Plant) -> RobotSettings:
    """Choose the kinematics of the controller; auto: by the kind of joints of the plant."""
    section = experiment.robot
    kinematics = plant.kinematics if section.kinematics == "auto" else section.kinematics
    return RobotSettings(kinematics=kinematics, home_z_m=section.home_z_m)


def _controller_settings(
    experiment: Experiment, envelope: Envelope, robot: RobotSettings, camera_count: int
) -> ControllerSettings:
    s = experiment.safety
    return ControllerSettings(
        reference_stale_ns=round(s.reference_stale_ms * MS),
        robot_stale_ns=round(s.robot_stale_ms * MS),
        policy=experiment.controller.policy,
        playout_ns=round(experiment.controller.playout_ms * MS),
        envelope=envelope,
        servo_lag_ns=round(s.servo_lag_ms * MS),
        following_error_m=s.following_error_mm * 1e-3,
        following_error_ns=round(s.following_error_ms * MS),
        robot=robot,
        cameras=camera_count,
    )


def _streamer_settings(
    experiment: Experiment, record: PlanRecord, envelope: Envelope, watching: list[Camera]
) -> StreamerSettings:
    tick_s = PERIOD_NS * 1e-9
    first = math.ceil(record.quiet_s / tick_s)
    last = math.ceil((record.quiet_s + record.time_s) / tick_s)
    watched = [_watched(experiment, camera) for camera in watching if camera.rate_hz > 0]
    return StreamerSettings(
        positions_m=record.positions_m,
        move_ticks=(first, last) if record.time_s else (0, 0),
        envelope=envelope,
        cameras=watched,
        robot_stale_ns=round(experiment.safety.robot_stale_ms * MS),
        natural_frequency_rad_s=planner_model(experiment).natural_frequency_rad_s,
        initial_swing_rad=experiment.safety.initial_swing_rad,
    )


def _watched(experiment: Experiment, camera: Camera) -> WatchedCamera:
    stale_s = max(experiment.safety.angle_stale_ms * 1e-3, STALE_PERIODS / camera.rate_hz)
    return WatchedCamera(number=camera.number, plane=camera.plane, stale_ns=round(stale_s * 1e9))
