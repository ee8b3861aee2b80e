"""Settings of the bench of a run with a drive on the field bus."""

from __future__ import annotations

from typing import Any

import msgspec

from rig.run.drive_section import AxisDriveSection
from rig.run.joint.sections import JointSection


class NodeSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Drive of a ball-screw axis, or of an elastic joint, and the plant behind it."""

    drive: AxisDriveSection = AxisDriveSection()
    joint: JointSection | None = None
    plant: dict[str, Any]  # of the simulated plant, see rig/run/runtime/bench.py
