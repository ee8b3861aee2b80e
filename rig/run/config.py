"""The experiment file: TOML in, one validated Experiment out.

An error names section, key, value and bound. `[model]` is the planner's model of the load.
`[bench.*]` holds the parameters of the simulated plant; rig/run/runtime/bench.py alone reads them.
"""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from comms.endpoints import PORTS
from comms.link import LinkFaults
from comms.udp import is_loopback
from rig.errors import ConfigError
from rig.run import links
from rig.run.controller_section import ControllerSection, RobotSection
from rig.run.drive_section import AxisDriveSection, CanSection, DriveSection
from rig.run.joint.sections import JointSection
from rig.run.toml_file import (
    Section,
    convert,
    nearest,
    override,
    read_toml,
)
from rig.run.vision_section import Pixel as Pixel
from rig.run.vision_section import VisionSection

Positive = Annotated[float, Meta(gt=0, le=1e6)]
NotNegative = Annotated[float, Meta(ge=0, le=1e6)]
Place = Annotated[float, Meta(ge=-10, le=10)]
Name = Annotated[str, Meta(pattern=r"^[A-Za-z0-9_\-]{1,60}\Z")]
MIN_PORT = 1024  # below it ports belong to the services of the system
MAX_BASE_PORT = 65_535 - PORTS + 1


class ExperimentSection(Section, frozen=True, kw_only=True):
    """`[experiment]`: name and kind of the run, planner, quiet and watched time."""

    name: Name
    kind: Literal["move", "free_decay", "joint"] = "move"
    planner: str = "matrix_exponential"
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 1
    quiet_s: Annotated[float, Meta(ge=0, le=600)] = 3.5
    watch_s: Annotated[float, Meta(ge=0.1, le=3600)] = 10.0
    purpose: str = ""


class MoveSection(Section, frozen=True, kw_only=True):
    """`[move]`: move from rest to rest along one axis, or through the points of a file."""

    axis: Literal["x", "y", "z"] = "x"  # y and z with camera files, or without a camera
    start_m: Place = 0.0
    distance_m: Place = 0.2
    # duration; with waypoints: of the whole path, unless the file has t_s
    time_s: Annotated[float, Meta(gt=0, le=600)] = 1.5
    # CSV file with x_m and optionally t_s, y_m, z_m; a relative path starts at the experiment file
    waypoints: str = ""
    spline: str = "b_spline_5"  # through the waypoints
    # distribution of time_s over the intervals between waypoints without t_s
    allocation: Literal["root", "proportional", "equal"] = "root"


class ModelSection(Section, frozen=True, kw_only=True):
    """`[model]`: the planner's model of the load: a cable, or with `links` a chain.

    The masses enter the force model and the chain only.
    """

    length_m: Positive | None = None  # of the cable; None = 1 m
    # chain instead of the cable, from the platform down: "length:mass:kind" in m and kg, kind bar
    # or point
    links: list[str] = []
    stiffness_n_m_rad: list[NotNegative] = []  # of each joint between links
    joint_damping_n_m_s_rad: list[NotNegative] = []
    tip_mass_kg: NotNegative = 0.0
    damping_ratio: Annotated[float, Meta(ge=0, lt=1)] = 0.0
    gravity_m_s2: Positive = 9.81
    mass_kg: Positive = 0.7
    cart_mass_kg: Positive = 32.0

    @property
    def cable_m(self) -> float:
        """Length of the cable [m]; 1 m where none is given."""
        return 1.0 if self.length_m is None else self.length_m


class PlanSection(Section, frozen=True, kw_only=True):
    """`[plan]`: options of the planner."""

    input: Literal["acceleration", "force", "jerk"] = "acceleration"
    nonlinear: bool = False  # plan with the nonlinear pendulum, not with its linearisation
    robust: list[str] = []  # parameters to whose error the end state has zero sensitivity
    law: str = "harmonic"
    # diagonal of Q, by state of the model, e.g. { speed_m_s = 1.0 }
    state_weights: dict[str, NotNegative] = {}
    input_weight: Positive = 1.0  # R


class LimitsSection(Section, frozen=True, kw_only=True):
    """`[limits]`: largest speed and acceleration of a plan."""

    speed_m_s: Positive = 1.0
    acceleration_m_s2: Positive = 5.0


