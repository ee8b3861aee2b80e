"""Joint between two straight links in a picture: the row where the slope changes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vision.axis import Axis
from vision.line_fit import MIN_ROWS, FloatArray, ImageLine, Rows

STEP_ROWS = 4  # one row in four is enough to find the joint
KNEES = 24  # places tried at first
FINE_KNEES = 8  # and between the neighbours of the best one
MIN_SEGMENT_ROWS = 6  # of the rows that are looked at, on each side
MIN_LOWER_SHARE = 0.08  # the same for the second link; fewer rows are the edge of a load
MIN_LINK_SHARE = 0.2  # of the height of the picture, for the rows of the first link
KNEE_GAIN = 0.5  # a joint must leave less of the scatter than a parabola does
OUTLIER_SCALES_PX = (20.0, 4.0, 1.0, 0.5)


class Knee(NamedTuple):
    """Two links that meet: the upper one, the row of the joint, and the change of the slope."""

    line: ImageLine
    row: float
    change: float  # of the slope, below the joint
    scatter_px: float  # median distance of the rows over that of a normal distribution


def has_links(v: Rows, axis: Axis, height: int) -> bool:
    """Tell if there are enough rows v (N,) on both sides of the joint of an axis."""
    above = int(np.count_nonzero(v < (axis.knee_row or 0.0)))
    below = len(v) - above
    return above >= MIN_LINK_SHARE * height and below >= max(MIN_ROWS, MIN_LOWER_SHARE * height)


def find_knee(rows: FloatArray, columns: FloatArray) -> Knee | None:
    """Find the joint that fits columns (N,) on rows (N,) best; None with too few rows."""
    if rows.size < 2 * MIN_SEGMENT_ROWS:
        return None
    first, last = rows[MIN_SEGMENT_ROWS - 1], rows[-MIN_SEGMENT_ROWS]
    if not last > first:
        return None
    coarse = np.linspace(first, last, KNEES)
    best = _best(rows, columns, coarse)
    step = coarse[1] - coarse[0]
    low, high = max(first, best.row - step), min(last, best.row + step)
    return _best(rows, columns, np.linspace(low, high, FINE_KNEES))


def _best(rows: FloatArray, columns: FloatArray, places: FloatArray) -> Knee:
    """Choose among places of the joint."""
    ones = np.ones_like(rows)
    found = None
    for place in places:
        basis = np.stack([ones, rows, np.maximum(rows - place, 0.0)])
        q, scatter_px = robust_fit(basis, columns)
        if found is None or scatter_px < found.scatter_px:
            line = ImageLine(float(q[0]), float(q[1]))
            found = Knee(line, float(place), float(q[2]), scatter_px)
    assert found is not None  # there is at least one place
    return found


def robust_fit(basis: FloatArray, y: FloatArray) -> tuple[FloatArray, float]:
    """Fit y (N,) by basis (P, N) with few outliers; return coefficients and robust scatter."""
    found: FloatArray = np.zeros(len(basis))
    residual = y
    weight = np.ones_like(y)
    for scale_px in OUTLIER_SCALES_PX:
        weighted = basis * weight
        found = np.asarray(np.linalg.solve(weighted @ basis.T, weighted @ y), np.float64)
        residual = y - found @ basis
        weight = 1.0 / np.square(1.0 + np.square(residual / scale_px))
    return found, 1.4826 * float(np.median(np.abs(residual)))
