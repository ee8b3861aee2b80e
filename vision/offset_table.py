"""What the camera's view adds to the angle, by platform position."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from math import isfinite
from typing import NamedTuple

from vision.errors import VisionError

TOLERANCE_M = 0.005  # beyond the outermost points the end value still holds: 0.1 mrad for a slope of 20 mrad/m


class Offset(NamedTuple):
    """An offset to take off the angle, and whether the table really covers the position."""

    offset_rad: float
    within: bool


class OffsetTable:
    """Offset over position, linear between calibrated points x_m (N,), offset_rad (N,), N >= 1; x_m strictly increasing."""

    def __init__(self, x_m: Sequence[float], offset_rad: Sequence[float]) -> None:
        if not x_m or len(x_m) != len(offset_rad):
            raise VisionError(
                f"offset table with {len(x_m)} positions and {len(offset_rad)} offsets; "
                "need as many of each, at least one: calibrate the offsets again"
            )
        if not all(map(isfinite, (*x_m, *offset_rad))):
            raise VisionError(
                f"offset table x_m = {list(x_m)}, offset_rad = {list(offset_rad)}; all must be finite: calibrate again"
            )
        for before, after in pairwise(x_m):
            if after <= before:
                raise VisionError(
                    f"offset table: x_m = {after} follows {before}; must increase: sort the points, drop doubles"
                )
        self._x_m = tuple(x_m)
        self._offset_rad = tuple(offset_rad)

    def at(self, x_m: float) -> Offset:
        """Offset at x_m; outside the points the nearest end's, and not within beyond TOLERANCE_M."""
        first, last = self._x_m[0], self._x_m[-1]
        within = first - TOLERANCE_M <= x_m <= last + TOLERANCE_M
        if x_m <= first:
            return Offset(self._offset_rad[0], within)
        if x_m >= last:
            return Offset(self._offset_rad[-1], within)
        k = bisect_right(self._x_m, x_m)
        share = (x_m - self._x_m[k - 1]) / (self._x_m[k] - self._x_m[k - 1])
        return Offset((1.0 - share) * self._offset_rad[k - 1] + share * self._offset_rad[k], within)
