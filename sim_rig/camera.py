"""Where the camera sees the cable: a pinhole, and the line that the cable becomes in its picture.

Pixels: column to the right, row down, integers at pixel centres; the optical axis meets the picture at (width / 2, height / 2).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from comms.messages import Position
from sim_rig import params

NEAREST_M = 0.01  # nothing closer to the camera's plane is imaged
LEAST_COS = 0.1  # nor a cable within six degrees of the horizontal: its width would be lost in the steps of cos(tilt)


class CableLine(NamedTuple):
    """The cable in the picture: column = column_px + slope * row, from pivot_row_px downwards."""

    column_px: float  # at row 0
    slope: float  # columns per row; positive = lower end towards +X
    pivot_row_px: float


class Pinhole:
    """A camera distance_m before the home position, looking along +y and pitched down about its x axis."""

    def __init__(self, camera: params.CameraParams, view: params.View, home_m: Position) -> None:
        self._home_m, self._distance_m, self._above_m = (
            home_m,
            camera.distance_m,
            camera.pivot_above_axis_m,
        )
        self._focal_px = camera.pixels_per_m * camera.distance_m
        self._centre_px = view.width / 2, view.height / 2
        self._cos, self._sin = (
            math.cos(math.radians(camera.pitch_deg)),
            math.sin(math.radians(camera.pitch_deg)),
        )

    def line(self, position_m: Position, angle_rad: float) -> CableLine | None:
        """The cable of a platform at position_m; None when it is behind the camera or does not hang down.

        A point is imaged at centre + focal (right, down) / depth of the camera's frame. Along the cable, depth grows by
        cos(angle) sin(pitch) and down by cos(angle) cos(pitch) a metre, hence the slope.
        """
        right = position_m[0] - self._home_m[0]
        ahead = position_m[1] - self._home_m[1] + self._distance_m
        above = position_m[2] - self._home_m[2] + self._above_m
        depth = ahead * self._cos - above * self._sin
        down = -ahead * self._sin - above * self._cos
        if min(ahead, depth) < NEAREST_M or math.cos(angle_rad) < LEAST_COS:
            return None
        slope = (math.tan(angle_rad) * depth - right * self._sin) / ahead
        row = self._centre_px[1] + self._focal_px * down / depth
        column = self._centre_px[0] + self._focal_px * right / depth
        return CableLine(column - slope * row, slope, row)
