"""Camera in space with a lens: projection of points to pixels, and of pixels to a plane.

World: x right, y ahead, z up, as the platform. Camera: right, down, ahead. Pixels: column to the
right, row down, integers at pixel centres; without shift the optical axis meets the image at
(width / 2, height / 2).
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from comms.messages import Position
from sim_rig.camera_params import CameraParams
from sim_rig.gain_drift import horizontal_gain
from sim_rig.params import View

FloatArray = NDArray[np.float64]
MIN_DEPTH_M = 0.01  # nothing closer to the plane of the camera is imaged
# right, down and ahead of a camera that is not turned, in the world, by its plane
AXES = {
    "x": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "y": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]),
}


class PosedCamera:
    """Pose and lens of a camera; turned about its own centre: yaw, then pitch, then roll."""

    def __init__(self, camera: CameraParams, view: View, home_m: Position) -> None:
        axes = AXES[camera.plane]
        right, ahead, up = camera.shift_m
        own = [right, camera.pivot_above_axis_m - up, ahead - camera.distance_m]
        self.centre_m: FloatArray = np.asarray(home_m) + own @ axes
        self.axes: FloatArray = axes  # right, down, ahead before the camera is turned (3, 3)
        self.turn: FloatArray = _turn(camera) @ axes  # world to camera
        lens = camera.lens
        focal = camera.focal_px
        centre = 0.5 * view.width + lens.centre_px[0], 0.5 * view.height + lens.centre_px[1]
        self.matrix: FloatArray = np.array(
            [[focal, 0.0, centre[0]], [0.0, focal * lens.aspect, centre[1]], [0.0, 0.0, 1.0]]
        )
        self.distortion: FloatArray = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
        self.is_distorted = bool(np.any(self.distortion))
        self._drift_rel = camera.gain_drift_rel

    def project(self, points_m: FloatArray, t_s: float = 0.0) -> FloatArray | None:
        """Project points (N, 3) to pixels (N, 2), t_s after the start of the simulation.

        None if one of them is behind the camera.
        """
        own = (points_m - self.centre_m) @ self.turn.T
        if own[:, 2].min() < MIN_DEPTH_M:
            return None
        matrix = self.matrix
        if self._drift_rel:
            gain = horizontal_gain(self._drift_rel, t_s)
            matrix = np.array([[gain * matrix[0, 0], 0.0, matrix[0, 2]], *matrix[1:]])
        if not self.is_distorted:
            image = own[:, :2] / own[:, 2:]
            return np.asarray(image * np.diag(matrix)[:2] + matrix[:2, 2])
        still = np.zeros(3)
        pixels, _ = cv2.projectPoints(own, still, still, matrix, self.distortion)
        return np.asarray(pixels.reshape(-1, 2), dtype=np.float64)

    def depth_m(self, point_m: FloatArray) -> float:
        """Compute the distance of a point (3,) from the plane of the camera."""
        return float(self.turn[2] @ (point_m - self.centre_m))

    def on_plane(self, pixels: FloatArray, origin_m: FloatArray, along_m: FloatArray) -> FloatArray:
        """Find where the rays of pixels (N, 2) meet a plane: its own coordinates (N, 2).

        origin_m (3,), along_m (2, 3) unit vectors in the plane; a ray that misses it gives NaN.
        """
        undistorted = cv2.undistortPoints(pixels[:, None, :], self.matrix, self.distortion)
        rays = np.hstack([undistorted.reshape(-1, 2), np.ones((len(pixels), 1))]) @ self.turn
        normal = np.cross(along_m[0], along_m[1])
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = float(normal @ (origin_m - self.centre_m)) / (rays @ normal)
        reach[~(reach > 0.0)] = np.nan
        places = self.centre_m + rays * reach[:, None] - origin_m
        return np.asarray(places @ along_m.T)


def _turn(camera: CameraParams) -> FloatArray:
    """Compute the turn from the camera that is not turned to the turned one."""
    yaw, pitch, roll = map(math.radians, (camera.yaw_deg, camera.pitch_deg, camera.roll_deg))
    c, s = math.cos(yaw), math.sin(yaw)
    by_yaw = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    c, s = math.cos(pitch), math.sin(pitch)
    by_pitch = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    c, s = math.cos(roll), math.sin(roll)
    by_roll = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    turned: FloatArray = by_roll @ by_pitch @ by_yaw
    return turned
