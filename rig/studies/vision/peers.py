"""Two trackers of the usual kind to compare with: OpenCV's LSD, and a parabola in each row.

Both search a line darker than its surroundings, at most 45 degrees from the vertical, that passes
within MAX_PIVOT_MISS_PX of the given pivot. They keep no history.
"""

from __future__ import annotations

import math
from itertools import product
from typing import Any, NamedTuple

import cv2
import numpy as np

from vision.line_fit import FloatArray, Grey, ImageLine
from vision.protocol import CableAngle, TrackerClass

MAX_PIVOT_MISS_PX = 5.0
MAX_SLOPE = 1.0  # 45 degrees
MIN_ROWS_SHARE = 0.12  # of the picture height; a shorter line gives no angle
CLEAR_ROWS = 8  # rows nearer to the row of the pivot give no slope

# LSD
MAX_WIDTH_PX = 20.0  # of the cable, along a row
EDGE_GATE_PX = MAX_PIVOT_MISS_PX + MAX_WIDTH_PX / 2.0  # of the line of an edge from the pivot
COLLINEAR_PX = 1.5  # of both ends of a segment from the line of a longer one
SEEDS = 12  # longest segments of each polarity to start an edge from
MAX_SLOPE_DIFFERENCE = 0.05  # of the two edges of a cable
# Simpson's rule on a segment; exact for the squares of a line fit
SIMPSON_PLACES = np.array([0.0, 0.5, 1.0])
SIMPSON_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0

# parabola in each row
# along the row: a blur over rows would bend the line at the first and the last row
BLUR_PX, BLUR_TAPS = 1.2, 11  # standard deviation of the Gaussian
MIN_DARKNESS_SIGMAS = 5.0  # of the darkest pixel of a row, against the noise of the blurred picture
MIN_DARKNESS = 1.0  # grey level
SIGMA_PER_MAD = 1.4826  # normal standard deviation over median absolute deviation
TRIALS = 200  # pairs of rows; a cable in one row of ten is found with 87 %
INLIER_PX = 1.5
REFITS = 3
SEED = 1


class LsdTracker:
    """Line segment detector of OpenCV (von Gioi et al. 2010): mean of both edges of the cable."""

    def __init__(self, width: int, height: int) -> None:
        self._min_rows = MIN_ROWS_SHARE * height
        self._detector = cv2.createLineSegmentDetector()

    def measure(self, image: Grey, pivot_px: tuple[float, float]) -> CableAngle:
        """Measure the angle between the edges; sigma is not known.

        The segments of an edge are joined; of all pairs of a left and a right edge the longest
        one wins.
        """
        found: Any = self._detector.detect(image)[0]
        if found is None:
            return CableAngle()
        segments = np.asarray(found, np.float64).reshape(-1, 2, 2)
        # the darker side lies to the right of a segment that points upwards
        is_left = segments[:, 1, 1] < segments[:, 0, 1]
        best = _Edge(ImageLine(0.0, 0.0), self._min_rows)
        lefts = _edges(segments[is_left][:, ::-1], pivot_px)
        rights = _edges(segments[~is_left], pivot_px)
        for left, right in product(lefts, rights):
            middle = _between(left, right, pivot_px)
            if middle is not None and middle.rows > best.rows:
                best = middle
        if best.rows <= self._min_rows:
            return CableAngle()
        return CableAngle(math.atan(best.line.slope))


class _Edge(NamedTuple):
    """Line through collinear segments."""

    line: ImageLine
    rows: float  # sum of their heights [px]


def _edges(segments: FloatArray, pivot_px: tuple[float, float]) -> list[_Edge]:
    """Join segments (N, 2, 2) of one polarity, upper end first, to edges that meet the pivot."""
    upper = segments[:, 0]
    run, rows = (segments[:, 1] - upper).T
    steep = (np.abs(run) <= MAX_SLOPE * rows) & (upper[:, 1] >= pivot_px[1])
    segments, upper, run, rows = segments[steep], upper[steep], run[steep], rows[steep]
    slope = run / rows
    miss = upper[:, 0] - slope * (upper[:, 1] - pivot_px[1]) - pivot_px[0]
    seeds = np.flatnonzero(np.abs(miss) <= EDGE_GATE_PX)
    longest = seeds[np.argsort(-rows[seeds])][:SEEDS]
    edges = []
    for seed in longest:
        away = segments[:, :, 0] - upper[seed, 0]
        away -= slope[seed] * (segments[:, :, 1] - upper[seed, 1])
        collinear = np.abs(away).max(axis=1) <= COLLINEAR_PX
        line = _segment_line(segments[collinear], rows[collinear])
        edges.append(_Edge(line, float(rows[collinear].sum())))
    return edges


