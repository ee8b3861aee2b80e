"""Specification of a comparison of drive controllers, from a TOML file.

Moves, model, gains, and the plant variants to run them on.
"""

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

from planners.errors import unknown_name
from planners.laws.trapezoidal import trapezoidal_by_acceleration
from planners.trajectories.trajectory import Trajectory
from rig.drives.servo.two_mass import TwoMass
from rig.errors import ConfigError, RenamedKey
from rig.run.toml_file import Section, convert, nearest, override, read_toml, rename_keys

EXAMPLES = ("source_001", "low_speed_ripple")  # shipped files; the first by default
NEW_NAMES = {"helpers": "compensators"}  # old name of a table, which still works, to new name
MIN_MOVE_SAMPLES = 10
# of [bench]
REQUIRED_KEYS = ("motor_inertia_kg_m2", "load_inertia_kg_m2", "stiffness_n_m_rad", "gear_ratio")
FRICTIONLESS = dict.fromkeys(
    ("motor_friction_n_m_s_rad", "load_friction_n_m_s_rad", "elastic_damping_n_m_s_rad"), 0.0
)
Positive = Annotated[float, Meta(gt=0, le=1e12)]
NotNegative = Annotated[float, Meta(ge=0, le=1e12)]
Share = Annotated[float, Meta(gt=0, le=1e3)]


class TrapezoidSection(Section, frozen=True, kw_only=True):
    """`[[move]]`: trapezoidal speed, from rest to rest.

    Raises ValueError for an angle of 0.
    """

    load_angle_deg: Annotated[float, Meta(ge=-1e6, le=1e6)]
    time_s: Annotated[float, Meta(gt=0, le=60)]
    motor_acceleration_rad_s2: Positive

    def __post_init__(self) -> None:
        if not self.load_angle_deg:
            raise ValueError(
                "load_angle_deg = 0 is no move; must not be 0: give an angle, its sign is the "
                "direction"
            )

    @property
    def title(self) -> str:
        """Title of the move in tables."""
        return f"{self.load_angle_deg:g}° in {self.time_s:g} s"

    def trajectory(self, gear_ratio: float) -> Trajectory:
        """Build the trajectory of the motor angle [rad].

        Raises ConfigError for an acceleration that is too low for the time.
        """
        angle_rad = math.radians(self.load_angle_deg) * gear_ratio
        least = 4.0 * abs(angle_rad) / self.time_s**2
        if self.motor_acceleration_rad_s2 < least * (1.0 - 1e-12):
            raise ConfigError(
                f"[[move]] motor_acceleration_rad_s2 = {self.motor_acceleration_rad_s2:g} for "
                f"{self.title} with a gear ratio of {gear_ratio:g}; must be >= {least:.6g}: raise "
                "it, or raise time_s"
            )
        return trapezoidal_by_acceleration(
            angle_rad, self.time_s, self.motor_acceleration_rad_s2
        ).trajectory()


class JointModelSection(Section, frozen=True, kw_only=True):
    """`[model]`: model of the joint for the design of the controllers.

    See rig.drives.servo.two_mass.TwoMass.
    """

    motor_inertia_kg_m2: float
    load_inertia_kg_m2: float
    stiffness_n_m_rad: float
    gear_ratio: float = 1.0
    motor_friction_n_m_s_rad: float = 0.0
    load_friction_n_m_s_rad: float = 0.0
    elastic_damping_n_m_s_rad: float = 0.0


class JointDriveSection(Section, frozen=True, kw_only=True):
    """`[drive]`: sample time, torque limit of the controllers, torque constant."""

    period_s: Annotated[float, Meta(gt=0, le=0.1)] = 0.001
    torque_limit_n_m: Annotated[float, Meta(gt=0)] = math.inf
    torque_constant_n_m_a: Positive | None = None


class PidSection(Section, frozen=True, kw_only=True):
    """`[pid]`: P on the position, PI on the speed.

    Gains in shares of omega_z; the reset time in 1 / omega_z.
    """

    speed_crossover: Share = 0.7
    position_crossover: Share = 0.15
    reset_time: Share = 10.0
    # of pid_ff: share of the rigid inertia in its torque feed-forward
    feed_forward: Annotated[float, Meta(ge=0, le=10)] = 1.0