class SafetySection(Section, frozen=True, kw_only=True):
    """`[safety]`: bounds on every reference, and ages at which data are stale.

    speed_m_s and acceleration_m_s2 default to 1.1 times [limits].
    """

    position_min_m: Place = -0.25  # along X
    position_max_m: Place = 0.25
    depth_m: Annotated[float, Meta(ge=0, le=10)] = 0.25  # bound on |y|
    height_m: Annotated[float, Meta(ge=0, le=10)] = 0.1  # bound on |z|
    speed_m_s: Positive | None = None
    acceleration_m_s2: Positive | None = None
    reference_stale_ms: Annotated[float, Meta(ge=30, le=60_000)] = 300.0
    robot_stale_ms: Annotated[float, Meta(ge=20, le=60_000)] = 100.0
    angle_stale_ms: Annotated[float, Meta(ge=100, le=60_000)] = 300.0
    # encoders against the setpoint servo_lag_ms before: largest distance, and for how long at most
    servo_lag_ms: Annotated[float, Meta(ge=0, le=1000)] = 20.0
    following_error_mm: Annotated[float, Meta(gt=0, le=10_000)] = 20.0
    following_error_ms: Annotated[float, Meta(ge=0, le=60_000)] = 50.0
    operator_silent_ms: Annotated[float, Meta(ge=150, le=60_000)] = 250.0  # three heartbeats
    # largest amplitude of the load before the move; a run with more is refused
    initial_swing_rad: Annotated[float, Meta(ge=0, le=1.6)] = 0.01


class CameraSection(Section, frozen=True, kw_only=True):
    """`[camera]`: size and rate of the pictures; rate_hz = 0 runs without a camera."""

    width: Annotated[int, Meta(ge=64, le=4096)] = 640
    height: Annotated[int, Meta(ge=64, le=4096)] = 480
    rate_hz: Annotated[float, Meta(ge=0, le=200)] = 50.0


class NetworkSection(Section, frozen=True, kw_only=True):
    """`[network]`: address, first port, and kind of the sockets that are not UDP.

    base_port = 0 takes free ports. bus: "ipc" for local sockets in a folder of this user, "tcp" for
    ports. Raises ValueError for ports that the system reserves or that do not exist, and for an
    address beyond this machine.
    """

    base_port: int = 0
    bind: str = "127.0.0.1"
    bus: Literal["ipc", "tcp"] = "ipc"

    def __post_init__(self) -> None:
        if not is_loopback(self.bind):
            raise ValueError(
                f"bind = {self.bind!r}; must be an address of this machine alone, 127.0.0.1 to "
                "127.255.255.254: the links have no keys, so none may be reached from outside"
            )
        if self.base_port and not MIN_PORT <= self.base_port <= MAX_BASE_PORT:
            raise ValueError(
                f"base_port = {self.base_port}; must be {MIN_PORT} to {MAX_BASE_PORT}, "
                f"the first of {PORTS} ports, or 0 for free ones"
            )


class RecordSection(Section, frozen=True, kw_only=True):
    """`[record]`: rate of the pictures in the log."""

    pictures_hz: Annotated[float, Meta(ge=0, le=50)] = 2.0


class AnalysisSection(Section, frozen=True, kw_only=True):
    """`[analysis]`: standard deviations of what the analysis cannot measure, and a band."""

    # of the scale of the angles, relative; None: 0.03 % after a calibration, and 1 - cos(pitch)
    # where the distance of the camera is not given; 0.5 % without one
    angle_scale_rel: Annotated[float, Meta(ge=0, le=0.5)] | None = None
    clock_ppm: Annotated[float, Meta(ge=0, le=1e4)] = 20.0
    gain_drift_rel: Annotated[float, Meta(ge=0, le=0.5)] = 1e-3  # of the scale within a record
    gravity_sigma_m_s2: Annotated[float, Meta(ge=0, le=1)] = 0.01
    settling_band_rad: Annotated[float, Meta(gt=0, le=1)] = (
        1e-3  # within which the load has settled
    )


