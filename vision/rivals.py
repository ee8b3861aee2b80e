"""Watch for a second line through the pivot, which could be the cable as well."""

from __future__ import annotations

import numpy as np

from vision.axis import MeasuredAxis
from vision.line_fit import Grey, ImageLine, coarse_line
from vision.ridge import CLEAR_ROWS, FLANK_PX, Levels, line_response
from vision.static_scene import StaticScene

ROWS = 16  # looked at in each picture
STEPS = np.arange(ROWS)
MIN_SHARE = 0.6  # of these rows with a rival on one line
CLEAR_PX = 8.0  # beside the cable
RESPONSE_SHARE = 0.5  # of the response of the cable itself
MIN_RESPONSE_SIGMAS = 4.0
BINS_PER_SLOPE = 48.0  # a line 5 px off the pivot stays in two neighbouring bins
MAX_APART_PX = 5.0  # at the pivot: a line farther from the cable there is not one through it
CHECK_FRAMES = 4  # without a rival, one picture in so many is looked at
MEMORY_FRAMES = 50  # in which a line that was seen may hide behind the cable


class RivalWatch:
    """Rivals of the cable in pictures of one size."""

    def __init__(self, width: int, height: int) -> None:
        self._width = width
        self._height = height
        self._since = MEMORY_FRAMES  # pictures since the last rival
        self._looked_at = 0  # pictures

    def is_rivalled(
        self,
        image: Grey,
        levels: Levels,
        measured: MeasuredAxis,
        pivot_px: tuple[float, float],
        static: StaticScene | None,
    ) -> bool:
        """Tell if there is, or was a moment ago, another line as dark through the pivot."""
        self._since += 1
        self._looked_at += 1
        # a line that hides behind the cable in the first picture comes out in one of the next
        is_new = min(self._since, self._looked_at) < MEMORY_FRAMES
        is_due = is_new or self._since % CHECK_FRAMES == 0
        if is_due and self._sees_rival(image, levels, measured, pivot_px, static):
            self._since = 0
            return True
        return self._since < MEMORY_FRAMES

    def _sees_rival(
        self,
        image: Grey,
        levels: Levels,
        measured: MeasuredAxis,
        pivot_px: tuple[float, float],
        static: StaticScene | None,
    ) -> bool:
        first = max(measured.first_row, int(pivot_px[1]) + CLEAR_ROWS + 40)
        if measured.last_row - first < ROWS:
            return False
        rows = first + (measured.last_row - first) * STEPS // (ROWS - 1)
        picture = np.ascontiguousarray(image[rows])
        if static is not None:
            still = np.ascontiguousarray(static.picture[rows])
            picture = 255 - np.where(still > picture, still - picture, 0).astype(np.uint8)
        response = line_response(picture).reshape(ROWS, self._width)
        own = np.rint(measured.axis.line.at(rows.astype(np.float64))).astype(np.intp)
        own = np.minimum(np.maximum(own, 0), self._width - 1)
        strength = float(np.median(response[np.arange(ROWS), own]))
        limit = max(RESPONSE_SHARE * strength, MIN_RESPONSE_SIGMAS * levels.noise)
        row, column = np.nonzero(response > limit)
        clear = np.abs(column - own[row]) > CLEAR_PX
        clear &= (column >= FLANK_PX) & (column < self._width - FLANK_PX)
        row, column = row[clear], column[clear]
        if row.size < MIN_SHARE * ROWS:
            return False
        slope = (column - pivot_px[0]) / (rows[row] - pivot_px[1])
        near = np.abs(slope) < 1.0
        bins = ((slope[near] + 1.0) * BINS_PER_SLOPE).astype(np.intp)
        row, column = row[near], column[near]
        # each row counts once in a bin
        votes = np.unique(bins * ROWS + row) // ROWS
        count = np.bincount(votes, minlength=2)
        pairs = count[1:] + count[:-1]
        best = int(pairs.argmax())
        if int(pairs[best]) < MIN_SHARE * ROWS:
            return False
        chosen = (bins == best) | (bins == best + 1)
        v, u = rows[row[chosen]].astype(np.float64), column[chosen].astype(np.float64)
        line = coarse_line(v, u, ImageLine(float(u.mean()), 0.0))
        apart_px = line.at(pivot_px[1]) - measured.axis.line.at(pivot_px[1])
        return abs(apart_px) < MAX_APART_PX
