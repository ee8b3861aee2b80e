"""Pivot of the cable in the image over the platform position, and the pitch of a camera.

For a camera that looks along the y axis of the platform. camera_model.py has the
projection of a camera with its whole pose and lens.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vision.errors import VisionError

MAX_KEYSTONE = 0.5  # pitch times height of the pivot over the principal row; 0.03 in a usual rig


@dataclass(frozen=True, slots=True, kw_only=True)
class PivotModel:
    """Linear pivot model: pivot = home_px + (pixels_per_m x, 0).

    The camera is fixed and looks along the y axis of the platform, +X to image right.
    """

    home_px: tuple[float, float]  # (u, v) at x = 0; v < 0 is above the image
    pixels_per_m: float

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.home_px)):
            raise VisionError(
                f"home_px = {self.home_px}; both must be finite: calibrate the pivot again"
            )
        if not 0.0 < self.pixels_per_m < math.inf:
            raise VisionError(
                f"pixels_per_m = {self.pixels_per_m}; must be > 0 and finite: "
                "calibrate the pivot again"
            )

    def pivot_px(self, x_m: float) -> tuple[float, float]:
        """Compute (u, v) of the pivot [px] with the platform at x_m."""
        return self.home_px[0] + self.pixels_per_m * x_m, self.home_px[1]


class TrueAngle(NamedTuple):
    """Angle against the vertical, from the slope angle in the picture."""

    angle_rad: float
    gain: float  # its derivative with respect to the slope angle


class PitchedCamera(NamedTuple):
    """Angle of the cable from its slope angle in the picture of a pitched camera.

    Camera pitched by p, at the horizontal distance D from the plane of the swing; focal length f
    and principal point (u_c, v_c) in pixels. The point of the plane that lies X to the right of the
    camera and d below it is seen at

        u - u_c = f X / w,   v - v_c = f (d cos p - D sin p) / w,   w = d sin p + D cos p.

    The straight line u - u_c = f a + b (v - v_c) in the picture is therefore the line

        X = a w + b (d cos p - D sin p)

    of the plane: a cable with tan(theta) = dX/dd = b cos p + a sin p. The line meets the pivot
    (u_p, v_p), above which the platform is x to the right of the camera. Two facts follow from the
    projection of the pivot, with G = cos p + (sin p / f)(v_c - v_p):

        u_p - u_c = x G f / D,   so that   tan(theta) = G b + x sin p G / D = G (b - b_0),
        b_0 = -x sin p / D.

    b_0 is the slope of a hanging cable. All of it is measured by the offset table: its slope is
    k = d b_0 / dx = -sin p / D, and the pixels per metre of the pivot are f G / D. Hence

        G = cos p / (1 + k (v_c - v_p) / pixels_per_m),

    exactly. cos p follows from sin p = -k D where the distance is known; it is taken as 1 where it
    is not, which reads angles 0.015 % too large at 1 degree and 0.14 % at 3 degrees.

    A roll of the camera turns the picture, and adds a constant to the slope angle, not to its
    tangent; so does light from the side. So the table is taken apart: b_0, which vanishes where the
    pivot is in the principal column, is subtracted from the tangent, the rest from the angle.
    """

    slope_1_m: float = 0.0  # k
    column_m: float = 0.0  # place of the platform with the pivot in the principal column
    scale: float = 1.0  # G

    def true_angle(
        self, slope_rad: float, offset_rad: float, place_m: float, beside_m: float = 0.0
    ) -> TrueAngle:
        """Compute the angle of the cable with the platform at place_m.

        slope_rad: slope angle in the picture. offset_rad: that of a hanging cable at this place.
        beside_m: distance from the pivot at which another line passes its height.
        """
        hanging = self.slope_1_m * (place_m - self.column_m)
        slope = math.tan(slope_rad - offset_rad + math.atan(hanging))
        hanging += self.slope_1_m * beside_m
        true = self.scale * (slope - hanging)
        gain = self.scale * (1.0 + slope * slope) / (1.0 + true * true)
        return TrueAngle(math.atan(true), gain)


def pitched_camera(
    x_m: Sequence[float],
    offset_rad: Sequence[float],
    pivot: PivotModel,
    size_px: tuple[int, int],
    distance_m: float | None = None,
) -> PitchedCamera:
    """Find the pitch of a camera from the slope of its offset table.

    x_m, offset_rad (N,): the table; of fewer than two points no pitch follows. size_px: width and
    height of the picture, in whose middle the principal point is taken to be. distance_m: from the
    camera to the plane of the swing. Raises VisionError for a slope that no camera can have.
    """
    if len(x_m) < 2:
        return PitchedCamera()
    apart_m = np.asarray(x_m) - np.mean(x_m)
    slope_1_m = float(apart_m @ np.asarray(offset_rad) / (apart_m @ apart_m))
    width, height = size_px
    column_m = (0.5 * width - pivot.home_px[0]) / pivot.pixels_per_m
    keystone = slope_1_m * (0.5 * height - pivot.home_px[1]) / pivot.pixels_per_m
    sine = slope_1_m * (distance_m or 0.0)
    if not (abs(keystone) <= MAX_KEYSTONE and abs(sine) < 1.0):
        raise VisionError(
            f"offset table with a slope of {slope_1_m:.4g} rad/m, {keystone:.3g} of the height of "
            f"the pivot over the middle of the picture; must be <= {MAX_KEYSTONE}, and < 1 rad "
            "times the distance of the camera: calibrate the offsets again, or correct "
            "camera_distance_m"
        )
    cosine = math.sqrt(1.0 - sine * sine)
    return PitchedCamera(slope_1_m, column_m, cosine / (1.0 + keystone))
