"""The two joints of source 001's rig: its listed constants, and those that have all five of its printed modes."""

from __future__ import annotations

import msgspec

from planners.errors import unknown_name
from rig.servo.two_mass import TwoMass
from rig.servo_studies.spec import load

JOINTS = ("listed", "fitted")  # the second is inferred: the printed modes do not follow from the listed constants


def rig_joint(name: str) -> TwoMass:
    """The harmonic drive. Raises PlanError for an unknown name."""
    if name not in JOINTS:
        raise unknown_name("joint", name, JOINTS)
    spec = load(None)
    changes = spec.truth["fitted"] if name == "fitted" else {}
    return TwoMass(**(msgspec.structs.asdict(spec.model) | changes))
