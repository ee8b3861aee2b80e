"""A comparison of drive controllers: moves, belief, gains, and the truths they are tried on; from a TOML file."""

from __future__ import annotations

import math
import tomllib
import warnings
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from planners.laws.trapezoidal import trapezoidal_by_acceleration
from planners.trajectories.trajectory import Trajectory
from rig.drives.servo.two_mass import TwoMass
from rig.errors import ConfigError, RenamedKey
from rig.run.toml_file import Section, convert, nearest, override, read_toml, rename_keys

SHIPPED = "source_001"
NEW_NAMES = {"helpers": "compensators"}  # tables by their old name, which still works
MIN_MOVE_SAMPLES = 10  # samples of a move
REQUIRED_KEYS = (
    "motor_inertia_kg_m2",
    "load_inertia_kg_m2",
    "stiffness_n_m_rad",
    "gear_ratio",
)  # of a bench
FRICTIONLESS = dict.fromkeys(
    ("motor_friction_n_m_s_rad", "load_friction_n_m_s_rad", "elastic_damping_n_m_s_rad"), 0.0
)
Positive = Annotated[float, Meta(gt=0, le=1e12)]
NotNegative = Annotated[float, Meta(ge=0, le=1e12)]
Share = Annotated[float, Meta(gt=0, le=1e3)]


class TrapezoidSection(Section, frozen=True, kw_only=True):
    """`[[move]]`: a trapezoid of speed, from rest to rest. Raises ValueError for one that does not move."""

    load_angle_deg: Annotated[float, Meta(ge=-1e6, le=1e6)]
    time_s: Annotated[float, Meta(gt=0, le=60)]
    motor_acceleration_rad_s2: Positive

    def __post_init__(self) -> None:
        if not self.load_angle_deg:
            raise ValueError(
                "load_angle_deg = 0 is no move; must be another angle: give it a sign for the direction"
            )

    @property
    def title(self) -> str:
        """As a table names it."""
        return f"{self.load_angle_deg:g}° in {self.time_s:g} s"

    def trajectory(self, gear_ratio: float) -> Trajectory:
        """Angle of the motor [rad]. Raises ConfigError for an acceleration that is too low for the time."""
        angle_rad = math.radians(self.load_angle_deg) * gear_ratio
        least = 4.0 * abs(angle_rad) / self.time_s**2
        if self.motor_acceleration_rad_s2 < least * (1.0 - 1e-12):
            raise ConfigError(
                f"[[move]] motor_acceleration_rad_s2 = {self.motor_acceleration_rad_s2:g} for {self.title} by a gear of ratio "
                f"{gear_ratio:g}; must be >= {least:.6g}: raise it, or give the move more time"
            )
        return trapezoidal_by_acceleration(
            angle_rad, self.time_s, self.motor_acceleration_rad_s2
        ).trajectory()


class JointModelSection(Section, frozen=True, kw_only=True):
    """`[model]`: what the controllers believe of the joint; see rig.drives.servo.two_mass.TwoMass."""

    motor_inertia_kg_m2: float
    load_inertia_kg_m2: float
    stiffness_n_m_rad: float
    gear_ratio: float = 1.0
    motor_friction_n_m_s_rad: float = 0.0
    load_friction_n_m_s_rad: float = 0.0
    elastic_damping_n_m_s_rad: float = 0.0


class DriveSection(Section, frozen=True, kw_only=True):
    """`[drive]`: sample time, the limit every controller knows, and what an ampere makes."""

    period_s: Annotated[float, Meta(gt=0, le=0.1)] = 0.001
    torque_limit_n_m: Annotated[float, Meta(gt=0)] = math.inf
    torque_constant_n_m_a: Positive | None = None


class PidSection(Section, frozen=True, kw_only=True):
    """`[pid]`: P on the position, PI on the speed, in shares of omega_z; the reset time in 1 / omega_z."""

    speed_crossover: Share = 0.7
    position_crossover: Share = 0.15
    reset_time: Share = 10.0
    feed_forward: Annotated[float, Meta(ge=0, le=10)] = (
        1.0  # of pid_ff: share of the rigid inertia that it feeds ahead
    )


class LqgSection(Section, frozen=True, kw_only=True):
    """`[lqg]`: weights of [qm, qm', n ql, n ql', integral of the error] and of the torque; what the Kalman filter is told."""

    state_weights: tuple[NotNegative, NotNegative, NotNegative, NotNegative, NotNegative] = (
        50.0,
        0.0,
        50.0,
        0.001,
        20000.0,
    )
    torque_weight: Positive = 1.0
    torque_noise_n2_m2_s: Positive = (
        2.5e-6  # density of white torques on motor and load: 0.05 N m, a new value each ms
    )
    encoder_counts_per_rev: Annotated[int, Meta(ge=1, le=2**40)] = 8192
    corner_rad_s: Positive = 150.0  # of the filter in lqg_ff


