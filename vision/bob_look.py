"""First look at a bob without a visible cable: its ground, its pivot and its radius."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np

from vision.blob import Blob, blob_mask, find_blob
from vision.circle_fit import SIGMA_PER_MAD, Circle, fit_circle
from vision.line_fit import Grey
from vision.ridge import grey_levels
from vision.static_scene import median_picture
from vision.view import PLANES, PictureRegion, PictureView, is_grey

MIN_SHARE = 0.5  # of the pictures with a blob
MIN_PICTURES = 5
ONE_SIDED = 0.2  # depth of the other sign, in a median without the bob
GROWTH_PX = 5  # of the region that moved
MAX_SCATTER_PX = 2.0  # of the centroids about the circle
MAX_SCATTER_SHARE = 0.05  # of the length of the arc
MAX_AREA_RATIO = 1.6  # of the largest blob over the smallest
MIN_RADIUS_BLOBS = 1.5  # radius of the circle in diameters of the blob
MAX_RADIUS_ARCS = 200.0  # radius over the arc; more is a straight way, such as that of a person
UP = ((0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))  # pivot before turns 0 to 3


class BobLook(NamedTuple):
    """Bob as found; places are those of the view."""

    view: PictureView
    ground: Grey  # the view without the bob
    circle: Circle  # of the centroids, about the pivot
    area_px: float
    blobs: tuple[Blob | None, ...]  # one for each picture


def look_for_bob(
    pictures: Sequence[Grey],
    shifts: Sequence[tuple[float, float]],
    plane: str | None,
    is_bright: bool | None,
    turns: int | None,
    region: PictureRegion | None,
) -> BobLook | None:
    """Find a blob that moves on a circle; None if there is none.

    pictures: (height, width) or (height, width, 3). shifts: motion of the pivot in them [px].
    """
    if len(pictures) < MIN_PICTURES:
        return None
    planes: Sequence[str] = PLANES if plane is None else (plane,)
    if plane is None and is_grey(pictures[0]):
        planes = ("grey",)
    best: BobLook | None = None
    best_merit = 0.0
    for name in planes:
        seen = [PictureView(name, region=region).picture(picture) for picture in pictures]
        found = _in_plane(seen, shifts, is_bright)
        if found is None:
            continue
        merit = found[3] / grey_levels(seen[0]).noise
        if merit > best_merit:
            bright, ground, circle, _, blobs = found
            view = PictureView(name, bright, 0, region)
            area = float(np.median([blob.area_px for blob in blobs if blob is not None]))
            best, best_merit = BobLook(view, ground, circle, area, blobs), merit
    if best is None:
        return None
    turn = _turns(best) if turns is None else turns
    if turn == 0:
        return best
    size = (pictures[0].shape[1], pictures[0].shape[0])
    return _turned(best, turn, size)


def _in_plane(
    seen: Sequence[Grey], shifts: Sequence[tuple[float, float]], is_bright: bool | None
) -> tuple[bool, Grey, Circle, float, tuple[Blob | None, ...]] | None:
    """Find the blob in one plane: polarity, ground, circle, contrast, and all blobs."""
    ground, bright = _ground(seen)
    if ground is None or (is_bright is not None and is_bright is not bright):
        return None
    if bright:
        ground = np.asarray(cv2.bitwise_not(ground), np.uint8)
        seen = [np.asarray(cv2.bitwise_not(picture), np.uint8) for picture in seen]
    blobs = [find_blob(ground, picture, grey_levels(picture).noise) for picture in seen]
    whole = [
        (blob, shift)
        for blob, shift in zip(blobs, shifts, strict=True)
        if blob is not None and not blob.touches_border
    ]
    if len(whole) < max(MIN_PICTURES, MIN_SHARE * len(seen)):
        return None
    circle = _circle(whole)
    if circle is None:
        return None
    contrast = float(np.median([blob.contrast for blob, _ in whole]))
    return bright, ground, circle, contrast, tuple(blobs)


def _circle(whole: Sequence[tuple[Blob, tuple[float, float]]]) -> Circle | None:
    """Fit the circle of a pendulum to the centroids; None if they are not on one."""
    u = np.array([blob.u - shift[0] for blob, shift in whole])
    v = np.array([blob.v - shift[1] for blob, shift in whole])
    areas = np.array([blob.area_px for blob, _ in whole], float)
    low, high = np.percentile(areas, [10.0, 90.0])
    circle = fit_circle(u, v)
    if circle is None or high > MAX_AREA_RATIO * low:
        return None
    arc = math.hypot(float(np.ptp(u)), float(np.ptp(v)))
    diameter = 2.0 * math.sqrt(float(np.median(areas)) / math.pi)
    far_px = MAX_RADIUS_ARCS * arc
    if not MIN_RADIUS_BLOBS * diameter <= circle.radius_px <= far_px:
        return None
    if circle.scatter_px > min(MAX_SCATTER_PX, MAX_SCATTER_SHARE * arc):
        return None
    return circle if circle.points >= MIN_SHARE * len(whole) else None


def _ground(seen: Sequence[Grey]) -> tuple[Grey | None, bool]:
    """Compute the picture without the bob, and tell if the bob is brighter than it."""
    median = median_picture(seen)
    noise = grey_levels(seen[0]).noise
    dark = [np.asarray(cv2.subtract(median, picture), np.uint8) for picture in seen]
    bright = [np.asarray(cv2.subtract(picture, median), np.uint8) for picture in seen]
    moved_dark = [blob_mask(depth, noise) for depth in dark]
    moved_bright = [blob_mask(depth, noise) for depth in bright]
    sum_dark, sum_bright = _depth(dark, moved_dark), _depth(bright, moved_bright)
    if max(sum_dark, sum_bright) == 0.0:
        return None, False
    if sum_bright < ONE_SIDED * sum_dark:
        return _without(seen, moved_dark, median), False
    if sum_dark < ONE_SIDED * sum_bright:
        return _without(seen, moved_bright, median), True
    # the bob is in the median too, and what it always covers never changes: the ground is
    # interpolated along each row from one end of what moved to the other
    swept = np.zeros(median.shape, bool)
    for mask in (*moved_dark, *moved_bright):
        if mask is not None:
            swept |= mask
    swept = _spanned(_grown(swept))
    ground = _interpolated(median, swept)
    change = ground.astype(np.float64)[swept] - median[swept]
    return ground, bool(np.sum(change) < 0.0)


def _spanned(mask: Any) -> Any:
    """Fill each row of a mask from its first marked pixel to its last one."""
    from_left = np.maximum.accumulate(mask, axis=1)
    from_right = np.maximum.accumulate(mask[:, ::-1], axis=1)[:, ::-1]
    return from_left & from_right


def _depth(depths: Sequence[Grey], masks: Sequence[Any]) -> float:
    total = 0.0
    for depth, mask in zip(depths, masks, strict=True):
        if mask is not None:
            total += float(depth[mask].sum())
    return total


def _grown(mask: Any) -> Any:
    kernel = np.ones((2 * GROWTH_PX + 1, 2 * GROWTH_PX + 1), np.uint8)
    return cv2.dilate(mask.astype(np.uint8), kernel).astype(bool)


def _without(seen: Sequence[Grey], masks: Sequence[Any], median: Grey) -> Grey:
    """Compute the median of each pixel over the pictures in which the bob is elsewhere."""
    stack = np.stack(seen)
    covered = np.zeros(median.shape, np.uint8)
    for picture, mask in zip(stack, masks, strict=True):
        if mask is None:
            continue
        grown = _grown(mask)
        picture[grown] = (covered[grown] & 1) * 255
        covered[grown] += 1
    ground = np.asarray(np.median(stack, axis=0), np.uint8)
    return _interpolated(ground, covered > len(seen) - 2)


def _interpolated(picture: Grey, unknown: Any) -> Grey:
    """Fill unknown pixels along the rows."""
    filled = picture.copy()
    columns = np.arange(picture.shape[1])
    for row in np.flatnonzero(unknown.any(axis=1)):
        known = ~unknown[row]
        if known.any():
            level = np.interp(columns[~known], columns[known], picture[row, known])
            filled[row, ~known] = level
    return filled


def about_pivot(found: BobLook, pivot_px: tuple[float, float]) -> BobLook:
    """Take a pivot that is told, in the view, as the centre of the circle."""
    seen = [blob for blob in found.blobs if blob is not None and not blob.touches_border]
    distances = np.array([math.hypot(blob.u - pivot_px[0], blob.v - pivot_px[1]) for blob in seen])
    radius_px = float(np.median(distances))
    scatter_px = SIGMA_PER_MAD * float(np.median(np.abs(distances - radius_px)))
    circle = found.circle._replace(
        centre_px=pivot_px,
        radius_px=radius_px,
        sigma_centre_px=(0.0, 0.0),
        sigma_radius_px=scatter_px / math.sqrt(len(seen)),
        scatter_px=scatter_px,
    )
    return found._replace(circle=circle)


def _turns(found: BobLook) -> int:
    """Choose the quarter turns that bring the pivot above the bob."""
    centres = np.array([(blob.u, blob.v) for blob in found.blobs if blob is not None])
    up = np.array(found.circle.centre_px) - np.median(centres, axis=0)
    return int(np.argmax(np.array(UP) @ up))


def _turned(found: BobLook, turns: int, size: tuple[int, int]) -> BobLook:
    """Turn what was found in the unturned view."""
    upright = found.view
    view = upright._replace(turns=turns)

    def place(point: tuple[float, float]) -> tuple[float, float]:
        return view.to_view(upright.to_picture(point, size), size)

    blobs: list[Blob | None] = []
    for blob in found.blobs:
        if blob is None:
            blobs.append(None)
            continue
        u, v = place((blob.u, blob.v))
        blobs.append(blob._replace(u=u, v=v))
    circle = found.circle._replace(centre_px=place(found.circle.centre_px))
    if turns % 2:
        circle = circle._replace(
            sigma_centre_px=circle.sigma_centre_px[::-1], correlation=-circle.correlation
        )
    ground = np.ascontiguousarray(np.rot90(found.ground, turns))
    return BobLook(view, ground, circle, found.area_px, tuple(blobs))
