"""Moving blob in a picture: its place to a few hundredths of a pixel."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np

from vision.line_fit import Grey

MIN_AREA_PX = 40
MIN_SIGMAS = 5.0  # of the noise, darker than the ground
MIN_LEVELS = 8.0
OPENING_PX = 5  # a cable thinner than this is not part of the blob
CONTRAST_SHARE = 0.3  # of the contrast of the blob, at its edge
MIN_CONTRAST_SHARE = 0.3  # of a ground that is nearly as dark as the blob
EDGE_PX = 3  # beyond the edge, still weighted

Mask = np.ndarray[Any, np.dtype[np.bool_]]


class Blob(NamedTuple):
    """Largest dark region of a picture."""

    u: float  # centroid [px]
    v: float
    sigma_px: tuple[float, float]  # of the centroid, by the noise of the pixels
    area_px: int
    contrast: float  # median depth [grey levels]
    touches_border: bool
    rows: int


def find_blob(ground: Grey, picture: Grey, noise: float) -> Blob | None:
    """Find the largest region of picture (height, width) that is darker than the ground.

    The centroid is weighted with the share of each pixel that is covered. noise: of a pixel.
    """
    depth = np.asarray(cv2.subtract(ground, picture), np.uint8)
    mask = blob_mask(depth, noise)
    if mask is None:
        return None
    contrast = float(np.median(depth[mask]))
    sharp = blob_mask(depth, noise, CONTRAST_SHARE * contrast)
    if sharp is None:
        return None
    rows, columns = np.flatnonzero(sharp.any(axis=1)), np.flatnonzero(sharp.any(axis=0))
    top, bottom = int(rows[0]) - EDGE_PX, int(rows[-1]) + EDGE_PX + 1
    left, right = int(columns[0]) - EDGE_PX, int(columns[-1]) + EDGE_PX + 1
    height, width = depth.shape
    touches = top < 0 or left < 0 or bottom > height or right > width
    box = slice(max(top, 0), bottom), slice(max(left, 0), right)
    kernel = np.ones((2 * EDGE_PX + 1, 2 * EDGE_PX + 1), np.uint8)
    near = cv2.dilate(sharp[box].astype(np.uint8), kernel)
    # share of each pixel that the blob covers, whatever the ground is there
    level = float(np.median(picture[sharp]))
    whole = np.maximum(ground[box].astype(np.float64) - level, MIN_CONTRAST_SHARE * contrast)
    weight = (ground[box].astype(np.float64) - picture[box]) / whole * near
    total = float(weight.sum())
    v, u = np.mgrid[box[0].start : box[0].start + weight.shape[0], 0 : weight.shape[1]]
    u = u + box[1].start
    centre_u, centre_v = float((weight * u).sum()) / total, float((weight * v).sum()) / total
    # each pixel moves the centroid by its distance from it over the sum of the weights
    noise_square = near * np.square(noise / whole)
    spread_u = math.sqrt(float((noise_square * np.square(u - centre_u)).sum()))
    spread_v = math.sqrt(float((noise_square * np.square(v - centre_v)).sum()))
    sigma = (spread_u / total, spread_v / total)
    return Blob(
        centre_u, centre_v, sigma, int(np.count_nonzero(sharp)), contrast, touches, rows.size
    )


def blob_mask(depth: Grey, noise: float, threshold: float = 0.0) -> Mask | None:
    """Mark the largest region of depth (height, width) that is thicker than a cable."""
    threshold = max(threshold, MIN_SIGMAS * noise, MIN_LEVELS)
    _, above = cv2.threshold(depth, threshold, 1, cv2.THRESH_BINARY)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (OPENING_PX, OPENING_PX))
    opened = cv2.morphologyEx(above, cv2.MORPH_OPEN, kernel)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=8)
    if count < 2:
        return None
    areas = stats[1:, cv2.CC_STAT_AREA]
    largest = int(areas.argmax())
    if areas[largest] < MIN_AREA_PX:
        return None
    mask: Mask = labels == largest + 1
    return mask
