"""Joints of the studies.

That of source 001 as listed and as fitted, or the [model] of a comparison file.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from planners.errors import unknown_name
from rig.drives.servo.two_mass import TwoMass
from rig.studies.servo.spec import read_spec

# fitted is inferred: the printed modes do not follow from the listed constants
JOINTS = ("listed", "fitted")
FITTED_NOTE = (
    "Fitted: the constants that have all five printed modes of source 001's rig; they are "
    "inferred, not published."
)


def named_joint(name: str, others: tuple[str, ...] = ()) -> TwoMass:
    """Find a joint by name: listed, fitted, or the [model] of a file.

    others are further names that the caller knows. Raises PlanError for an unknown name,
    ConfigError for a file that is no comparison, ServoError for a value out of bounds.
    """
    if name in JOINTS:
        return source_joint(name)
    if name.endswith(".toml"):
        return read_spec(Path(name)).joint
    raise unknown_name("--joint", name, (*JOINTS, *others, "FILE.toml (its [model])"))


def source_joint(name: str) -> TwoMass:
    """Build the harmonic drive of source 001: listed, or fitted."""
    spec = read_spec(None)
    changes = spec.truth["fitted"] if name == "fitted" else {}
    return TwoMass(**(msgspec.structs.asdict(spec.model) | changes))
