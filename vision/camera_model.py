"""Camera in space with a lens: projection of the pivot, and true angle of a line in the picture.

World: x right, y ahead, z up, in metres from the pivot of the cable with the platform at home.
Camera: right, down, ahead. Pixels: column to the right, row down, integers at pixel centres. The
lens is that of Brown and Conrady, with the coefficients of OpenCV.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from vision.errors import VisionError
from vision.geometry import TrueAngle

FloatArray = NDArray[np.float64]
Vector = tuple[float, float, float]
MIN_DEPTH_M = 1e-3  # nothing closer to the plane of the camera is imaged
UNDISTORT_STEPS = 50  # fixed-point iterations at most
UNDISTORTED = 1e-10  # change of a normalised coordinate below which they end
LINE_POINTS = 9  # of a fitted line, which are freed of the distortion of the lens
SLOPE_STEP = 1e-3  # of the derivative of the angle
CABLE_POINTS = 12  # of a cable that is projected
REACH_M = (0.02, 2.0)  # part of a cable that is projected, from the pivot


class CameraParameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Intrinsics, lens and pose of a camera; raises ValueError for what is no camera."""

    focal_px: tuple[float, float]  # along the columns and the rows
    centre_px: tuple[float, float]  # principal point
    distortion: tuple[float, float, float, float, float]  # k1, k2, p1, p2, k3
    rotation: Vector  # Rodrigues vector of the turn from the world to the camera
    translation_m: Vector  # home position in the camera

    def __post_init__(self) -> None:
        values = (
            *self.focal_px,
            *self.centre_px,
            *self.distortion,
            *self.rotation,
            *self.translation_m,
        )
        if not all(map(math.isfinite, values)) or min(self.focal_px) <= 0.0:
            raise ValueError(
                f"focal_px = {list(self.focal_px)}; must be > 0 and all values finite: "
                "calibrate the camera again"
            )


class SeenLine(NamedTuple):
    """Straight line that fits the cable best over some rows of a picture."""

    column_px: float  # at the row below
    row_px: float
    slope_rad: float  # atan(du/dv)
    first_row: float
    last_row: float