class BenchSection(Section, frozen=True, kw_only=True):
    """`[bench]`: kind of plant; its tables are checked where the plant is built."""

    kind: Literal["simulated", "external"] = "simulated"
    pendulum: dict[str, Any] = {}
    links: list[dict[str, Any]] = []  # in place of the pendulum
    load: dict[str, Any] = {}  # what the links have in common
    pushes: list[dict[str, Any]] = []
    length_changes: list[dict[str, Any]] = []
    cable: dict[str, Any] | None = None  # vibration of the cable itself
    robot: dict[str, Any] = {}
    camera: dict[str, Any] = {}
    cameras: list[dict[str, Any]] = []  # in place of camera, one to three
    drive_faults: list[dict[str, Any]] = []  # of a robot with a drive
    # by how much every clock of the rig runs fast against true time, in which the load swings
    clock_ppm: Annotated[float, Meta(ge=-1000, le=1000)] = 0.0


class Experiment(Section, frozen=True, kw_only=True):
    """Contents of an experiment file."""

    experiment: ExperimentSection
    move: MoveSection = MoveSection()
    model: ModelSection = ModelSection()
    plan: PlanSection = PlanSection()
    limits: LimitsSection = LimitsSection()
    safety: SafetySection = SafetySection()
    robot: RobotSection = RobotSection()
    controller: ControllerSection = ControllerSection()
    camera: CameraSection = CameraSection()
    vision: VisionSection = VisionSection()
    links: dict[str, LinkFaults] = {}
    network: NetworkSection = NetworkSection()
    record: RecordSection = RecordSection()
    can: CanSection = CanSection()
    analysis: AnalysisSection = AnalysisSection()
    drive: AxisDriveSection = AxisDriveSection()
    joint: JointSection | None = None  # of the kind joint
    bench: BenchSection = BenchSection()

    @property
    def node(self) -> DriveSection:
        """Drive on the field bus."""
        return self.drive if self.joint is None else self.joint.drive

    @property
    def has_move(self) -> bool:
        """True when platform or joint moves in this run."""
        return self.experiment.kind != "free_decay"


def shipped() -> list[str]:
    """List the names of the experiments that come with the program."""
    return sorted(name.removesuffix(".toml") for name in _toml_files("experiments"))


def shipped_calibrations() -> list[str]:
    """List the files of the calibrations that come with the program, oldest first."""
    return _toml_files("calibration")


def read_shipped_calibration(name: str) -> dict[str, Any]:
    """Read the tables of a calibration that comes with the program."""
    return tomllib.loads((_folder("calibration") / name).read_text())


def read_experiment(name_or_path: str, overrides: list[str]) -> Experiment:
    """Read an experiment by shipped name or TOML file, with `section.key=value` overrides.

    Raises ConfigError naming section, key, value, bound and the nearest known key.
    """
    tables = read_tables(name_or_path)
    links.rename(tables.get("links"))
    for text in overrides:
        override(tables, links.renamed(text))
    links.check(tables.get("links"))
    experiment = convert(tables, Experiment)
    beside = Path(name_or_path).parent / experiment.move.waypoints
    if not (experiment.move.waypoints and beside.is_file()):
        return experiment
    move = msgspec.structs.replace(experiment.move, waypoints=str(beside.resolve()))
    return msgspec.structs.replace(experiment, move=move)


def _folder(name: str) -> Any:
    return resources.files("rig.run") / name


def _toml_files(folder: str) -> list[str]:
    names = [file.name for file in _folder(folder).iterdir()]
    return sorted(name for name in names if name.endswith(".toml"))


def read_tables(name_or_path: str) -> dict[str, Any]:
    """Read the tables of an experiment by shipped name or TOML file; raises ConfigError."""
    path = Path(name_or_path)
    known = shipped()
    if name_or_path in known:
        return tomllib.loads((_folder("experiments") / f"{name_or_path}.toml").read_text())
    if path.is_file():
        return read_toml(path, "experiment")
    if path.is_dir():
        raise ConfigError(
            f"experiment '{name_or_path}': a folder; must be a TOML file or a shipped experiment "
            f"(`rig run --list`); a recorded run is shown by `rig analyze {name_or_path}`"
        )
    raise ConfigError(
        f"experiment '{name_or_path}': no such file and not a shipped experiment"
        f"{nearest(name_or_path, known)}; `rig run --list` names the shipped ones"
    )
