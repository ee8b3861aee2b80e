"""Settings of the vision tasks of a run: one task a camera."""

from __future__ import annotations

from comms.channels import MS
from rig.run.calibration import camera_file
from rig.run.calibration.camera_file import CameraFile
from rig.run.calibration.expected_pivot import expected_pivot
from rig.run.calibration.file import Calibration
from rig.run.cameras import Camera
from rig.run.config import Experiment
from vision.task import VisionSettings

IDLE_CAMERA_RATE_HZ = 50.0  # setting of an idle vision task in a run without a camera


def vision_settings(
    experiment: Experiment,
    camera: Camera,
    calibration: Calibration | None,
    file: CameraFile | None = None,
    static_scene: bytes | None = None,
) -> VisionSettings:
    """Compose the settings of the task of a camera; static_scene: PNG of what never moves."""
    v = experiment.vision
    pivot = expected_pivot(camera, calibration, file)
    return VisionSettings(
        camera=camera.number,
        swing_plane=camera.plane,
        width=experiment.camera.width,
        height=experiment.camera.height,
        period_ns=round(1e9 / (camera.rate_hz or IDLE_CAMERA_RATE_HZ)),
        rows=v.rows,
        average_frames=v.average_frames,
        processing_ns=round(v.processing_ms * MS),
        pivot_home_px=pivot.home_px,
        pixels_per_m=pivot.pixels_per_m,
        x_m=calibration.x_m if calibration else [],
        offset_rad=calibration.offset_rad if calibration else [],
        background=calibration.background if calibration else None,
        lights=calibration.light_offsets() if calibration else [],
        camera_distance_m=camera.distance_m,
        model=camera_file.parameters(file) if file else None,
        static_scene=static_scene,
    )