class CameraModel:
    """Projection of a camera."""

    def __init__(self, parameters: CameraParameters) -> None:
        self._focal = np.array(parameters.focal_px)
        self._centre = np.array(parameters.centre_px)
        self._lens = parameters.distortion
        rotation, _ = cv2.Rodrigues(np.array(parameters.rotation))
        self.turn = np.asarray(rotation, dtype=np.float64)  # world to camera
        self.translation_m = np.array(parameters.translation_m)
        self.centre_m = -self.turn.T @ self.translation_m  # of the camera in the world
        if self.translation_m[2] < MIN_DEPTH_M:
            raise VisionError(
                f"translation_m = {list(parameters.translation_m)} puts the home position behind "
                "the camera; the third value must be > 0: calibrate the camera again"
            )

    def project(self, points_m: FloatArray) -> FloatArray:
        """Project points (N, 3) of the world to pixels (N, 2); NaN behind the camera."""
        own = points_m @ self.turn.T + self.translation_m
        depth = own[:, 2:]
        flat = own[:, :2] / np.where(depth > MIN_DEPTH_M, depth, np.nan)
        return np.asarray(self._distorted(flat) * self._focal + self._centre)

    def rays(self, pixels: FloatArray) -> FloatArray:
        """Find the rays (N, 3) of pixels (N, 2) in the camera, their third coordinate 1."""
        distorted = (pixels - self._centre) / self._focal
        flat = distorted
        for _ in range(UNDISTORT_STEPS):
            change = distorted - self._distorted(flat)
            flat = flat + change
            if np.abs(change).max() < UNDISTORTED:
                break
        return np.concatenate([flat, np.ones((len(flat), 1))], axis=1)

    def _distorted(self, flat: FloatArray) -> FloatArray:
        """Distort normalised coordinates (N, 2)."""
        k1, k2, p1, p2, k3 = self._lens
        x, y = flat[:, 0], flat[:, 1]
        square = x * x + y * y
        radial = 1.0 + square * (k1 + square * (k2 + square * k3))
        cross = 2.0 * x * y
        return np.stack(
            [
                x * radial + p1 * cross + p2 * (square + 2.0 * x * x),
                y * radial + p1 * (square + 2.0 * y * y) + p2 * cross,
            ],
            axis=1,
        )

    def seen_pivot(
        self, position_m: Vector, slopes: tuple[float, float], height: int
    ) -> tuple[float, float]:
        """Predict where the straight line that fits the cable best passes the pivot's row.

        slopes: tangents of the angles of the cable along x and y. A lens bends the cable, so that
        the line over the rows of a picture of this height misses the pivot itself. NaN where the
        pivot or the cable is behind the camera.
        """
        down_m = np.concatenate([[0.0], np.geomspace(*REACH_M, CABLE_POINTS)])
        steps = np.stack([slopes[0] * down_m, slopes[1] * down_m, -down_m], axis=1)
        pixels = self.project(np.asarray(position_m) + steps)
        column, row = float(pixels[0, 0]), float(pixels[0, 1])
        rows = np.linspace(max(row, 0.0), height - 1.0, LINE_POINTS)
        columns = np.interp(rows, pixels[:, 1], pixels[:, 0])
        if not np.isfinite(columns).all() or rows[-1] <= rows[0]:
            return column, row
        apart = rows - rows.mean()
        slope = float(apart @ columns / (apart @ apart))
        return float(columns.mean()) + slope * (row - float(rows.mean())), row

    def plane(self, line: SeenLine) -> tuple[FloatArray, FloatArray]:
        """Find the plane of the camera and the cable: its normal (3,) in the world.

        The second one is that of a line whose slope is SLOPE_STEP larger. The points of the line
        are freed of the distortion and fitted again: a straight line through a bent cable keeps its
        distance from it to first order.
        """
        rows = np.linspace(line.first_row, line.last_row, LINE_POINTS)
        slope = math.tan(line.slope_rad)
        columns = line.column_px + slope * (rows - line.row_px)
        turned = columns + SLOPE_STEP * (rows - rows.mean())
        pixels = np.stack([np.concatenate([columns, turned]), np.tile(rows, 2)], axis=1)
        rays = self.rays(pixels)
        normals = (self._normal(rays[:LINE_POINTS]), self._normal(rays[LINE_POINTS:]))
        return normals[0] @ self.turn, normals[1] @ self.turn

    def _normal(self, rays: FloatArray) -> FloatArray:
        """Fit x = a + b y to rays (N, 3): normal (3,) of the plane through them in the camera."""
        y = rays[:, 1] - rays[:, 1].mean()
        slope = float(y @ rays[:, 0] / (y @ y))
        intercept = float(rays[:, 0].mean()) - slope * float(rays[:, 1].mean())
        return np.array([1.0, -slope, -intercept])

    def true_angle(self, line: SeenLine, along: int) -> TrueAngle:
        """Compute the angle of the cable in the plane of the swing, without a swing across.

        along: axis of that plane, 0 for x and 1 for y.
        The cable lies in the plane through the camera and the line; its direction in the plane of
        the swing follows without the place of the platform.
        """
        seen, turned = self.plane(line)
        true_rad = math.atan(_slope(seen, along))
        step_rad = math.atan(math.tan(line.slope_rad) + SLOPE_STEP) - line.slope_rad
        gain = abs(math.atan(_slope(turned, along)) - true_rad) / step_rad
        return TrueAngle(true_rad, gain)


def _slope(normal: FloatArray, along: int) -> float:
    """Solve normal . (slope, 0, -1) = 0, with the slope on an axis."""
    return float(normal[2]) / float(normal[along])