class LqgSection(Section, frozen=True, kw_only=True):
    """`[lqg]`: weights, noise model of the Kalman filter, corner of the load filter.

    Weights of [qm, qm', n ql, n ql', integral of the error] and of the torque.
    """

    state_weights: tuple[NotNegative, NotNegative, NotNegative, NotNegative, NotNegative] = (
        50.0,
        0.0,
        50.0,
        0.001,
        20000.0,
    )
    torque_weight: Positive = 1.0
    # density of white torques on motor and load: 0.05 N m, a new value each ms
    torque_noise_n2_m2_s: Positive = 2.5e-6
    encoder_counts_per_rev: Annotated[int, Meta(ge=1, le=2**40)] = 8192
    corner_rad_s: Positive = 150.0  # of the load filter in lqg_ff


class AssignedSection(Section, frozen=True, kw_only=True):
    """`[assigned]`: eigenvalues, as pairs of real and imaginary part.

    Both of a conjugate pair.
    """

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
    """`[compensators]`: blocks added to a P/PI cascade, and friction compensation.

    The blocks are those of pid_notch, pid_observer and pid_shaped; the friction compensation is
    that of every controller, see rig.drives.servo.friction.
    """

    notch_damping: Share = 1.0  # damping ratio of its poles
    # the load oscillates with shorter ones in this cascade: damping ratio 0.10 at 5 ms
    observer_time_s: Positive = 0.02
    shaper: str = "zv"
    friction_compensation: bool = False
    friction_torque_share: Annotated[float, Meta(gt=0, le=1)] = 0.1  # of the torque limit
    friction_time_s: Positive = 0.05  # time constant of the adaptation
    friction_deadband_rad_s: Positive = 5.0  # of the motor's speed; 8192 counts at 1 ms: 0.8 rad/s


class ServoSpec(Section, frozen=True, kw_only=True):
    """Contents of a comparison file.

    A plant variant is `[bench]` with the changes of `[truth.NAME]`. Only rig.studies.servo.bench
    interprets these tables.
    """

    move: Annotated[list[TrapezoidSection], Meta(min_length=1, max_length=20)]
    model: JointModelSection
    bench: dict[str, Any]
    truth: dict[str, dict[str, Any]] = msgspec.field(default_factory=lambda: {"bench": {}})
    drive: JointDriveSection = JointDriveSection()
    pid: PidSection = PidSection()
    lqg: LqgSection = LqgSection()
    assigned: AssignedSection = AssignedSection()
    compensators: CompensatorsSection = CompensatorsSection()
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 1
    # before each move, for the bias of the accelerometer; the simulation starts with it
    rest_s: Annotated[float, Meta(ge=0.01, le=60)] = 0.2
    watch_s: Annotated[float, Meta(ge=0.05, le=60)] = 0.5  # after each move

    def __post_init__(self) -> None:
        for number, move in enumerate(self.move):
            if move.time_s < MIN_MOVE_SAMPLES * self.drive.period_s:
                raise ValueError(
                    f"move.{number}.time_s = {move.time_s} with drive.period_s = "
                    f"{self.drive.period_s}; must be at least {MIN_MOVE_SAMPLES} samples: "
                    "reduce drive.period_s, or raise time_s"
                )

    @property
    def joint(self) -> TwoMass:
        """Model of the joint; raises ServoError for a value out of bounds."""
        return TwoMass(**msgspec.structs.asdict(self.model))

    def plant_variant_tables(self, name: str) -> dict[str, Any]:
        """Merge the tables of a plant variant.

        Raises ConfigError for a plant variant that the file does not have, or that lacks a required
        key.
        """
        if name not in self.truth:
            raise ConfigError(
                f"--truth {name!r}: not in the file{nearest(name, self.truth)}; "
                f"known: {', '.join(self.truth)}"
            )
        tables = FRICTIONLESS | self.bench | self.truth[name]
        for key in REQUIRED_KEYS:
            if key not in tables:
                raise ConfigError(f"[bench] {key}: missing; add it")
        if tables["gear_ratio"] != self.model.gear_ratio:
            raise ConfigError(
                f"[bench] gear_ratio = {tables['gear_ratio']} with [model] gear_ratio = "
                f"{self.model.gear_ratio}; must be the same: correct one of the two"
            )
        return tables


def read_spec(
    path: Path | None, overrides: Sequence[str] = (), example: str = EXAMPLES[0]
) -> ServoSpec:
    """Read a file, or a shipped one of EXAMPLES, with `section.key=value` overrides.

    Raises PlanError for an unknown example, ConfigError naming section, key, value, bound and the
    nearest known key. Old names of tables still work, with a RenamedKey warning.
    """
    tables = read_toml(path, "servo comparison") if path else _shipped(example)
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


def _shipped(name: str) -> dict[str, Any]:
    if name not in EXAMPLES:
        raise unknown_name("--example", name, EXAMPLES)
    return tomllib.loads((resources.files("rig.studies.servo") / f"{name}.toml").read_text())
