"""Search for a thin dark line in the whole image: line filter and vote of slopes at the pivot."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from vision.line_fit import FloatArray, Grey, ImageLine, coarse_line

FLANK_PX = 5  # distance of the flanks; a bar wider than about 8 px darkens one of them everywhere
CLEAR_ROWS = 8  # rows nearer to the row of the pivot than this give no slope
MIN_NOISE = 0.5  # grey levels; rounding of a clipped or noise-free background
SIGMA_PER_MEAN_DIFFERENCE = (
    math.sqrt(math.pi) / 2.0
)  # of a pixel, over the mean |difference| of two
EDGE_MEDIANS = 5  # a larger difference is an edge, not noise (7 in 10,000 of normal noise)
MAX_CANDIDATES = 20_000  # pixels; a textured image is thinned to bound the computing time

SLOPE_LIMIT = 1.0  # 45 degrees
SLOPE_STEP = 1.0 / 256.0  # 2 px over 500 rows
BINS = round(2 * SLOPE_LIMIT / SLOPE_STEP) + 1
PIVOT_OFFSETS_PX = np.array([-4.0, -2.0, 0.0, 2.0, 4.0])  # errors of the predicted pivot
FIRST_BIN = BINS * np.arange(len(PIVOT_OFFSETS_PX))[:, None]
LINE_HALF_WIDTH_PX = 8.0  # pixels farther from the best line belong to other objects
AMBIGUOUS_SHARE = 0.6  # a second line with this share of the votes makes the result ambiguous
SEARCH_ROW_STEP = 4  # the search takes one row in four, the fit all of them
MIN_VOTES = 10  # some 4 rows of the search; noise alone gives 2 votes


class Levels(NamedTuple):
    """Grey levels of an image, from one pixel in 512."""

    background: float  # median, 0..255
    saturation: float  # share of pixels at 255
    noise: float  # standard deviation of a pixel, from the absolute differences of neighbours


class LineCandidate(NamedTuple):
    """Line with the most votes of dark pixels."""

    line: ImageLine
    ambiguous: bool  # a second line has nearly as many votes


def grey_levels(image: Grey) -> Levels:
    """Estimate background, saturation and noise of image (height, width) uint8, in about 12 us."""
    rows = image[16::64]
    sample = rows[:, :-3:8].ravel()
    difference = cv2.absdiff(sample, rows[:, 3::8].ravel()).ravel()
    half = len(sample) // 2
    sample.partition(half)
    difference.partition(half)
    median = max(1, int(difference[half]))
    without_edges = difference[difference <= EDGE_MEDIANS * median]
    noise = SIGMA_PER_MEAN_DIFFERENCE * int(without_edges.sum()) / len(without_edges)
    saturated = int(np.count_nonzero(sample == 255)) / len(sample)
    return Levels(float(sample[half]), saturated, max(noise, MIN_NOISE))


def line_response(image: Grey) -> Grey:
    """Compute the darkness of 3 px against both flanks, 5 px left and right.

    (H, W) uint8 -> (1, H W) uint8, 0 where the centre is not darker. The darker flank counts, so
    the edge of a wide bar or a step gives 0. Flanks continue from row to row.
    """
    mean = cv2.blur(image, (3, 1)).reshape(1, -1)
    out = np.zeros(mean.shape, np.uint8)
    inner = out[:, FLANK_PX:-FLANK_PX]
    cv2.min(mean[:, : -2 * FLANK_PX], mean[:, 2 * FLANK_PX :], dst=inner)
    cv2.subtract(inner, mean[:, FLANK_PX:-FLANK_PX], dst=inner)
    return out


def search(image: Grey, pivot_px: tuple[float, float], threshold: float) -> LineCandidate | None:
    """Search the whole image for a thin dark line through the predicted pivot (u, v).

    A pixel whose line response exceeds threshold votes for its slope, as seen from five points at
    the pivot. The pixels near the line with the most votes, weighted by their response, give the
    line to some hundredths of a pixel. Returns None below MIN_VOTES.
    """
    width = image.shape[1]
    response = line_response(np.ascontiguousarray(image[::SEARCH_ROW_STEP])).ravel()
    found = np.flatnonzero(response > int(threshold))
    found = found[:: 1 + len(found) // MAX_CANDIDATES]
    v, u = np.divmod(found, width)
    v *= SEARCH_ROW_STEP
    inside = (u >= FLANK_PX) & (u < width - FLANK_PX)  # both flanks are in the row
    used = (v > pivot_px[1] + CLEAR_ROWS) & inside
    du = u[used] - pivot_px[0]
    dv = v[used] - pivot_px[1]
    votes, offset, slope = _vote(du, dv)
    if votes < MIN_VOTES:
        return None
    near = np.abs(du - offset - slope * dv) <= LINE_HALF_WIDTH_PX
    rest = ~near
    enough = AMBIGUOUS_SHARE * votes
    ambiguous = np.count_nonzero(rest) > enough and _vote(du[rest], dv[rest])[0] > enough
    weight = response[found[used][near]].astype(np.float64)
    line = coarse_line(dv[near], du[near], ImageLine(offset, slope), weight)
    in_image = ImageLine(pivot_px[0] + line.at(-pivot_px[1]), line.slope)
    return LineCandidate(in_image, bool(ambiguous))


def _vote(du: FloatArray, dv: FloatArray) -> tuple[int, float, float]:
    """Find the line with the most votes: votes, offset from the pivot [px] and slope.

    du, dv: (N,) relative to the pivot.
    """
    bins = (du - PIVOT_OFFSETS_PX[:, None]) / dv  # (5, N)
    bins = ((bins + SLOPE_LIMIT) * (1.0 / SLOPE_STEP)).clip(0.0, BINS - 1.0) + FIRST_BIN
    votes = np.bincount(bins.astype(np.intp).ravel(), minlength=FIRST_BIN.size * BINS)
    votes = votes.reshape(-1, BINS)
    votes[:, [0, -1]] = 0  # beyond the limit
    pairs = votes[:, 1:] + votes[:, :-1]  # a line on the border of two bins loses no votes
    at, left = divmod(int(pairs.argmax()), BINS - 1)
    return int(pairs[at, left]), float(PIVOT_OFFSETS_PX[at]), (left + 1) * SLOPE_STEP - SLOPE_LIMIT
