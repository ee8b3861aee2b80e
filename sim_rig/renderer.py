"""Renderer of the cable: dark on a bright noisy screen, with motion blur."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_rig import profile
from sim_rig.camera import CableCurve, CableLine
from sim_rig.camera_params import CameraParams
from sim_rig.params import View

BACKGROUNDS = 8  # noisy screens, drawn once and used in turn
STRIP_STEP_PX = 8  # widths of strips are multiples of this
# golden ratio - 1; its multiples modulo 1 are evenly distributed, so that the rounding errors of
# neighbouring rows cancel in a line fit
DITHER_STEP = 0.6180339887498949
PHASES = float(profile.PHASES)
Cable = CableLine | CableCurve


class Renderer:
    """Renderer of images; equal seeds give equal images."""

    def __init__(self, camera: CameraParams, view: View, seed: int | tuple[int, ...]) -> None:
        self._cable, self._width = profile.CableShape.of(camera), view.width
        shape = (BACKGROUNDS, view.height, view.width)
        noise = np.random.default_rng(seed).standard_normal(shape, dtype=np.float32)
        exact = np.clip(camera.background + camera.noise * noise, 0.0, 255.0, dtype=np.float32)
        self._exact = exact + np.float32(0.5)  # the conversion to uint8 then rounds
        self._screens = self._exact.astype(np.uint8)
        self._rows = np.arange(view.height)
        self._numbers = self._rows.astype(np.float64)
        self._dither = self._rows * DITHER_STEP % 1.0

    def picture(
        self, index: int, start: Cable | None, middle: Cable | None, end: Cable | None
    ) -> NDArray[np.uint8]:
        """Render a new image (height, width) uint8 on screen `index` modulo 8.

        start, middle, end: cable at three times of the exposure; without one of them the screen is
        empty. The cable moves at constant speed over the distance between start and end, about its
        mean position by Simpson's rule.
        """
        screen = index % BACKGROUNDS
        picture: NDArray[np.uint8] = self._screens[screen].copy()
        if start is None or middle is None or end is None:
            return picture
        cos_tilt = 1.0 / math.hypot(1.0, middle.slope)
        if isinstance(middle, CableCurve):
            first_row, last_row = middle.first_row, middle.last_row
        else:
            first_row, last_row = max(math.ceil(middle.pivot_row_px), 0), len(picture)
        if first_row >= last_row:
            return picture
        rows = slice(first_row, last_row)
        sweep = self._sweep(start, middle, end, rows)
        self._paint(picture[rows], self._exact[screen, rows], sweep, cos_tilt)
        return picture

    def _sweep(self, start: Cable, middle: Cable, end: Cable, rows: slice) -> NDArray[np.int64]:
        """Compute the range of the cable axis on each row: (2, R) [column phases], ascending."""
        mean_px, range_px = self._axis_px(start, middle, end, rows)
        sweep = np.empty((2, len(range_px)), np.int64)
        span = np.abs(range_px)
        span *= PHASES
        np.maximum(span, 1.0, out=span)
        np.rint(span, out=span)
        first = mean_px * PHASES
        first -= 0.5 * span
        first += self._dither[rows]
        sweep[0] = np.floor(first, out=first)
        first += span
        sweep[1] = first
        return sweep

    def _axis_px(
        self, start: Cable, middle: Cable, end: Cable, rows: slice
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Compute mean and range of the column of the cable on each row [px], each (R,)."""
        numbers = self._numbers[rows]
        if (
            isinstance(start, CableLine)
            and isinstance(middle, CableLine)
            and isinstance(end, CableLine)
        ):
            mean_px = (start.column_px + 4.0 * middle.column_px + end.column_px) / 6.0
            mean_slope = (start.slope + 4.0 * middle.slope + end.slope) / 6.0
            range_px = end.column_px - start.column_px + (end.slope - start.slope) * numbers
            return mean_px + mean_slope * numbers, range_px
        first, half, last = (_columns_px(cable, numbers, rows) for cable in (start, middle, end))
        return (first + 4.0 * half + last) / 6.0, last - first

    def _paint(
        self,
        picture: NDArray[np.uint8],
        screen: NDArray[np.float32],
        sweep: NDArray[np.int64],
        cos_tilt: float,
    ) -> None:
        """Darken the strip of columns that the cable covers, on each of the R rows."""
        cos_tilt = max(round(cos_tilt * profile.TILTS), 1) / profile.TILTS
        span = sweep[1] - sweep[0]
        half_width_px = profile.half_width_px(self._cable, cos_tilt)
        covered_px = int(span.max()) / PHASES + 2 * half_width_px + 2
        width = min(self._width, STRIP_STEP_PX * math.ceil(covered_px / STRIP_STEP_PX))
        table = profile.strip_table(self._cable, cos_tilt, width)

        columns = sweep >> profile.PHASE_BITS  # (2, R)
        left = _clip((columns[0] + columns[1] - width) >> 1, self._width - width)  # (R,)
        offset = _clip(left - columns + table.zero, table.last)
        integral = table.strips[sweep & (profile.PHASES - 1), offset]
        integral = integral.view(np.float32).reshape(2, -1, width)
        place = self._rows[: len(left)], left
        strip = _strips(screen, width)[place].view(np.float32).reshape(-1, width)
        strip -= (integral[0] - integral[1]) * (PHASES / span).astype(np.float32)[:, None]
        np.maximum(strip, 0.0, out=strip)
        _strips(picture, width)[place] = strip.astype(np.uint8).view((np.void, width))[:, 0]


def _columns_px(cable: Cable, numbers: NDArray[np.float64], rows: slice) -> NDArray[np.float64]:
    """Compute the column of a cable on the rows [px]: (R,)."""
    if isinstance(cable, CableCurve):
        return cable.columns_px[rows]
    return cable.column_px + cable.slope * numbers


def _clip(k: NDArray[np.int64], last: int) -> NDArray[np.int64]:
    """Limit k to 0..last in place; np.clip takes three times as long for a few hundred numbers."""
    return np.minimum(np.maximum(k, 0, out=k), last, out=k)


def _strips(image: NDArray[Any], width: int) -> NDArray[np.void]:
    """Create a view whose item [row, left] holds the `width` pixels from column left on."""
    height, columns = image.shape
    item = np.dtype((np.void, width * image.itemsize))
    return np.ndarray((height, columns - width + 1), item, image.data, strides=image.strides)
