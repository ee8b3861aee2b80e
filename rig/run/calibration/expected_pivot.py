"""Pivot and scale that the tracker of a camera expects."""

from __future__ import annotations

from typing import NamedTuple

from comms.messages import SwingPlane
from rig.run.calibration import camera_file
from rig.run.calibration.camera_file import CameraFile
from rig.run.calibration.file import Calibration
from rig.run.cameras import Camera
from vision.camera_model import CameraModel, CameraParameters

SCALE_STEP_M = 0.01  # to both sides of the home position


class ExpectedPivot(NamedTuple):
    """Pivot at home and scale along the axis of the swing plane, as the tracker expects them."""

    home_px: tuple[float, float]
    pixels_per_m: float


def expected_pivot(
    camera: Camera, calibration: Calibration | None, file: CameraFile | None
) -> ExpectedPivot:
    """Take the pivot from the camera file, else from the calibration, else the rough one."""
    if file is not None:
        return _of_model(camera_file.parameters(file), camera.plane)
    if calibration is not None:
        return ExpectedPivot(calibration.pivot_home_px, calibration.pixels_per_m)
    return ExpectedPivot(camera.rough_pivot_px, camera.rough_pixels_per_m)


def _of_model(parameters: CameraParameters, plane: SwingPlane) -> ExpectedPivot:
    model = CameraModel(parameters)
    pixels = []
    for place_m in (-SCALE_STEP_M, 0.0, SCALE_STEP_M):
        position_m = (place_m, 0.0, 0.0) if plane is SwingPlane.X else (0.0, place_m, 0.0)
        pixels.append(model.seen_pivot(position_m, (0.0, 0.0), 0))
    (left, _), home_px, (right, _) = pixels
    return ExpectedPivot(home_px, abs(right - left) / (2.0 * SCALE_STEP_M))
