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
from rig.errors import ConfigError, RenamedKey
from rig.run.joint.sections import JointGains, Positive, TrapezoidSection
from rig.run.toml_file import Section, convert, nearest, override, read_toml, rename_keys

EXAMPLES = ("source_001", "low_speed_ripple")  # shipped files; the first by default
NEW_NAMES = {"helpers": "compensators"}  # old name of a table, which still works, to new name
MIN_MOVE_SAMPLES = 10
# of [bench]
REQUIRED_KEYS = ("motor_inertia_kg_m2", "load_inertia_kg_m2", "stiffness_n_m_rad", "gear_ratio")
FRICTIONLESS = dict.fromkeys(
    ("motor_friction_n_m_s_rad", "load_friction_n_m_s_rad", "elastic_damping_n_m_s_rad"), 0.0
)


class JointDriveSection(Section, frozen=True, kw_only=True):
    """`[drive]`: sample time, torque limit of the controllers, torque constant."""

    period_s: Annotated[float, Meta(gt=0, le=0.1)] = 0.001
    torque_limit_n_m: Annotated[float, Meta(gt=0)] = math.inf
    torque_constant_n_m_a: Positive | None = None


class ServoSpec(JointGains, frozen=True, kw_only=True):
    """Contents of a comparison file.

    A plant variant is `[bench]` with the changes of `[truth.NAME]`. Only rig.studies.servo.bench
    interprets these tables.
    """

    move: Annotated[list[TrapezoidSection], Meta(min_length=1, max_length=20)]
    bench: dict[str, Any]
    truth: dict[str, dict[str, Any]] = msgspec.field(default_factory=lambda: {"bench": {}})
    drive: JointDriveSection = JointDriveSection()
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
