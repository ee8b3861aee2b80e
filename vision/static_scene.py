"""Static scene: what never moves in a series of pictures, and so is not the cable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from vision.line_fit import FloatArray, Grey, Rows

EDGE_LEVELS_PX = 3.0  # a steeper change of the level is structure [grey levels/px]
FLANK_PX = 2  # of a blurred edge, beyond where it is that steep
SMOOTH_PX = 0.8  # standard deviation, before the edges are looked for

Mask = np.ndarray[Any, np.dtype[np.bool_]]


def median_picture(pictures: Sequence[Grey]) -> Grey:
    """Compute the median of each pixel over pictures (height, width) of one size."""
    return np.asarray(np.median(np.stack(pictures), axis=0), np.uint8)


class StaticScene:
    """Picture (height, width) of what never moves, dark lines dark.

    reach_px: half the width of the templates: rows in which structure is nearer are not used.
    """

    def __init__(self, picture: Grey, reach_px: int) -> None:
        self.picture = np.ascontiguousarray(picture)
        self.reach_px = reach_px
        smooth = cv2.GaussianBlur(self.picture, (0, 0), SMOOTH_PX)
        slope = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=1, scale=0.5)
        edges = (np.abs(slope) > EDGE_LEVELS_PX).astype(np.uint8)
        kernel = np.ones((1, 2 * (reach_px + FLANK_PX) + 1), np.uint8)
        self._is_structure: Mask = cv2.dilate(edges, kernel).astype(bool)

    def reaching(self, reach_px: int) -> StaticScene:
        """Return the scene for templates as wide as that, at least."""
        return self if reach_px <= self.reach_px else StaticScene(self.picture, reach_px)

    def without(self, image: Grey) -> Grey:
        """Remove what never moves: a white picture with what is darker than the scene."""
        return np.asarray(cv2.bitwise_not(cv2.subtract(self.picture, image)), np.uint8)

    def is_free(self, v: Rows, u: FloatArray) -> Mask:
        """Mark the rows v (N,) in which nothing static is near column u (N,)."""
        column = np.rint(u).astype(np.intp)
        free: Mask = ~self._is_structure[v, column]
        return free
