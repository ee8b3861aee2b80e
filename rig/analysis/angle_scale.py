"""Scale of the angles of a camera: what is known of it is removed, what is not is a deviation."""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec
import numpy as np

CALIBRATED_REL = 3e-4  # standard deviation of the scale after a calibration
UNCALIBRATED_REL = 5e-3  # of a camera that may be pitched by a degree
ASSUMED_DISTANCE_M = 1.0  # from the camera to the cable, where it is not given
CORRECTED = "corrected"


class AngleScale(NamedTuple):
    """Factor on the tangent of the angles in the log, and its relative standard deviation."""

    factor: float = 1.0
    sigma_rel: float = CALIBRATED_REL


class _CameraFacts(msgspec.Struct, frozen=True):
    """Keys of `vision.json` that say how a camera sees."""

    height: int = 0
    pivot_home_px: tuple[float, float] = (0.0, 0.0)
    pixels_per_m: float = 0.0
    x_m: list[float] = []
    offset_rad: list[float] = []
    camera_distance_m: float | None = None
    model: dict[str, object] | None = None


def angle_scale(settings: bytes, is_corrected: bool) -> AngleScale:
    """Find the scale of a camera from the settings of its task.

    is_corrected: the task has removed the perspective of a pitched camera. Where it has not and has
    a table of offsets, the factor does: 1 - k (v_c - v_p) / pixels_per_m with the slope k of the
    table (vision/geometry.py derives it). 1 - cos(pitch) stays unknown without the distance of the
    camera. Settings that are damaged have the scale of an uncalibrated camera.
    """
    try:
        camera = msgspec.json.decode(settings, type=_CameraFacts)
    except msgspec.MsgspecError:
        return AngleScale(sigma_rel=UNCALIBRATED_REL)
    if camera.model is not None:
        return AngleScale()
    if len(camera.x_m) < 2 or len(camera.x_m) != len(camera.offset_rad) or not camera.pixels_per_m:
        return AngleScale(sigma_rel=UNCALIBRATED_REL)
    apart_m = np.asarray(camera.x_m) - np.mean(camera.x_m)
    slope_1_m = float(apart_m @ np.asarray(camera.offset_rad) / (apart_m @ apart_m))
    distance_m = camera.camera_distance_m
    sine = slope_1_m * (distance_m or ASSUMED_DISTANCE_M)
    cosine = math.sqrt(max(0.0, 1.0 - sine * sine))
    unknown_rel = 0.0 if distance_m and is_corrected else 1.0 - cosine
    factor = 1.0
    if not is_corrected:
        above_m = (0.5 * camera.height - camera.pivot_home_px[1]) / camera.pixels_per_m
        factor = 1.0 / (1.0 + slope_1_m * above_m)
        if distance_m:
            factor *= cosine
            unknown_rel = 0.0
    return AngleScale(factor, CALIBRATED_REL + unknown_rel)
