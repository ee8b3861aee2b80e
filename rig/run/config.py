"""The experiment file: TOML in, one validated Experiment out; a wrong key or value is named with its bound.

`[model]` is what the planner believes. `[bench.*]` is what the simulated world is; it is read by
rig/run/runtime/bench.py alone.
"""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from comms.channels import DATA
from comms.link import LinkFaults
from rig.errors import ConfigError
from rig.run.toml_file import Section, convert, nearest, override, read_toml

Positive = Annotated[float, Meta(gt=0, le=1e6)]
NotNegative = Annotated[float, Meta(ge=0, le=1e6)]
Place = Annotated[float, Meta(ge=-10, le=10)]
Pixel = Annotated[float, Meta(ge=-1e5, le=1e5)]
Name = Annotated[str, Meta(pattern=r"^[A-Za-z0-9_\-]{1,60}$")]


class ExperimentSection(Section, frozen=True, kw_only=True):
    """`[experiment]`: what is run, with which planner, and how long it is watched."""

    name: Name
    kind: Literal["move", "free_decay"] = "move"
    planner: str = "matrix_exponential"
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 1
    quiet_s: Annotated[float, Meta(ge=0, le=600)] = 3.5
    watch_s: Annotated[float, Meta(ge=0.1, le=3600)] = 10.0
    purpose: str = ""


class MoveSection(Section, frozen=True, kw_only=True):
    """`[move]`: rest to rest along one axis, or through the points of a file along three."""

    axis: Literal["x"] = "x"
    start_m: Place = 0.0
    distance_m: Place = 0.2
    time_s: Annotated[float, Meta(gt=0, le=600)] = (
        1.5  # with waypoints: of all, unless the file has t_s
    )
    waypoints: str = ""  # CSV file with x_m and if wanted t_s, y_m, z_m; a relative path starts at the experiment file
    spline: str = "b_spline_5"  # through the waypoints
    allocation: Literal["root", "proportional", "equal"] = (
        "root"  # of the time between waypoints without t_s
    )


class ModelSection(Section, frozen=True, kw_only=True):
    """`[model]`: the planner's belief: a cable, or with `links` a chain; masses matter to the force model and to chains."""

    length_m: Annotated[float, Meta(gt=0, le=100)] | None = None  # of the cable, 1 m unless told
    links: list[
        str
    ] = []  # instead of the cable: from the platform down, each "length:mass:kind" in m and kg, kind bar or point
    stiffness_n_m_rad: list[NotNegative] = []  # of each joint between links
    joint_damping_n_m_s_rad: list[NotNegative] = []
    tip_mass_kg: NotNegative = 0.0
    damping_ratio: Annotated[float, Meta(ge=0, lt=1)] = 0.0
    gravity_m_s2: Positive = 9.81
    mass_kg: Positive = 0.7
    cart_mass_kg: Positive = 32.0

    @property
    def cable_m(self) -> float:
        """Length of the cable when the load hangs on one."""
        return 1.0 if self.length_m is None else self.length_m


class PlanSection(Section, frozen=True, kw_only=True):
    """`[plan]`: options of the planner."""

    input: Literal["acceleration", "force", "jerk"] = "acceleration"
    nonlinear: bool = False  # plan for the true pendulum instead of its small swings
    robust: list[str] = []  # parameters whose error the plan should forgive
    law: str = "harmonic"
    state_weights: dict[
        str, NotNegative
    ] = {}  # Q's diagonal, by the model's states, e.g. { speed_m_s = 1.0 }
    input_weight: Positive = 1.0  # R


class LimitsSection(Section, frozen=True, kw_only=True):
    """`[limits]`: what a plan may ask of the robot."""

    speed_m_s: Positive = 1.0
    acceleration_m_s2: Positive = 5.0


class SafetySection(Section, frozen=True, kw_only=True):
    """`[safety]`: checked on every reference; speed and acceleration default to 1.1 x limits."""

    position_min_m: Place = -0.25  # along X
    position_max_m: Place = 0.25
    depth_m: Annotated[float, Meta(ge=0, le=10)] = 0.25  # how far Y may leave 0
    height_m: Annotated[float, Meta(ge=0, le=10)] = 0.1  # and Z
    speed_m_s: Positive | None = None
    acceleration_m_s2: Positive | None = None
    reference_stale_ms: Annotated[float, Meta(ge=30, le=60_000)] = 300.0
    robot_stale_ms: Annotated[float, Meta(ge=20, le=60_000)] = 100.0
    angle_stale_ms: Annotated[float, Meta(ge=100, le=60_000)] = 300.0
    initial_swing_rad: Annotated[float, Meta(ge=0, le=1.6)] = (
        0.01  # a load swinging more before the start is refused
    )


