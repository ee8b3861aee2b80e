"""Geometry of one camera: where the pivot is expected, and the angle that a line means.

By pivot, scale and offset table for a camera that looks along its axis, or by a camera model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

from vision.camera_model import CameraModel, CameraParameters, SeenLine, Vector
from vision.geometry import PivotModel, TrueAngle, pitched_camera


class CableGeometry(Protocol):
    """Geometry of a camera."""

    def pivot_px(self, position_m: Vector) -> tuple[float, float]:
        """Predict column and row of the pivot, with the platform at position_m."""
        ...

    def true_angle(self, line: SeenLine, offset_rad: float, position_m: Vector) -> TrueAngle:
        """Compute the angle of the cable; offset_rad is that of the offset table."""
        ...

    def lower_angle(self, line: SeenLine, offset_rad: float, position_m: Vector) -> TrueAngle:
        """Compute the angle of a link below the cable."""
        ...


class TableGeometry:
    """Geometry by pivot, scale and offset table; the platform moves along one axis."""

    def __init__(
        self,
        pivot: PivotModel,
        table: tuple[Sequence[float], Sequence[float]],
        size_px: tuple[int, int],
        axis: int,
        distance_m: float | None,
    ) -> None:
        """table: positions and offsets (N,). axis: 0 for x, 1 for y. Raises VisionError."""
        self._pivot = pivot
        self._pitch = pitched_camera(*table, pivot, size_px, distance_m)
        self._axis = axis

    def pivot_px(self, position_m: Vector) -> tuple[float, float]:
        """Predict column and row of the pivot, with the platform at position_m."""
        return self._pivot.pivot_px(position_m[self._axis])

    def true_angle(self, line: SeenLine, offset_rad: float, position_m: Vector) -> TrueAngle:
        """Compute the angle of the cable; offset_rad is the slope angle of a hanging cable."""
        return self._pitch.true_angle(line.slope_rad, offset_rad, position_m[self._axis])

    def lower_angle(self, line: SeenLine, offset_rad: float, position_m: Vector) -> TrueAngle:
        """Compute the angle of a link below the cable: its line passes beside the pivot."""
        column_px, row_px = self.pivot_px(position_m)
        at_pivot_px = line.column_px + math.tan(line.slope_rad) * (row_px - line.row_px)
        beside_m = (at_pivot_px - column_px) / self._pivot.pixels_per_m
        place_m = position_m[self._axis]
        return self._pitch.true_angle(line.slope_rad, offset_rad, place_m, beside_m)


class ModelGeometry:
    """Geometry by a camera model; the offset table has what is left."""

    def __init__(self, parameters: CameraParameters, height: int, axis: int) -> None:
        """height: of the picture. axis: 0 for x, 1 for y. Raises VisionError."""
        self._model = CameraModel(parameters)
        self._height = height
        self._axis = axis
        self._slope = 0.0  # tangent of the newest angle

    def pivot_px(self, position_m: Vector) -> tuple[float, float]:
        """Predict where the line through the cable passes the pivot's row; NaN if out of view."""
        slopes = (self._slope, 0.0) if self._axis == 0 else (0.0, self._slope)
        return self._model.seen_pivot(position_m, slopes, self._height)

    def true_angle(self, line: SeenLine, offset_rad: float, position_m: Vector) -> TrueAngle:
        """Compute the angle of the cable, without a swing across; less the offset."""
        true = self._model.true_angle(line, self._axis)
        self._slope = math.tan(true.angle_rad)
        return TrueAngle(true.angle_rad - offset_rad, true.gain)

    def lower_angle(self, line: SeenLine, offset_rad: float, position_m: Vector) -> TrueAngle:
        """Compute the angle of a link below the cable, without a swing across."""
        true = self._model.true_angle(line, self._axis)
        return TrueAngle(true.angle_rad - offset_rad, true.gain)
