"""Door to the simulated plant: `[bench.*]` in, a task or its settings out.

Other modules of rig/run do not import sim_rig.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from comms.channels import MAX_CAMERAS
from comms.task import Task
from rig.errors import ConfigError, Refused
from rig.run.config import BenchSection, Experiment
from rig.run.job import Plant, safety_envelope
from rig.run.tasks.controller.joints import Kinematics
from rig.run.tasks.controller.task import COUNTING_POLICY
from rig.run.toml_file import convert
from rig.run.units import CABLE, SWING, suspect
from sim_rig.ball_screw_params import BallScrewParams
from sim_rig.camera_params import CameraParams
from sim_rig.can_bench import CanBench
from sim_rig.drive_faults import DriveFault
from sim_rig.drive_logic import DriveLogic, DriveReading
from sim_rig.input_check import InputBounds
from sim_rig.joint_params import PARAMETER_SETS, Joint
from sim_rig.load import Load
from sim_rig.load_params import CableParams, LengthChange, LinkParams, LoadParams, Push
from sim_rig.params import BenchParams, PendulumParams, RobotParams, View
from sim_rig.quattro_params import QuattroParams
from sim_rig.task import BenchTask

CARTESIAN, QUATTRO = "cartesian", "quattro"
BALL_SCREW, ELASTIC_JOINT = "ball_screw", "elastic_joint"
ROBOTS = (CARTESIAN, QUATTRO, BALL_SCREW, ELASTIC_JOINT)
DriveSensors = DriveReading  # what the logic of a drive is given at a sample


def params(experiment: Experiment) -> BenchParams:
    """Read the parameters of the plant; raises ConfigError naming section, key, value and bound."""
    bench, view = experiment.bench, experiment.camera
    if bench.kind != "simulated":
        raise Refused(
            "[bench] kind = 'external': there is no driver for an external plant; "
            "must be 'simulated'"
        )
    _check_load(bench)
    robot = RobotParams()
    axis = joint = quattro = None
    kind = robot_kind(experiment)
    if kind == ELASTIC_JOINT:
        joint = _joint(bench.robot)
    elif kind == BALL_SCREW:
        axis = convert(_without_kind(bench.robot), BallScrewParams, "bench.robot")
        robot = RobotParams(start_m=axis.start_m)
    elif kind == QUATTRO:
        quattro = convert(_without_kind(bench.robot), QuattroParams, "bench.robot")
        robot = RobotParams(start_m=quattro.start_m)
    else:
        robot = convert(_without_kind(bench.robot), RobotParams, "bench.robot")
    rate_hz = 0.0 if joint is not None else view.rate_hz
    try:
        found = BenchParams(
            axis=axis,
            joint=joint,
            quattro=quattro,
            drive_faults=_drive_faults(experiment),
            pendulum=convert(bench.pendulum, PendulumParams, "bench.pendulum"),
            links=tuple(convert(link, LinkParams, "bench.links") for link in bench.links),
            load=convert(bench.load, LoadParams, "bench.load"),
            pushes=tuple(convert(push, Push, "bench.pushes") for push in bench.pushes),
            cable=None if bench.cable is None else convert(bench.cable, CableParams, "bench.cable"),
            length_changes=tuple(
                convert(change, LengthChange, "bench.length_changes")
                for change in bench.length_changes
            ),
            robot=robot,
            cameras=_cameras(bench),
            clock_ppm=bench.clock_ppm,
            view=View(width=view.width, height=view.height, rate_hz=rate_hz),
            seed=experiment.experiment.seed,
        )
        Load(found)  # what the simulation cannot hold is said here
    except ValueError as error:
        raise ConfigError(str(error)) from None
    return found


def plant(experiment: Experiment) -> Plant:
    """Describe the plant for the checks before a run. Raises ConfigError as params() does."""
    settings = msgspec.structs.replace(params(experiment), input=_input_bounds(experiment))
    kinematics: Kinematics = "axes" if settings.quattro is None else "quattro"
    return Plant(
        settings,
        max(1, len(settings.links)),
        has_drive(experiment),
        kinematics,
        tuple(camera.plane for camera in settings.cameras),
    )


def has_drive(experiment: Experiment) -> bool:
    """Tell if the robot has a drive on the field bus. Raises ConfigError."""
    return robot_kind(experiment) in (BALL_SCREW, ELASTIC_JOINT)


def robot_kind(experiment: Experiment) -> str:
    """Read the kind of robot, which is that of the experiment. Raises ConfigError."""
    kind = experiment.bench.robot.get("kind", CARTESIAN)
    if kind not in ROBOTS:
        raise ConfigError(
            f"[bench.robot] kind = {kind!r}; must be one of {', '.join(ROBOTS)}: correct the value"
        )
    is_joint = experiment.experiment.kind == "joint"
    if is_joint != (kind == ELASTIC_JOINT):
        raise ConfigError(
            f"[bench.robot] kind = {kind!r} with [experiment] kind = "
            f"{experiment.experiment.kind!r}; an elastic joint, and only that, must have "
            "experiments of the kind joint: change one of the two"
        )
    return str(kind)


def _check_load(bench: BenchSection) -> None:
    """Refuse two descriptions of the load, and numbers that look like those of another unit."""
    if bench.links and bench.pendulum:
        raise ConfigError(
            "[[bench.links]] beside [bench.pendulum]; must be one of the two, as each describes "
            "the whole load: remove one"
        )
    if bench.load and not bench.links:
        raise ConfigError(
            "[bench.load] without [[bench.links]]; must be with links: give gravity and damping "
            "of one link in [bench.pendulum]"
        )
    rows = [("[bench.pendulum] length_m", bench.pendulum.get("length_m"), CABLE)]
    rows += [("[bench.pendulum] initial_swing_rad", bench.pendulum.get("initial_swing_rad"), SWING)]
    rows += [("[[bench.links]] length_m", link.get("length_m"), CABLE) for link in bench.links]
    for name, value, usual in rows:
        if isinstance(value, int | float):
            suspect(f"{name} =", value, usual)


def _cameras(bench: BenchSection) -> tuple[CameraParams, ...]:
    """Read the cameras: [bench.camera] is the short form of one."""
    if bench.cameras and bench.camera:
        raise ConfigError(
            "[[bench.cameras]] beside [bench.camera]; must be one of the two, as each describes "
            "all cameras: remove one"
        )
    tables = bench.cameras or [bench.camera]
    if len(tables) > MAX_CAMERAS:
        raise ConfigError(
            f"{len(tables)} of [[bench.cameras]]; must be at most {MAX_CAMERAS}: remove some"
        )
    name = "bench.cameras" if bench.cameras else "bench.camera"
    return tuple(convert(table, CameraParams, name) for table in tables)


def _drive_faults(experiment: Experiment) -> tuple[DriveFault, ...]:
    tables = experiment.bench.drive_faults
    if tables and not has_drive(experiment):
        raise ConfigError(
            "[[bench.drive_faults]] of a robot without a drive; must be with [bench.robot] kind = "
            "'ball_screw': remove them, or change the kind"
        )
    faults = tuple(convert(table, DriveFault, "bench.drive_faults") for table in tables)
    for fault in faults:
        if fault.step_m and robot_kind(experiment) == ELASTIC_JOINT:
            raise ConfigError(
                f"[[bench.drive_faults]] step_m = {fault.step_m:g} of a joint; must be 0: give "
                "step_rad, the angle of the motor"
            )
    return faults


def _joint(robot: dict[str, Any]) -> Joint:
    """Read an elastic joint; its keys replace those of the parameter set that it names."""
    keys = _without_kind(robot)
    name = keys.pop("parameters", "listed")
    if name not in PARAMETER_SETS:
        raise ConfigError(
            f"[bench.robot] parameters = {name!r}; must be one of {', '.join(PARAMETER_SETS)}: "
            "correct the value"
        )
    return convert(PARAMETER_SETS[name] | keys, Joint, "bench.robot")


def _without_kind(robot: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in robot.items() if key != "kind"}


def _input_bounds(experiment: Experiment) -> InputBounds:
    envelope = safety_envelope(experiment)
    return InputBounds(
        lower_m=(envelope.position_min_m, -envelope.depth_m, -envelope.height_m),
        upper_m=(envelope.position_max_m, envelope.depth_m, envelope.height_m),
        speed_m_s=envelope.speed_m_s,
        acceleration_m_s2=envelope.acceleration_m_s2,
        stops=experiment.controller.policy != COUNTING_POLICY,
    )


def task(settings: Any) -> Task:
    """Make the simulated plant a task of this process."""
    return BenchTask(msgspec.convert(msgspec.to_builtins(settings), BenchParams))


def drive_task(settings: Any, make_logic: Callable[[], DriveLogic]) -> Task:
    """Make the simulated plant with a drive a task of this process.

    make_logic: makes the logic of the drive, powered off.
    """
    params = msgspec.convert(msgspec.to_builtins(settings), BenchParams)
    plant = CanBench(params, make_logic)
    return BenchTask(params, plant.make_bench, plant)
