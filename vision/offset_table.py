"""Offset table: angle offset of the camera over platform position and light."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from math import isfinite
from typing import NamedTuple

from vision.errors import VisionError

# distance beyond the end points in which the end value holds: 0.1 mrad for a slope of 20 mrad/m
TOLERANCE_M = 0.005
MIN_LIGHT_STEP = 1.0  # grey levels
LIGHT_TOLERANCE_REL = 0.1  # beyond the darkest and the brightest light, of its level


class Offset(NamedTuple):
    """Offset to subtract from the angle."""

    offset_rad: float
    within: bool  # position and light are in the range of the table


class LightOffsets(NamedTuple):
    """Offsets (N,) at the positions of a table in one light."""

    background: float  # level of the screen in the picture, 0 to 255
    offset_rad: Sequence[float]


class OffsetTable:
    """Piecewise linear offset over position, and over light where it was calibrated in several.

    Calibrated points x_m (N,), offset_rad (N,), N >= 1; x_m strictly increasing. lights: further
    offsets at the same positions; background is then the level of the first ones. A table of one
    light holds in every light.
    """

    def __init__(
        self,
        x_m: Sequence[float],
        offset_rad: Sequence[float],
        background: float | None = None,
        lights: Sequence[LightOffsets] = (),
    ) -> None:
        _check_points(x_m, offset_rad)
        self._x_m = tuple(x_m)
        rows = [LightOffsets(background or 0.0, offset_rad), *lights]
        for light in lights:
            _check_points(x_m, light.offset_rad)
        if lights and background is None:
            raise VisionError(
                f"offset table of {len(rows)} lights, the first without its level; must have a "
                "level of the screen each: calibrate the offsets again"
            )
        rows.sort(key=lambda light: light.background)
        self._levels = tuple(light.background for light in rows)
        _check_levels(self._levels)
        self._offset_rad = tuple(tuple(light.offset_rad) for light in rows)

    def at(self, x_m: float, background: float = 0.0) -> Offset:
        """Interpolate the offset at x_m in a light; outside the points the end value holds.

        Beyond TOLERANCE_M outside the points, or LIGHT_TOLERANCE_REL outside the levels of several
        lights, `within` is False.
        """
        first, last = self._x_m[0], self._x_m[-1]
        within = first - TOLERANCE_M <= x_m <= last + TOLERANCE_M
        if len(self._levels) == 1:
            return Offset(_interpolate(self._x_m, self._offset_rad[0], x_m), within)
        darkest, brightest = self._levels[0], self._levels[-1]
        is_dark = background < darkest * (1.0 - LIGHT_TOLERANCE_REL)
        is_bright = background > brightest * (1.0 + LIGHT_TOLERANCE_REL)
        offsets = [_interpolate(self._x_m, row, x_m) for row in self._offset_rad]
        offset_rad = _interpolate(self._levels, offsets, background)
        return Offset(offset_rad, within and not (is_dark or is_bright))


def _interpolate(at: Sequence[float], values: Sequence[float], x: float) -> float:
    """Interpolate linearly between points at (N,), increasing; the end values hold outside."""
    if x <= at[0]:
        return values[0]
    if x >= at[-1]:
        return values[-1]
    k = bisect_right(at, x)
    share = (x - at[k - 1]) / (at[k] - at[k - 1])
    return (1.0 - share) * values[k - 1] + share * values[k]


def _check_points(x_m: Sequence[float], offset_rad: Sequence[float]) -> None:
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


def _check_levels(levels: Sequence[float]) -> None:
    for before, after in pairwise(levels):
        if after - before < MIN_LIGHT_STEP:
            raise VisionError(
                f"offset table: lights of {before:.1f} and {after:.1f} grey levels; must be "
                f"{MIN_LIGHT_STEP:g} apart: calibrate in lights that differ more"
            )
