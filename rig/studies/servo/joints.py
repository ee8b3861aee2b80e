"""The joints a study is made of: source 001's rig, as listed and as fitted, or the [model] of a comparison file."""

from __future__ import annotations

from pathlib import Path

import msgspec

from planners.errors import unknown_name
from rig.drives.servo.two_mass import TwoMass
from rig.studies.servo.spec import read_spec

JOINTS = (
    "listed",
    "fitted",
)  # the second is inferred: the printed modes do not follow from the listed constants


def named_joint(name: str, others: tuple[str, ...] = ()) -> TwoMass:
    """The harmonic drive, or what a file believes in. others are names that the caller knows besides.

    Raises PlanError for an unknown name, ConfigError for a file that is no comparison, ServoError for a value out of bounds.
    """
    if name in JOINTS:
        return source_joint(name)
    if name.endswith(".toml"):
        return read_spec(Path(name)).joint
    raise unknown_name("--joint", name, (*JOINTS, *others, "FILE.toml (its [model])"))


def source_joint(name: str) -> TwoMass:
    """The harmonic drive: listed, or fitted."""
    spec = read_spec(None)
    changes = spec.truth["fitted"] if name == "fitted" else {}
    return TwoMass(**(msgspec.structs.asdict(spec.model) | changes))
