"""Pinhole camera: projection of the cable to a line or a curve in the image.

Pixels: column to the right, row down, integers at pixel centres; the optical axis meets the image
at (width / 2, height / 2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from comms.messages import Position
from sim_rig.camera_params import CameraParams
from sim_rig.gain_drift import horizontal_gain
from sim_rig.params import View
from sim_rig.vectors import Vector

MIN_DEPTH_M = 0.01  # distance from the plane of the camera; nothing closer is imaged
# nor a cable within 6 degrees of the horizontal: its width would be below the steps of cos(tilt)
MIN_COS_ANGLE = 0.1


class CableLine(NamedTuple):
    """Cable in the image: column = column_px + slope * row, from pivot_row_px downwards."""

    column_px: float  # at row 0
    slope: float  # columns per row; positive = lower end towards +X
    pivot_row_px: float


class CableCurve(NamedTuple):
    """Bent cable in the image, on the rows from first_row to before last_row."""

    columns_px: NDArray[np.float64]  # (height,) of every row of the image
    first_row: int
    last_row: int
    slope: float  # mean of columns per row


class Pinhole:
    """Camera at distance_m before the home position, looking along +y, pitched about its x axis."""

    def __init__(self, camera: CameraParams, view: View, home_m: Position) -> None:
        self._home_m = home_m
        self._distance_m = camera.distance_m
        self._above_m = camera.pivot_above_axis_m
        self._focal_px = camera.pixels_per_m * camera.distance_m
        self._drift_rel = camera.gain_drift_rel
        self._centre_px = view.width / 2, view.height / 2
        self._rows = np.arange(view.height, dtype=np.float64)
        pitch_rad = math.radians(camera.pitch_deg)
        self._cos = math.cos(pitch_rad)
        self._sin = math.sin(pitch_rad)

    def line(
        self, position_m: Position, x_rad: float, y_rad: float = 0.0, t_s: float = 0.0
    ) -> CableLine | None:
        """Project the straight cable of a platform at position_m, at angles in the planes x and y.

        t_s: time since the start of the simulation, for the gain g of the columns.

        Returns None if the cable is behind the camera or does not hang down. A point is imaged at
        centre + focal (right, down) / depth in the frame of the camera. Per metre downwards, right
        increases by tan x, depth by sin(pitch) + tan y cos(pitch) and down by
        cos(pitch) - tan y sin(pitch), which gives the slope over g.
        """
        right = position_m[0] - self._home_m[0]
        ahead = position_m[1] - self._home_m[1] + self._distance_m
        above = position_m[2] - self._home_m[2] + self._above_m
        depth = ahead * self._cos - above * self._sin
        down = -ahead * self._sin - above * self._cos
        if min(ahead, depth) < MIN_DEPTH_M or math.cos(x_rad) < MIN_COS_ANGLE:
            return None
        tan_y = math.tan(y_rad)
        turned = ahead + tan_y * above
        if math.cos(y_rad) < MIN_COS_ANGLE or turned < MIN_DEPTH_M:
            return None
        turn = self._sin + tan_y * self._cos
        gain = horizontal_gain(self._drift_rel, t_s)
        slope = gain * (math.tan(x_rad) * depth - right * turn) / turned
        row = self._centre_px[1] + self._focal_px * down / depth
        column = self._centre_px[0] + gain * self._focal_px * right / depth
        return CableLine(column - slope * row, slope, row)

    def curve(
        self, position_m: Position, points_m: Sequence[Vector], t_s: float = 0.0
    ) -> CableCurve | None:
        """Project a cable through points, relative to the platform and from it down, at t_s.

        Between them it is straight. Returns None if a point is behind the camera, or if the cable
        does not hang down in the image.
        """
        columns, rows = [], []
        across_px = horizontal_gain(self._drift_rel, t_s) * self._focal_px
        for x, y, z in points_m:
            right = position_m[0] + x - self._home_m[0]
            ahead = position_m[1] + y - self._home_m[1] + self._distance_m
            above = position_m[2] + z - self._home_m[2] + self._above_m
            depth = ahead * self._cos - above * self._sin
            if min(ahead, depth) < MIN_DEPTH_M:
                return None
            down = -ahead * self._sin - above * self._cos
            columns.append(self._centre_px[0] + across_px * right / depth)
            rows.append(self._centre_px[1] + self._focal_px * down / depth)
        if any(lower <= upper for upper, lower in pairwise(rows)):
            return None
        height = self._rows.size
        first_row = min(max(math.ceil(rows[0]), 0), height)
        last_row = min(max(math.floor(rows[-1]) + 1, first_row), height)
        slope = (columns[-1] - columns[0]) / (rows[-1] - rows[0])
        return CableCurve(np.interp(self._rows, rows, columns), first_row, last_row, slope)
