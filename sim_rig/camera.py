"""Pinhole camera: projection of the cable to a line in the image.

Pixels: column to the right, row down, integers at pixel centres; the optical axis meets the image
at (width / 2, height / 2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from comms.messages import Position
from sim_rig import params

MIN_DEPTH_M = 0.01  # distance from the plane of the camera; nothing closer is imaged
# nor a cable within 6 degrees of the horizontal: its width would be below the steps of cos(tilt)
MIN_COS_ANGLE = 0.1
BEND_POINTS = 40  # on the visible part of a vibrating cable


class CableLine(NamedTuple):
    """Cable in the image: column = column_px + slope * row, from pivot_row_px downwards."""

    column_px: float  # at row 0
    slope: float  # columns per row; positive = lower end towards +X
    pivot_row_px: float


class Pinhole:
    """Camera at distance_m before the home position, looking along +y, pitched about its x axis."""

    def __init__(self, camera: params.CameraParams, view: params.View, home_m: Position) -> None:
        self._home_m = home_m
        self._distance_m = camera.distance_m
        self._above_m = camera.pivot_above_axis_m
        self._focal_px = camera.pixels_per_m * camera.distance_m
        self._centre_px = view.width / 2, view.height / 2
        pitch_rad = math.radians(camera.pitch_deg)
        self._cos = math.cos(pitch_rad)
        self._sin = math.sin(pitch_rad)

    def bend_rad(self, cable_m: float, modes_m: Sequence[float]) -> float:
        """Compute the angle by which a vibrating cable seems to turn in the picture.

        Slope of the straight line through the pivot with the least squares over the visible part,
        of sum_k q_k sin(k pi s / L).
        """
        above_px = self._focal_px / self._distance_m * self._above_m - self._centre_px[1]
        scale = self._distance_m / self._focal_px
        upper_m = min(max(0.0, above_px * scale), cable_m)
        lower_m = min(cable_m, (above_px + 2.0 * self._centre_px[1]) * scale)
        if lower_m <= upper_m:
            return 0.0
        product = square = 0.0
        for j in range(BEND_POINTS):
            s = upper_m + (j + 0.5) / BEND_POINTS * (lower_m - upper_m)
            turn = math.pi * s / cable_m
            product += s * sum(q * math.sin(k * turn) for k, q in enumerate(modes_m, start=1))
            square += s * s
        return product / square

    def line(self, position_m: Position, angle_rad: float) -> CableLine | None:
        """Project the cable of a platform at position_m.

        Returns None if the cable is behind the camera or does not hang down. A point is imaged at
        centre + focal (right, down) / depth in the frame of the camera. Along the cable, depth
        increases by cos(angle) sin(pitch) and down by cos(angle) cos(pitch) per metre, which gives
        the slope.
        """
        right = position_m[0] - self._home_m[0]
        ahead = position_m[1] - self._home_m[1] + self._distance_m
        above = position_m[2] - self._home_m[2] + self._above_m
        depth = ahead * self._cos - above * self._sin
        down = -ahead * self._sin - above * self._cos
        if min(ahead, depth) < MIN_DEPTH_M or math.cos(angle_rad) < MIN_COS_ANGLE:
            return None
        slope = (math.tan(angle_rad) * depth - right * self._sin) / ahead
        row = self._centre_px[1] + self._focal_px * down / depth
        column = self._centre_px[0] + self._focal_px * right / depth
        return CableLine(column - slope * row, slope, row)
