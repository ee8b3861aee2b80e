"""Fitted line of a picture: its point at the pivot, and what a rolling shutter does to it."""

from __future__ import annotations

import math

from vision.camera_model import SeenLine
from vision.fit import Fit


def seen_line(fit: Fit, slope_rad: float, pivot_px: tuple[float, float], height: int) -> SeenLine:
    """Compose the fitted line, with its point in the row of the pivot."""
    column_px, row_px = pivot_px
    rows = (fit.first_row, fit.last_row)
    if fit.last_row <= fit.first_row:  # not given: all rows below the pivot
        rows = (math.ceil(min(max(row_px, 0.0), height - 2.0)), height - 1)
    return SeenLine(column_px + (fit.pivot_miss_px or 0.0), row_px, slope_rad, *rows)


def readout_rows(line: SeenLine) -> float:
    """Compute after how many rows of a rolling shutter the slope holds; row 0 is read first.

    Row y is seen y row_s later, so that a cable whose slope s changes at the rate s' is seen at
    x - x_p = (y - y_p)(s + s' y row_s). The best straight line over the rows y_1 to y_2 of y^2 has
    the slope y_1 + y_2: the fitted slope is that at the time (y_1 + y_2 - y_p) row_s.
    """
    return line.first_row + line.last_row - line.row_px


def readout_bend_px(line: SeenLine, rate_1_s: float, row_s: float) -> float:
    """Compute the bend of a straight cable by a rolling shutter [px], positive to the right.

    The distance of the middle of s' row_s y^2 over the rows y_1 to y_2 from its chord.
    rate_1_s: s', of the slope.
    """
    return -0.25 * rate_1_s * row_s * (line.last_row - line.first_row) ** 2