class CameraSection(Section, frozen=True, kw_only=True):
    """`[camera]`: facts shared by both sides; rate_hz = 0 runs without a camera."""

    width: Annotated[int, Meta(ge=64, le=4096)] = 640
    height: Annotated[int, Meta(ge=64, le=4096)] = 480
    rate_hz: Annotated[float, Meta(ge=0, le=200)] = 50.0


class VisionSection(Section, frozen=True, kw_only=True):
    """`[vision]`: the tracker's settings; calibration = a file, "shipped", or "none" (rough_* are used then)."""

    calibration: str = "shipped"
    average_frames: Annotated[int, Meta(ge=1, le=50)] = 3
    processing_ms: Annotated[float, Meta(ge=0, le=1000)] = 2.0
    rough_pivot_px: tuple[Pixel, Pixel] = (321.0, -38.0)  # by eye, before any calibration
    rough_pixels_per_m: Positive = 1005.0


class NetworkSection(Section, frozen=True, kw_only=True):
    """`[network]`: base_port = 0 takes free ports."""

    base_port: Annotated[int, Meta(ge=0, le=65_000)] = 0
    bind: str = "127.0.0.1"


class RecordSection(Section, frozen=True, kw_only=True):
    """`[record]`: pictures a second in the log."""

    pictures_hz: Annotated[float, Meta(ge=0, le=50)] = 2.0


class BenchSection(Section, frozen=True, kw_only=True):
    """`[bench]`: the world's tables are only checked by the one who builds it."""

    kind: Literal["simulated", "external"] = "simulated"
    pendulum: dict[str, Any] = {}
    robot: dict[str, Any] = {}
    camera: dict[str, Any] = {}


class Experiment(Section, frozen=True, kw_only=True):
    """A whole experiment file."""

    experiment: ExperimentSection
    move: MoveSection = MoveSection()
    model: ModelSection = ModelSection()
    plan: PlanSection = PlanSection()
    limits: LimitsSection = LimitsSection()
    safety: SafetySection = SafetySection()
    camera: CameraSection = CameraSection()
    vision: VisionSection = VisionSection()
    links: dict[str, LinkFaults] = {}
    network: NetworkSection = NetworkSection()
    record: RecordSection = RecordSection()
    bench: BenchSection = BenchSection()

    @property
    def moves(self) -> bool:
        """Whether the platform is to move at all."""
        return self.experiment.kind == "move"


def shipped() -> list[str]:
    """Names of the experiments that come with the program."""
    return sorted(
        p.name.removesuffix(".toml")
        for p in _folder("experiments").iterdir()
        if p.name.endswith(".toml")
    )


def shipped_calibrations() -> list[str]:
    """File names of the calibrations that come with the program, oldest first."""
    return sorted(p.name for p in _folder("calibration").iterdir() if p.name.endswith(".toml"))


def read_shipped_calibration(name: str) -> dict[str, Any]:
    """A calibration that comes with the program."""
    return tomllib.loads((_folder("calibration") / name).read_text())


def load(name_or_path: str, overrides: list[str]) -> Experiment:
    """The experiment of a shipped name or a TOML file, with `section.key=value` overrides.

    Raises ConfigError naming section, key, value, bound and the nearest known key.
    """
    tables = _read(name_or_path)
    for text in overrides:
        override(tables, text)
    _check_links(tables.get("links"))
    experiment = convert(tables, Experiment)
    beside = Path(name_or_path).parent / experiment.move.waypoints
    if not (experiment.move.waypoints and beside.is_file()):
        return experiment
    move = msgspec.structs.replace(experiment.move, waypoints=str(beside.resolve()))
    return msgspec.structs.replace(experiment, move=move)


def _check_links(links: Any) -> None:
    """What the types cannot say: a link is a channel. A `links` that is no table is left to them."""
    for name, faults in links.items() if isinstance(links, dict) else ():
        if name not in DATA:
            raise ConfigError(
                f"[links.{name}]: no such link{nearest(name, DATA)}; links: {', '.join(DATA)}"
            )
        convert(faults, LinkFaults, f"links.{name}")


def _folder(name: str) -> Any:
    return resources.files("rig.run") / name


def _read(name_or_path: str) -> dict[str, Any]:
    path = Path(name_or_path)
    if name_or_path in shipped():
        return tomllib.loads((_folder("experiments") / f"{name_or_path}.toml").read_text())
    if path.is_file():
        return read_toml(path, "experiment")
    raise ConfigError(
        f"experiment '{name_or_path}': no such file and not a shipped experiment{nearest(name_or_path, shipped())}; "
        f"shipped: {', '.join(shipped())}"
    )
