"""Calibration of the camera that took a video: true angles, and its check against the pivot."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

from rig.errors import ConfigError
from rig.run import toml_file
from rig.run.calibration import camera_file
from rig.run.calibration.camera_file import CameraFile
from rig.run.calibration.file import Calibration
from vision.cable_geometry import CableGeometry, ModelGeometry, TableGeometry
from vision.camera_model import Vector
from vision.errors import VisionError
from vision.first_look import Look
from vision.geometry import PivotModel
from vision.offset_table import OffsetTable
from vision.tracked import CameraPlacement

MAX_MISS_PX = 5.0  # of the pivot, between calibration and video
MISS_SIGMAS = 3.0
AXES = {"x": 0, "y": 1}


class VideoCalibration(NamedTuple):
    """Calibration file as it is used for a video."""

    name: str
    placement: CameraPlacement
    pixels_per_m: float | None  # of an offset table

    def finding(self, look: Look) -> str | None:
        """Report a pivot of the first look that is not where the calibration expects it."""
        seen, pivot = look.pivot_in_picture(), look.pivot
        if seen is None or pivot is None or not look.is_pivot_known:
            return None
        expected = self.placement.pivot_px()
        across, along = seen[0] - expected[0], seen[1] - expected[1]
        if math.hypot(across, along) <= max(MAX_MISS_PX, MISS_SIGMAS * pivot.sigma_px[1]):
            return None
        position = ",".join(f"{value:g}" for value in self.placement.position_m)
        text = (
            f"{self.name} expects the pivot at {expected[0]:.1f},{expected[1]:.1f} with the "
            f"platform at {position} m, but the lines meet at {seen[0]:.1f},{seen[1]:.1f}"
        )
        if self.pixels_per_m and abs(along) <= MAX_MISS_PX:
            place_m = self.placement.position_m[self.placement.axis] + across / self.pixels_per_m
            place = round(place_m, 4) + 0.0  # no minus sign before 0
            return f"{text}: if the platform stood elsewhere, try --position {place:g}"
        return f"{text}: it is of another camera, or the camera was moved; calibrate it again"


def read_calibration(path: Path, position_m: Vector, size: tuple[int, int]) -> VideoCalibration:
    """Read a file of `rig calibrate offsets` or `rig calibrate camera` for pictures of a size.

    Raises ConfigError for a missing or damaged file and for the file of another picture size.
    """
    if not path.is_file():
        raise ConfigError(
            f"--calibration '{path}': no such file; must be one of `rig calibrate offsets` or `rig "
            "calibrate camera`: check the path"
        )
    tables = toml_file.read_toml(path, "calibration", "make it again")
    try:
        if "focal_px" in tables:
            return _by_camera(path, tables, position_m, size)
        return _by_table(path, tables, position_m, size)
    except (VisionError, ValueError) as error:
        raise ConfigError(f"--calibration '{path}': {error}") from None


def _by_camera(
    path: Path, tables: dict[str, Any], position_m: Vector, size: tuple[int, int]
) -> VideoCalibration:
    camera = toml_file.convert(tables, CameraFile, "camera file")
    _check_size(path, (camera.width, camera.height), size)
    axis = AXES[camera.plane]
    geometry: CableGeometry = ModelGeometry(
        camera_file.parameters(camera, str(path)), camera.height, axis
    )
    return VideoCalibration(str(path), CameraPlacement(geometry, position_m, axis), None)


def _by_table(
    path: Path, tables: dict[str, Any], position_m: Vector, size: tuple[int, int]
) -> VideoCalibration:
    found = toml_file.convert(tables, Calibration, "calibration")
    _check_size(path, (found.width, found.height), size)
    if found.camera_made is not None:
        raise ConfigError(
            f"--calibration '{path}' has the offsets that a camera file leaves; must be the camera "
            "file itself: name that of `rig calibrate camera`"
        )
    axis = AXES[found.plane]
    pivot = PivotModel(home_px=found.pivot_home_px, pixels_per_m=found.pixels_per_m)
    table = (found.x_m, found.offset_rad)
    geometry = TableGeometry(pivot, table, size, axis, None)
    offsets = OffsetTable(*table, found.background, found.light_offsets())
    place_m = position_m[axis]
    if not offsets.at(place_m).within and len(found.x_m) > 1:
        raise ConfigError(
            f"--position {place_m:g}; must be {found.x_m[0]:g} to {found.x_m[-1]:g} m as in "
            f"'{path}': correct it, or calibrate over a longer tour"
        )
    placement = CameraPlacement(geometry, position_m, axis, offsets)
    return VideoCalibration(str(path), placement, found.pixels_per_m)


def _check_size(path: Path, own: tuple[int, int], size: tuple[int, int]) -> None:
    if own != size:
        raise ConfigError(
            f"--calibration '{path}' is for pictures of {own[0]} x {own[1]} px; must be "
            f"{size[0]} x {size[1]} px as in the video: it is of another camera, calibrate this one"
        )
