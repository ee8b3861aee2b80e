"""Search for thin dark lines anywhere in a picture, without knowledge of the pivot."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from vision.line_fit import FloatArray, Grey, ImageLine
from vision.ridge import FLANK_PX, SLOPE_LIMIT, line_response

SCALES = (1, 2, 4, 8)  # a cable of some 2, 5, 10 and 20 px is 3 px wide at these
MIN_SIZE_PX = 64  # of a reduced picture
ROW_STEP = 4  # of the rows looked at, in pixels of the whole picture
MIN_SIGMAS = 2.5  # response of a point on a line
MIN_LEVELS = 2.0  # the same, in grey levels
PEAK_PX = 9  # one point in so many columns
MAX_POINTS = 3000
HYPOTHESES = 400  # lines through two points; one of them fits if a tenth of the points is on it
MIN_HEIGHT_SHARE = 0.08  # of the picture, between two points that make a line
NEAR_PX = 2.0
OWN_PX = 8.0  # points nearer to a line found belong to it
MIN_SUPPORT = 0.15  # of the rows
MIN_SUPPORT_ROWS = 12
FINER_SUPPORT = 0.85  # of the best support; a finer scale with that is preferred
MOVED_REACH_PX = 5  # between what moved and the dark line that moved


class FreeLine(NamedTuple):
    """Line found in a picture."""

    line: ImageLine
    support: float  # share of the rows with a point on the line
    strength: float  # median response of these points [grey levels]
    first_row: int
    last_row: int


class _Points(NamedTuple):
    u: FloatArray
    v: FloatArray
    response: FloatArray
    rows: int  # looked at


def find_lines(
    picture: Grey, noise: float, most: int = 1, own: Grey | None = None
) -> list[FreeLine]:
    """Find the dark lines with most rows, at most 45 degrees from the vertical.

    picture: (height, width), dark lines on bright. noise: of a pixel. own: picture in which the
    points must be dark too, where picture shows what moved.
    """
    best: list[FreeLine] = []
    for scale in SCALES:
        if min(picture.shape) < scale * MIN_SIZE_PX:
            break
        found = _lines_at(scale, picture, noise, most, own)
        if found and (not best or FINER_SUPPORT * found[0].support > best[0].support):
            best = found
    return best


def _lines_at(
    scale: int, picture: Grey, noise: float, most: int, own: Grey | None
) -> list[FreeLine]:
    points = _dark_points(_reduced(picture, scale), scale, noise, own)
    found: list[FreeLine] = []
    while len(found) < most:
        line = _best_line(points, picture.shape[0] / scale)
        if line is None:
            break
        offset = points.u - line.at(points.v)
        far = np.abs(offset) > OWN_PX
        found.append(_as_found(line, points, scale))
        points = _Points(points.u[far], points.v[far], points.response[far], points.rows)
    return found


def _reduced(picture: Grey, scale: int) -> Grey:
    if scale == 1:
        return picture
    height, width = picture.shape[0] // scale, picture.shape[1] // scale
    whole = picture[: scale * height, : scale * width]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def _dark_points(small: Grey, scale: int, noise: float, own: Grey | None) -> _Points:
    step = max(1, ROW_STEP // scale)
    response = _response(small[::step])
    if own is not None:
        dark = _response(_reduced(own, scale)[::step])
        reach = np.ones((1, 2 * MOVED_REACH_PX + 1), np.uint8)
        response = np.minimum(response, cv2.dilate(dark, reach))
    peak = response == cv2.dilate(response, np.ones((1, PEAK_PX), np.uint8))
    threshold = max(MIN_SIGMAS * noise / scale, MIN_LEVELS)
    peak &= response > threshold
    peak[:, :FLANK_PX] = peak[:, -FLANK_PX:] = False
    v, u = np.nonzero(peak)
    strength = response[v, u].astype(np.float64)
    if len(v) > MAX_POINTS:
        kept = np.argsort(-strength, kind="stable")[:MAX_POINTS]
        v, u, strength = v[kept], u[kept], strength[kept]
    return _Points(
        u.astype(np.float64), np.asarray(v * step, np.float64), strength, response.shape[0]
    )


def _response(rows: Grey) -> Grey:
    return line_response(np.ascontiguousarray(rows)).reshape(rows.shape)


def _best_line(points: _Points, height: float) -> ImageLine | None:
    """Find the line with points in most rows, among lines through two of the points."""
    if len(points.u) < MIN_SUPPORT_ROWS:
        return None
    rng = np.random.default_rng(len(points.u))
    first, second = rng.integers(0, len(points.u), (2, HYPOTHESES))
    rise = points.v[second] - points.v[first]
    usable = np.abs(rise) > MIN_HEIGHT_SHARE * height
    first, second, rise = first[usable], second[usable], rise[usable]
    slope = (points.u[second] - points.u[first]) / rise
    steep = np.abs(slope) <= SLOPE_LIMIT
    slope, first = slope[steep], first[steep]
    if slope.size == 0:
        return None
    intercept = points.u[first] - slope * points.v[first]
    offset = points.u - intercept[:, None] - slope[:, None] * points.v
    votes = np.count_nonzero(np.abs(offset) < NEAR_PX, axis=1)
    at = int(votes.argmax())
    line = ImageLine(float(intercept[at]), float(slope[at]))
    for reach_px in (NEAR_PX, NEAR_PX, 0.75 * NEAR_PX):
        near = np.abs(points.u - line.at(points.v)) < reach_px
        if np.count_nonzero(near) < MIN_SUPPORT_ROWS:
            return None
        line = _fit(points.v[near], points.u[near])
    rows = np.unique(points.v[np.abs(points.u - line.at(points.v)) < NEAR_PX])
    if rows.size < max(MIN_SUPPORT_ROWS, MIN_SUPPORT * points.rows):
        return None
    return line


def _fit(v: FloatArray, u: FloatArray) -> ImageLine:
    middle = float(v.mean())
    spread = v - middle
    slope = float(spread @ u) / max(float(spread @ spread), 1e-9)
    return ImageLine(float(u.mean()) - slope * middle, slope)


def _as_found(line: ImageLine, points: _Points, scale: int) -> FreeLine:
    """Convert a line of the reduced picture to one of the whole picture."""
    near = np.abs(points.u - line.at(points.v)) < NEAR_PX
    rows = np.unique(points.v[near])
    shift = 0.5 * (scale - 1)
    intercept = scale * line.intercept_px + shift * (1.0 - line.slope)
    return FreeLine(
        ImageLine(intercept, line.slope),
        rows.size / points.rows,
        float(np.median(points.response[near])),
        int(scale * rows[0]),
        int(scale * rows[-1]),
    )
