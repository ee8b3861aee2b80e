"""Lines of a cable that moves, in some spread pictures, and the picture without it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from vision.fit import Fit
from vision.free_lines import find_lines
from vision.line_fit import Grey, ImageLine
from vision.pivot_fit import MeasuredLine
from vision.profile_look import measure_look
from vision.ridge import grey_levels
from vision.static_scene import Mask, StaticScene, median_picture
from vision.templates import CableLook, make_templates
from vision.tracker import Tracker

MIN_SHARE = 0.25  # of the pictures with a line that moved
MIN_PICTURES = 5  # fewer cannot tell what moves
ASSUMED_PIVOT_SHARE = 0.1  # height above the picture at which a line is taken to begin
MASK_BLURS = 4.0  # beside the cable, left out of the median
MASK_PX = 3.0
MIN_UNMASKED = 4  # pictures; fewer: the level is taken from the sides
MAX_STATIC_LINES = 4
LINE_REACH_PX = 15  # half the width of what is drawn on
MIN_MOVED_PX = 0.05  # at the lower end of the lines; less is no motion
MOVED_SIGMAS = 4.0
LOOK_PICTURES = 12
MAX_QUIET_LEVELS = 1.0  # noise of a median picture that does not look like structure
SMOOTHED_SIGMAS = 3.0  # steps up to this are noise
SMOOTH_PX = 2.0


class PictureLine(NamedTuple):
    """Line of the cable in one picture."""

    measured: MeasuredLine
    fit: Fit


class CableLines(NamedTuple):
    """Cable in the pictures."""

    lines: tuple[PictureLine | None, ...]  # one for each picture
    median: Grey  # without the cable where it moves
    cable: CableLook | None
    is_moving: bool
    reach_px: int  # half width of the templates


def cable_lines(pictures: Sequence[Grey], width_px: float | None = None) -> CableLines:
    """Find the lines that move in pictures (height, width), cable dark on bright.

    Lines are first searched in what is darker than the median; then the median is taken again
    without them, and they are measured.
    """
    median = median_picture(pictures)
    found = _moved_lines(pictures, median)
    look = CableLook() if width_px is None else CableLook(width_px)
    share = sum(line is not None for line in found) / len(found)
    if share < MIN_SHARE or len(found) < MIN_PICTURES:
        return CableLines((None,) * len(found), median, None, False, make_templates(look).half_px)
    if width_px is None:
        look = _measured_look(pictures, found) or look
    median = median_without(pictures, found, look)
    reach_px = make_templates(look).half_px
    scene = static_scene(median, reach_px)
    lines = [
        _measured_line(picture, line, look, scene)
        for picture, line in zip(pictures, found, strict=True)
    ]
    better = [None if item is None else item.measured.line for item in lines]
    if width_px is None:
        look = _measured_look(pictures, better) or look
    is_moving = _is_moving([item for item in lines if item is not None], pictures[0].shape[0])
    return CableLines(tuple(lines), median, look, is_moving, make_templates(look).half_px)


def static_scene(median: Grey, reach_px: int) -> StaticScene:
    """Make the static scene of a median picture; noise is smoothed, edges are kept."""
    noise = grey_levels(median).noise
    if noise > MAX_QUIET_LEVELS:
        smooth = cv2.bilateralFilter(median, 0, SMOOTHED_SIGMAS * noise, SMOOTH_PX)
        median = np.asarray(smooth, np.uint8)
    return StaticScene(median, reach_px)


def _moved_lines(pictures: Sequence[Grey], median: Grey) -> list[ImageLine | None]:
    scene = StaticScene(median, 1)
    lines: list[ImageLine | None] = []
    for picture in pictures:
        noise = grey_levels(picture).noise
        found = find_lines(scene.without(picture), noise, 1, picture)
        lines.append(found[0].line if found else None)
    return lines


def _measured_look(pictures: Sequence[Grey], lines: Sequence[ImageLine | None]) -> CableLook | None:
    """Measure width and blur of the cable: medians over some pictures."""
    looks: list[CableLook] = []
    for picture, line in zip(pictures, lines, strict=True):
        if line is None:
            continue
        if len(looks) == LOOK_PICTURES:
            break
        rows = np.arange(picture.shape[0], dtype=np.float64)
        columns = np.asarray(line.at(rows))
        best = None
        for scale in (1, 2, 4):
            guess = CableLook(2.5 * scale, max(0.85, 0.5 * scale))
            best = measure_look(picture, rows, columns, line.slope, guess)
            if best is not None and best.width_px < 3.0 * guess.width_px:
                break
        if best is not None:
            looks.append(best)
    if not looks:
        return None
    width_px, blur_px = np.median(np.array(looks), axis=0)
    return CableLook(float(width_px), float(blur_px))


def _measured_line(
    picture: Grey, line: ImageLine | None, look: CableLook, scene: StaticScene
) -> PictureLine | None:
    if line is None:
        return None
    height, width = picture.shape
    row = -ASSUMED_PIVOT_SHARE * height
    fit = Tracker(width, height, look, scene).measure(picture, (line.at(row), row))
    if not fit.valid or fit.line_px is None or fit.sigma_rad is None:
        return None
    measured = ImageLine(*fit.line_px)
    sigma_slope = fit.sigma_rad * (1.0 + measured.slope**2)
    return PictureLine(
        MeasuredLine(measured, sigma_slope, 0.5 * (fit.first_row + fit.last_row)), fit
    )


def _is_moving(lines: Sequence[PictureLine], height: int) -> bool:
    """Tell if lines of several pictures differ by more than their noise."""
    if len(lines) < MIN_PICTURES:
        return False
    slope = np.array([item.measured.line.slope for item in lines])
    column = np.array([item.measured.line.at(float(height)) for item in lines])
    noise = float(np.median([item.measured.sigma_slope for item in lines]))
    spread_px = float(np.std(column))
    return spread_px > MIN_MOVED_PX and float(np.std(slope)) > MOVED_SIGMAS * noise


def median_without(
    pictures: Sequence[Grey], lines: Sequence[ImageLine | None], look: CableLook
) -> Grey:
    """Compute the median of each pixel (height, width) over the pictures without the cable.

    The pixels of the cable are replaced by 0 and 255 in turn, which leaves the median of the
    others. Where the cable is in nearly all pictures the level is interpolated along the row. A
    picture whose line is not known is left out.
    """
    used = [index for index, line in enumerate(lines) if line is not None]
    if len(used) < MIN_UNMASKED:
        return median_picture(pictures)
    stack = np.stack([pictures[index] for index in used])
    covered = np.zeros(stack.shape[1:], np.uint8)  # by the cable, number of pictures
    for picture, index in zip(stack, used, strict=True):
        rows, first, last = _band(lines[index], look, pictures[0].shape)
        for row, begin, end in zip(rows, first, last, strict=True):
            count = covered[row, begin:end]
            picture[row, begin:end] = (count & 1) * 255
            count += 1
    median = np.asarray(np.median(stack, axis=0), np.uint8)
    unknown = covered > len(used) - MIN_UNMASKED
    columns = np.arange(median.shape[1])
    for row in np.flatnonzero(unknown.any(axis=1)).tolist():
        known = ~unknown[row]
        if known.any():
            median[row, ~known] = np.interp(columns[~known], columns[known], median[row, known])
    _continue_lines(median, unknown)
    return median


def _continue_lines(median: Grey, unknown: Mask) -> None:
    """Draw the lines that never move on where the cable always covers them."""
    width = median.shape[1]
    for found in find_lines(median, grey_levels(median).noise, MAX_STATIC_LINES):
        rows = np.arange(median.shape[0])
        centre = np.rint(found.line.at(rows)).astype(np.intp)
        inside = (centre >= LINE_REACH_PX) & (centre < width - LINE_REACH_PX)
        rows, centre = rows[inside], centre[inside]
        window = centre[:, None] + np.arange(-LINE_REACH_PX, LINE_REACH_PX + 1)
        is_unknown = unknown[rows[:, None], window]
        is_seen = ~is_unknown.any(axis=1)
        if not is_seen.any():
            continue
        profile = np.median(median[rows[is_seen, None], window[is_seen]], axis=0)
        depth = np.maximum(np.median(profile) - profile, 0.0)
        level = median[rows[:, None], window] - np.where(is_unknown, depth, 0.0)
        median[rows[:, None], window] = np.maximum(level, 0.0).astype(np.uint8)


def _band(
    line: ImageLine | None, look: CableLook, shape: tuple[int, ...]
) -> tuple[list[int], list[int], list[int]]:
    """Compute the rows that the cable covers, with first column and end of each."""
    height, width = shape
    if line is None:
        return [], [], []
    rows = np.arange(height, dtype=np.float64)
    reach = 0.5 * look.width_px + MASK_BLURS * look.blur_px + MASK_PX
    reach *= math.hypot(1.0, line.slope)
    centre = np.asarray(line.at(rows))
    first = np.clip(np.floor(centre - reach), 0, width).astype(int)
    last = np.clip(np.ceil(centre + reach) + 1, 0, width).astype(int)
    seen = last > first
    return np.flatnonzero(seen).tolist(), first[seen].tolist(), last[seen].tolist()


def swing_of(found: CableLines) -> tuple[float, float]:
    """Compute smallest and largest angle of the lines [rad]."""
    angles = [math.atan(item.measured.line.slope) for item in found.lines if item is not None]
    return min(angles), max(angles)
