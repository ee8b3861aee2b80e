"""Offset table: angle offset of the camera over platform position."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from math import isfinite
from typing import NamedTuple

from vision.errors import VisionError

# distance beyond the end points in which the end value holds: 0.1 mrad for a slope of 20 mrad/m
TOLERANCE_M = 0.005


class Offset(NamedTuple):
    """Offset to subtract from the angle."""

    offset_rad: float
    within: bool  # the position is in the range of the table


class OffsetTable:
    """Piecewise linear offset over position.

    Calibrated points x_m (N,), offset_rad (N,), N >= 1; x_m strictly increasing.
    """

    def __init__(self, x_m: Sequence[float], offset_rad: Sequence[float]) -> None:
        if not x_m or len(x_m) != len(offset_rad):
            raise VisionError(
                f"offset table with {len(x_m)} positions and {len(offset_rad)} offsets; "
                "must be equal and at least 1: calibrate the offsets again"
            )
        if not all(map(isfinite, (*x_m, *offset_rad))):
            raise VisionError(
                f"offset table x_m = {list(x_m)}, offset_rad = {list(offset_rad)}; "
                "all must be finite: calibrate the offsets again"
            )
        for before, after in pairwise(x_m):
            if after <= before:
                raise VisionError(
                    f"offset table: x_m = {after} follows {before}; must increase: "
                    "sort the points and delete the copies"
                )
        self._x_m = tuple(x_m)
        self._offset_rad = tuple(offset_rad)

    def at(self, x_m: float) -> Offset:
        """Interpolate the offset at x_m; outside the points the end value holds.

        Beyond TOLERANCE_M outside the points, `within` is False.
        """
        first, last = self._x_m[0], self._x_m[-1]
        within = first - TOLERANCE_M <= x_m <= last + TOLERANCE_M
        if x_m <= first:
            return Offset(self._offset_rad[0], within)
        if x_m >= last:
            return Offset(self._offset_rad[-1], within)
        k = bisect_right(self._x_m, x_m)
        share = (x_m - self._x_m[k - 1]) / (self._x_m[k] - self._x_m[k - 1])
        return Offset((1.0 - share) * self._offset_rad[k - 1] + share * self._offset_rad[k], within)
