"""Axes of a plan against what the cameras see, before a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from comms.messages import Position, SwingPlane
from rig.errors import Refused
from rig.run.calibration.camera_file import CameraFile
from rig.run.cameras import Camera

AXES = ("x", "y", "z")
# across the axis along which a camera without a camera file knows the pivot: at 1 m and 1000 px/m
# the pivot is then 5 px off, the most that the tracker bears, at 0.14 m or 0.14 rad
MAX_OFF_AXIS_M = 0.035


def check_axes(
    positions_m: Sequence[Position],
    watching: Sequence[Camera],
    files: Sequence[CameraFile | None],
) -> None:
    """Raise Refused for a move that a camera cannot follow, or whose swing none of them sees.

    The plane of a camera of the plane y may move along x: its pivot becomes nearer, and stays in
    its column.
    """
    reach_m = np.abs(np.array(positions_m)).max(axis=0)
    for camera, file in zip(watching, files, strict=True):
        known = 1 if camera.plane is SwingPlane.Y else 0
        for axis in (1, 2):
            if file is None and axis != known and reach_m[axis] > MAX_OFF_AXIS_M:
                raise Refused(
                    f"the plan goes {reach_m[axis]:.3f} m along {AXES[axis]}, and camera "
                    f"{camera.number} follows the pivot along {AXES[known]} alone; must be <= "
                    f"{MAX_OFF_AXIS_M} m: give {camera.section} the camera file of `rig calibrate "
                    "camera`, or run without a camera (--set camera.rate_hz=0)"
                )
    sees_y = any(camera.plane is SwingPlane.Y for camera in watching)
    if reach_m[1] > MAX_OFF_AXIS_M and not sees_y:
        raise Refused(
            f"the plan goes {reach_m[1]:.3f} m along y, and no camera sees the swing along y; must "
            "have one: add a camera of the plane y ([[bench.cameras]] and [[vision.cameras]]), or "
            "run without a camera (--set camera.rate_hz=0)"
        )