class AssignedSection(Section, frozen=True, kw_only=True):
    """`[assigned]`: eigenvalues, as pairs of real and imaginary part; of a conjugate pair both."""

    poles_1_s: tuple[tuple[float, float], ...] = (
        (-60.0, 60.0),
        (-60.0, -60.0),
        (-105.0, 105.0),
        (-105.0, -105.0),
        (-40.0, 0.0),
    )
    estimator_poles_1_s: tuple[tuple[float, float], ...] = (
        (-400.0, 400.0),
        (-400.0, -400.0),
        (-300.0, 100.0),
        (-300.0, -100.0),
    )


class CompensatorsSection(Section, frozen=True, kw_only=True):
    """`[helpers]`: what stands beside a P/PI cascade in pid_notch, pid_observer and pid_shaped."""

    notch_damping: Share = 1.0  # of the poles it puts in place of the joint's
    observer_time_s: Positive = (
        0.02  # faster ones let the load ring under this cascade: 5 ms leaves a damping of 0.10
    )
    shaper: str = "zv"


class ServoSpec(Section, frozen=True, kw_only=True):
    """A whole file. Truths are `[bench]` with what each says otherwise; only rig.studies.servo.bench reads them."""

    move: Annotated[list[TrapezoidSection], Meta(min_length=1, max_length=20)]
    model: JointModelSection
    bench: dict[str, Any]
    truth: dict[str, dict[str, Any]] = msgspec.field(default_factory=lambda: {"bench": {}})
    drive: DriveSection = DriveSection()
    pid: PidSection = PidSection()
    lqg: LqgSection = LqgSection()
    assigned: AssignedSection = AssignedSection()
    compensators: CompensatorsSection = CompensatorsSection()
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 1
    rest_s: Annotated[float, Meta(ge=0.01, le=60)] = (
        0.2  # before each move, for the accelerometer's bias; the bench begins here
    )
    watch_s: Annotated[float, Meta(ge=0.05, le=60)] = 0.5

    def __post_init__(self) -> None:
        for number, move in enumerate(self.move):
            if move.time_s < MIN_MOVE_SAMPLES * self.drive.period_s:
                raise ValueError(
                    f"move.{number}.time_s = {move.time_s} with drive.period_s = {self.drive.period_s}; must be at least "
                    f"{MIN_MOVE_SAMPLES} samples: sample faster, or give the move more time"
                )

    @property
    def joint(self) -> TwoMass:
        """The belief. Raises ServoError for a value out of bounds."""
        return TwoMass(**msgspec.structs.asdict(self.model))

    def plant_variant_tables(self, name: str) -> dict[str, Any]:
        """What the bench is made of. Raises ConfigError for a truth that the file has not, or that lacks what any joint has."""
        if name not in self.truth:
            raise ConfigError(
                f"--truth {name!r}: not in the file{nearest(name, self.truth)}; known: {', '.join(self.truth)}"
            )
        told = FRICTIONLESS | self.bench | self.truth[name]
        for key in REQUIRED_KEYS:
            if key not in told:
                raise ConfigError(f"[bench] {key}: missing; add it")
        if told["gear_ratio"] != self.model.gear_ratio:
            raise ConfigError(
                f"[bench] gear_ratio = {told['gear_ratio']} with [model] gear_ratio = {self.model.gear_ratio}; must be the "
                "same: teeth are counted, not estimated"
            )
        return told


def read_spec(path: Path | None, overrides: Sequence[str] = ()) -> ServoSpec:
    """The shipped comparison or a file, with `section.key=value` overrides.

    Raises ConfigError naming section, key, value, bound and the nearest known key.
    """
    tables = read_toml(path, "servo comparison") if path else _shipped()
    rename_keys(tables, NEW_NAMES)
    for change in overrides:
        override(tables, _with_new_name(change))
    return convert(tables, ServoSpec)


def _with_new_name(change: str) -> str:
    """Replace the old name of a table in `section.key=value`, with a RenamedKey warning."""
    section, dot, rest = change.partition(".")
    old = section.strip()
    if old not in NEW_NAMES:
        return change
    new = NEW_NAMES[old]
    warnings.warn(
        f"--set {old}.{rest}: [{old}] is now called [{new}]; write {new}.{rest}",
        RenamedKey,
        stacklevel=2,
    )
    return f"{new}{dot}{rest}"


def _shipped() -> dict[str, Any]:
    return tomllib.loads((resources.files("rig.studies.servo") / f"{SHIPPED}.toml").read_text())
