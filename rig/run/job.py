"""The job of a run: plan on the 10 ms grid, settings of each task, and checks before the start."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from comms.channels import MS
from comms.plan_record import PlanRecord
from planners import catalog
from planners.errors import PlanError
from planners.problem import Limits, Plan, Problem
from planners.trajectories.motion import AXES, Motion
from rig.errors import ConfigError, Refused
from rig.run.calibration import file as calibration_file
from rig.run.config import Experiment
from rig.run.drive_settings import drive_settings
from rig.run.field_of_view import check_field_of_view
from rig.run.joint_space import check_joint_space
from rig.run.load_model import planner_model
from rig.run.node_settings import NodeSettings
from rig.run.tasks import run_out
from rig.run.tasks.controller.joints import Kinematics, RobotSettings
from rig.run.tasks.controller.task import ControllerSettings
from rig.run.tasks.safety import Envelope, Gate
from rig.run.tasks.streamer import PERIOD_NS, StreamerSettings
from rig.run.waypoints import plan_through, read_waypoints
from vision.task import VisionSettings

SAFETY_FACTOR = 1.1  # times the limits of the plan, where [safety] has no bound
IDLE_CAMERA_RATE_HZ = 50.0  # setting of the idle vision task in a run without a camera


class Job(msgspec.Struct, frozen=True, kw_only=True):
    """Input of a runner."""

    experiment: Experiment
    plan: PlanRecord
    calibration_name: str
    calibration: calibration_file.Calibration | None
    settings: dict[str, Any]  # by task name
    stop_ns: int = 0  # longest time of a stop
    command: str = ""  # as typed, for the log; "" where no terminal started the run

    def attachments(self) -> dict[str, bytes]:
        """Encode the files attached to the log."""
        encode = msgspec.json.encode
        calibration = b""
        if self.calibration:
            calibration = calibration_file.text(self.calibration).encode()
        files = {
            "experiment.json": encode(self.experiment),
            "plan.json": encode(self.plan),
            "bench.json": encode(_plant(self.settings["bench"])),
            "drive.json": encode(self.settings.get("drive")),
            "calibration.toml": calibration,
        }
        present = (name for name in ("controller", "vision") if name in self.settings)
        return files | {f"{name}.json": encode(self.settings[name]) for name in present}


class Plant(NamedTuple):
    """Plant of a run: settings of its task, links of its load, if it has a drive, its joints."""

    settings: Any
    links: int
    has_drive: bool = False
    kinematics: Kinematics = "axes"


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
    _check_axis(experiment)
    links = planner_model(experiment).links_count
    if links != plant.links:
        raise Refused(
            f"[model] has {links} links, the load of [bench] has {plant.links}; they must be "
            "equal: give [model] links and [[bench.links]] alike, or [model] length_m and "
            "[bench.pendulum]; `rig plan --links` shows a plan without a bench"
        )
    record = _record(experiment, plan, motion or (plan.motion if plan else None))
    envelope = safety_envelope(experiment)
    _check_envelope(record, envelope)
    name, calibration = calibration_file.find(experiment)
    robot = _robot(experiment, plant)
    check_joint_space(record, robot, experiment.robot)
    vision = _vision_settings(experiment, calibration)
    if plan is not None:
        check_field_of_view(experiment, plan, vision)
    settings: dict[str, Any] = {
        "bench": plant.settings,
        "controller": _controller_settings(experiment, envelope, robot),
        "vision": vision,
        "streamer": _streamer_settings(experiment, record, envelope),
    }
    if plant.has_drive:
        settings["bench"] = NodeSettings(
            drive=experiment.drive, plant=msgspec.to_builtins(plant.settings)
        )
        settings["drive"] = drive_settings(experiment.drive, envelope)
    return Job(
        experiment=experiment,
        plan=record,
        calibration_name=name,
        calibration=calibration,
        settings=settings,
        stop_ns=run_out.duration_ns(envelope),
    )


def _check_axis(experiment: Experiment) -> None:
    """Refuse a move that the camera cannot judge."""
    move, camera = experiment.move, experiment.camera
    if not experiment.has_move or move.waypoints or move.axis == "x":
        return
    if camera.rate_hz > 0:
        raise Refused(
            f"[move] axis = '{move.axis}' with a camera, which sees the swing along x alone; must "
            "be without: --set camera.rate_hz=0"
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
    experiment: Experiment, envelope: Envelope, robot: RobotSettings
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
    )


def _vision_settings(
    experiment: Experiment, calibration: calibration_file.Calibration | None
) -> VisionSettings:
    v = experiment.vision
    return VisionSettings(
        width=experiment.camera.width,
        height=experiment.camera.height,
        period_ns=round(1e9 / (experiment.camera.rate_hz or IDLE_CAMERA_RATE_HZ)),
        average_frames=v.average_frames,
        processing_ns=round(v.processing_ms * MS),
        pivot_home_px=calibration.pivot_home_px if calibration else v.rough_pivot_px,
        pixels_per_m=calibration.pixels_per_m if calibration else v.rough_pixels_per_m,
        x_m=calibration.x_m if calibration else [],
        offset_rad=calibration.offset_rad if calibration else [],
    )


def _streamer_settings(
    experiment: Experiment, record: PlanRecord, envelope: Envelope
) -> StreamerSettings:
    tick_s = PERIOD_NS * 1e-9
    first = math.ceil(record.quiet_s / tick_s)
    last = math.ceil((record.quiet_s + record.time_s) / tick_s)
    angle_stale_ns = 0
    if experiment.camera.rate_hz > 0:
        angle_stale_ns = round(experiment.safety.angle_stale_ms * MS)
    return StreamerSettings(
        positions_m=record.positions_m,
        move_ticks=(first, last) if record.time_s else (0, 0),
        envelope=envelope,
        angle_stale_ns=angle_stale_ns,
        robot_stale_ns=round(experiment.safety.robot_stale_ms * MS),
        natural_frequency_rad_s=planner_model(experiment).natural_frequency_rad_s,
        initial_swing_rad=experiment.safety.initial_swing_rad,
    )