def _segment_line(segments: FloatArray, rows: FloatArray) -> ImageLine:
    """Fit a line to segments (N, 2, 2) by least squares over their lengths."""
    upper = segments[:, None, 0]
    points = upper + SIMPSON_PLACES[:, None] * (segments[:, None, 1] - upper)
    weight = rows[:, None] * SIMPSON_WEIGHTS
    u, v = points.reshape(-1, 2).T
    slope, intercept = np.polyfit(v, u, 1, w=np.sqrt(weight.ravel()))
    return ImageLine(float(intercept), float(slope))


def _between(left: _Edge, right: _Edge, pivot_px: tuple[float, float]) -> _Edge | None:
    """Compute the axis of a cable from its edges; None for edges of different objects."""
    width = right.line.at(pivot_px[1]) - left.line.at(pivot_px[1])
    turn = abs(right.line.slope - left.line.slope)
    if not 0.0 < width <= MAX_WIDTH_PX or turn > MAX_SLOPE_DIFFERENCE:
        return None
    intercept = (left.line.intercept_px + right.line.intercept_px) / 2.0
    axis = ImageLine(intercept, (left.line.slope + right.line.slope) / 2.0)
    if abs(axis.at(pivot_px[1]) - pivot_px[0]) > MAX_PIVOT_MISS_PX:
        return None
    return _Edge(axis, min(left.rows, right.rows))


class ParabolaTracker:
    """Parabola through the darkest pixel of each blurred row, RANSAC, then least squares."""

    def __init__(self, width: int, height: int) -> None:
        self._rows = np.arange(height)
        self._min_rows = MIN_ROWS_SHARE * height

    def measure(self, image: Grey, pivot_px: tuple[float, float]) -> CableAngle:
        """Measure the angle and its standard deviation from the scatter of the rows."""
        v, u = self._dark_points(image, pivot_px[1])
        if len(v) < self._min_rows:
            return CableAngle()
        line = _ransac_line(v, u, pivot_px)
        for _ in range(REFITS):
            near = np.abs(u - line.at(v)) <= INLIER_PX
            if np.count_nonzero(near) < self._min_rows:
                return CableAngle()
            slope, intercept = np.polyfit(v[near], u[near], 1)
            line = ImageLine(float(intercept), float(slope))
        if abs(line.at(pivot_px[1]) - pivot_px[0]) > MAX_PIVOT_MISS_PX:
            return CableAngle()
        if abs(line.slope) > MAX_SLOPE:
            return CableAngle()
        residual = u[near] - line.at(v[near])
        spread = np.square(v[near] - v[near].mean()).sum()
        sigma = math.sqrt(np.square(residual).sum() / (len(residual) - 2) / spread)
        return CableAngle(math.atan(line.slope), sigma / (1.0 + line.slope**2))

    def _dark_points(self, image: Grey, pivot_row: float) -> tuple[FloatArray, FloatArray]:
        """Find the darkest point of each row that is dark enough: rows and columns (N,)."""
        picture = image.astype(np.float32)
        light = np.asarray(cv2.GaussianBlur(picture, (BLUR_TAPS, 1), BLUR_PX), np.float64)
        background = np.median(light[:, ::8], axis=1)
        column = light[:, 1:-1].argmin(axis=1) + 1
        before, darkest, after = (light[self._rows, column + step] for step in (-1, 0, 1))
        curvature = before + after - 2.0 * darkest
        deviation = np.abs(light[:, ::8] - background[:, None])
        noise = SIGMA_PER_MAD * float(np.median(deviation[::8]))
        used = background - darkest > max(MIN_DARKNESS_SIGMAS * noise, MIN_DARKNESS)
        used &= (curvature > 0.0) & (self._rows > pivot_row + CLEAR_ROWS)
        step = (before[used] - after[used]) / (2.0 * curvature[used])
        return self._rows[used].astype(np.float64), column[used] + step


def _ransac_line(v: FloatArray, u: FloatArray, pivot_px: tuple[float, float]) -> ImageLine:
    """Find the line through two of the points (N,) and the pivot that most points are near to."""
    pairs = np.random.default_rng(SEED).integers(len(v), size=(2, TRIALS))
    first, second = pairs[:, v[pairs[0]] != v[pairs[1]]]
    slope = (u[second] - u[first]) / (v[second] - v[first])
    intercept = u[first] - slope * v[first]
    miss = np.abs(intercept + slope * pivot_px[1] - pivot_px[0])
    distance = np.abs(u - intercept[:, None] - slope[:, None] * v)
    votes = np.count_nonzero(distance <= INLIER_PX, axis=1)
    best = int(np.argmax(votes * (miss <= MAX_PIVOT_MISS_PX)))
    return ImageLine(float(intercept[best]), float(slope[best]))


PEERS: dict[str, TrackerClass] = {"lsd": LsdTracker, "parabola": ParabolaTracker}
