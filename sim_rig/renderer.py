"""Pictures of the cable: dark on a bright noisy screen, blurred by its motion during the exposure."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_rig import profile
from sim_rig.camera import CableLine
from sim_rig.params import CameraParams, View

BACKGROUNDS = 8  # noisy screens, drawn once and taken in turn
STRIP = 8  # strips are multiples of this many columns
GOLDEN = 0.6180339887498949  # its multiples modulo 1 spread evenly: rounding errors of neighbouring rows cancel in any line fit
PHASES = float(profile.PHASES)


class Renderer:
    """Paints pictures; equal seeds give equal pictures."""

    def __init__(self, camera: CameraParams, view: View, seed: int) -> None:
        self._camera, self._width = camera, view.width
        shape = (BACKGROUNDS, view.height, view.width)
        noise = np.random.default_rng(seed).standard_normal(shape, dtype=np.float32)
        exact = np.clip(camera.background + camera.noise * noise, 0.0, 255.0, dtype=np.float32)
        self._exact = exact + np.float32(0.5)  # cutting off the fraction then rounds
        self._screens = self._exact.astype(np.uint8)
        self._rows = np.arange(view.height)
        self._dither = self._rows * GOLDEN % 1.0

    def picture(
        self, index: int, start: CableLine | None, middle: CableLine | None, end: CableLine | None
    ) -> NDArray[np.uint8]:
        """A fresh (height, width) uint8 picture on screen `index` modulo 8, given the cable at three instants of the exposure.

        Without a line at any of them the screen is empty. The cable sweeps evenly over the distance between start and end,
        about its mean position by Simpson's rule.
        """
        screen = index % BACKGROUNDS
        picture: NDArray[np.uint8] = self._screens[screen].copy()
        if start is not None and middle is not None and end is not None:
            first_row = max(math.ceil(middle.pivot_row_px), 0)
            if first_row < len(picture):
                sweep = self._sweep(start, middle, end, first_row)
                self._paint(
                    picture[first_row:],
                    self._exact[screen, first_row:],
                    sweep,
                    1.0 / math.hypot(1.0, middle.slope),
                )
        return picture

    def _sweep(
        self, start: CableLine, middle: CableLine, end: CableLine, first_row: int
    ) -> NDArray[np.int64]:
        """Where the cable's axis begins and ends its way over each row: (2, R) [column phases], ascending."""
        rows = self._rows[first_row:].astype(np.float64)  # (R,)
        mean_px = (start.column_px + 4.0 * middle.column_px + end.column_px) / 6.0
        mean_slope = (start.slope + 4.0 * middle.slope + end.slope) / 6.0
        way_px = end.column_px - start.column_px + (end.slope - start.slope) * rows
        sweep = np.empty((2, len(rows)), np.int64)
        way = np.floor(np.maximum(np.abs(way_px) * PHASES, 1.0) + 0.5)
        sweep[0] = np.floor(
            (mean_px + mean_slope * rows) * PHASES - 0.5 * way + self._dither[first_row:]
        )
        sweep[1] = sweep[0] + way
        return sweep

    def _paint(
        self,
        picture: NDArray[np.uint8],
        screen: NDArray[np.float32],
        sweep: NDArray[np.int64],
        cos_tilt: float,
    ) -> None:
        """Darken, on each of the R rows, the strip of columns that the cable touches."""
        cos_tilt = max(round(cos_tilt * profile.TILTS), 1) / profile.TILTS
        way = sweep[1] - sweep[0]
        touched_px = int(way.max()) / PHASES + 2 * profile.reach_px(self._camera, cos_tilt) + 2
        width = min(self._width, STRIP * math.ceil(touched_px / STRIP))
        table = profile.windows(self._camera, cos_tilt, width)

        columns = sweep >> profile.PHASE_BITS  # (2, R)
        left = _within((columns[0] + columns[1] - width) >> 1, self._width - width)  # (R,)
        offset = _within(left - columns + table.zero, table.last)
        passed = (
            table.of[sweep & (profile.PHASES - 1), offset].view(np.float32).reshape(2, -1, width)
        )
        place = self._rows[: len(left)], left
        strip = _strips(screen, width)[place].view(np.float32).reshape(-1, width)
        strip -= (passed[0] - passed[1]) * (PHASES / way).astype(np.float32)[:, None]
        np.maximum(strip, 0.0, out=strip)
        _strips(picture, width)[place] = strip.astype(np.uint8).view((np.void, width))[:, 0]


def _within(k: NDArray[np.int64], last: int) -> NDArray[np.int64]:
    """Limit k to 0..last in place; np.clip costs three times as much on a few hundred numbers."""
    return np.minimum(np.maximum(k, 0, out=k), last, out=k)


def _strips(image: NDArray[Any], width: int) -> NDArray[np.void]:
    """A view of which [row, left] is one item: the `width` pixels from column left on."""
    height, columns = image.shape
    item = np.dtype((np.void, width * image.itemsize))
    return np.ndarray((height, columns - width + 1), item, image.data, strides=image.strides)
