"""Where something thin and dark stands before a bright screen: a width-selective filter and a vote at the pivot."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np

from vision.line_fit import ImageLine, coarse_line

Grey = np.ndarray[Any, np.dtype[np.uint8]]
FloatArray = np.ndarray[Any, np.dtype[np.float64]]

FLANK_PX = 5  # the flanks compared with the centre; a bar wider than about 8 px shades one of them everywhere
CLEAR_ROWS = 8  # rows nearer than this to the pivot's say nothing about the slope
NOISE_FLOOR = 0.5  # grey levels; a clipped or noise-free background still has rounding
NORMAL = math.sqrt(math.pi) / 2.0  # deviation of a pixel over the mean |difference| of two
USUAL = 5  # medians; a difference beyond is an edge, not noise (7 in 10,000 of normal noise)
MAX_CANDIDATES = 20_000  # a textured picture is thinned, so that its cost stays bounded

SLOPE_LIMIT = 1.0  # 45 degrees
SLOPE_STEP = 1.0 / 256.0  # 2 px over 500 rows
BINS = round(2 * SLOPE_LIMIT / SLOPE_STEP) + 1
PIVOT_OFFSETS_PX = np.array([-4.0, -2.0, 0.0, 2.0, 4.0])  # the prediction of the pivot may be off
FIRST_BIN = BINS * np.arange(len(PIVOT_OFFSETS_PX))[:, None]
RIVAL_PX = 8.0  # pixels farther from the winner belong to something else
RIVAL_SHARE = 0.6  # of the winner's votes: then nobody can say which is the cable
SEARCH_EVERY = 4  # rows; the search only says where to fit, and the fit takes every row
MIN_VOTES = 10  # some 4 rows of the search; noise alone gathers 2 votes


class Levels(NamedTuple):
    """Grey levels of a picture, from one pixel in 512."""

    background: float  # median, 0..255
    saturation: float  # share of pixels at 255
    noise: float  # standard deviation of a pixel, from the absolute differences of neighbours


class LineCandidate(NamedTuple):
    """The line that most dark pixels vote for."""

    line: ImageLine
    ambiguous: bool  # a second line has nearly as many votes


def grey_levels(image: Grey) -> Levels:
    """Background, saturation and noise of image (height, width) uint8; costs some 12 us."""
    rows = image[16::64]
    sample = rows[:, :-3:8].ravel()
    apart = cv2.absdiff(sample, rows[:, 3::8].ravel()).ravel()
    half = len(sample) // 2
    sample.partition(half)
    apart.partition(half)
    usual = apart[apart <= USUAL * max(1, int(apart[half]))]  # leaves edges out
    noise = NORMAL * int(usual.sum()) / len(usual)
    saturated = int(np.count_nonzero(sample == 255)) / len(sample)
    return Levels(float(sample[half]), saturated, max(noise, NOISE_FLOOR))


def line_response(image: Grey) -> Grey:
    """How much darker 3 px are than both flanks, 5 px left and right: (H, W) uint8 -> (1, H W) uint8, 0 where they are not.

    The smaller flank counts, so one side of a wide bar or of a step gives nothing. Flanks run on from row to row.
    """
    mean = cv2.blur(image, (3, 1)).reshape(1, -1)
    out = np.zeros(mean.shape, np.uint8)
    inner = out[:, FLANK_PX:-FLANK_PX]
    cv2.min(mean[:, : -2 * FLANK_PX], mean[:, 2 * FLANK_PX :], dst=inner)
    cv2.subtract(inner, mean[:, FLANK_PX:-FLANK_PX], dst=inner)
    return out


def search(image: Grey, pivot_px: tuple[float, float], threshold: float) -> LineCandidate | None:
    """The thin dark line through the predicted pivot (u, v), from a vote of the whole picture; None if nothing stands out.

    Every pixel whose thinness exceeds threshold votes for its slope as seen from five places about the pivot. Those that
    voted for the winner, weighted by their thinness, then say where it is to some hundredths of a pixel.
    """
    width = image.shape[1]
    thin = line_response(np.ascontiguousarray(image[::SEARCH_EVERY])).ravel()
    found = np.flatnonzero(thin > int(threshold))
    found = found[:: 1 + len(found) // MAX_CANDIDATES]
    v, u = np.divmod(found, width)
    v *= SEARCH_EVERY
    below = (
        (v > pivot_px[1] + CLEAR_ROWS) & (u >= FLANK_PX) & (u < width - FLANK_PX)
    )  # flanks inside the row
    du, dv = u[below] - pivot_px[0], v[below] - pivot_px[1]
    votes, offset, slope = _vote(du, dv)
    if votes < MIN_VOTES:
        return None
    own = np.abs(du - offset - slope * dv) <= RIVAL_PX
    rest = ~own
    ambiguous = (
        np.count_nonzero(rest) > RIVAL_SHARE * votes
        and _vote(du[rest], dv[rest])[0] > RIVAL_SHARE * votes
    )
    line = coarse_line(
        dv[own], du[own], ImageLine(offset, slope), thin[found[below][own]].astype(np.float64)
    )
    at_picture = ImageLine(pivot_px[0] + line.at(-pivot_px[1]), line.slope)
    return LineCandidate(at_picture, bool(ambiguous))


def _vote(du: FloatArray, dv: FloatArray) -> tuple[int, float, float]:
    """Most votes for one line, its offset from the pivot [px] and its slope; du, dv (N,) are counted from the pivot."""
    bins = (du - PIVOT_OFFSETS_PX[:, None]) / dv  # (5, N)
    bins = ((bins + SLOPE_LIMIT) * (1.0 / SLOPE_STEP)).clip(0.0, BINS - 1.0) + FIRST_BIN
    votes = np.bincount(bins.astype(np.intp).ravel(), minlength=FIRST_BIN.size * BINS).reshape(
        -1, BINS
    )
    votes[:, [0, -1]] = 0  # beyond the limit
    pairs = votes[:, 1:] + votes[:, :-1]  # a line on the border of two bins loses nothing
    at, left = divmod(int(pairs.argmax()), BINS - 1)
    return int(pairs[at, left]), float(PIVOT_OFFSETS_PX[at]), (left + 1) * SLOPE_STEP - SLOPE_LIMIT
