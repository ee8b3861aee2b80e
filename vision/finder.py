"""Search for the cable in a whole picture, at a scale at which it is some three pixels wide."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from vision.line_fit import (
    MIN_ROWS,
    FloatArray,
    Grey,
    ImageLine,
    Rows,
    coarse_line,
)
from vision.ridge import CLEAR_ROWS, FLANK_PX, SLOPE_LIMIT, Levels, line_response, search
from vision.row_offsets import pixel_runs, refined_columns
from vision.templates import CableLook, make_templates

STRIP_PX = 40  # the cable may be 14 px from the prediction: 27 mrad at the bottom of the image
ROW_GROUP_PX = 4  # one point in each group of rows
MIN_RESPONSE_SIGMAS = 3.0  # line response of a dark pixel; noise exceeds it in 1 of 1,000 pixels
TEMPLATES = make_templates(CableLook())


class Found(NamedTuple):
    """Straight line as found, in pixels of the whole picture."""

    line: ImageLine
    ambiguous: bool  # a second line has nearly as many votes


class Points(NamedTuple):
    """Points on the cable near a line, in pixels of the whole picture."""

    line: ImageLine  # through most of them
    rows_px: FloatArray  # (N,)
    columns_px: FloatArray  # (N,)


class Finder:
    """Search in pictures of one size, reduced by a whole number."""

    def __init__(self, width: int, height: int, scale: int = 1) -> None:
        self._scale = scale
        self._width, self._height = width // scale, height // scale
        self._group_rows = np.arange(0, self._height - ROW_GROUP_PX + 1, ROW_GROUP_PX)
        self._groups = np.arange(len(self._group_rows))
        # weights over the strip: of two equal responses the nearer one wins, and the flanks of the
        # line filter stay in the strip
        distance = np.abs(np.arange(STRIP_PX) - STRIP_PX // 2)
        inside = distance <= STRIP_PX // 2 - FLANK_PX - 1
        weight = np.clip(255 - 6 * distance, 0, 255) * inside
        self._strip_weight = np.tile(weight.astype(np.uint8), (len(self._group_rows), 1))

    def find(self, image: Grey, pivot_px: tuple[float, float], levels: Levels) -> Found | None:
        """Search the whole picture for a line through the pivot; None if there is none."""
        small, pivot = self._reduced(image), self._small(pivot_px)
        noise = levels.noise / self._scale
        candidate = search(small, pivot, MIN_RESPONSE_SIGMAS * noise)
        if candidate is None:
            return None
        return Found(self._whole(candidate.line), candidate.ambiguous)

    def points(
        self, image: Grey, line: ImageLine, pivot_px: tuple[float, float], levels: Levels
    ) -> Points | None:
        """Search the strip around a line of the whole picture; None if nothing is there."""
        small = self._reduced(image)
        s = self._scale
        intercept = (line.intercept_px + 0.5 * (1 - line.slope) * (1 - s)) / s
        near = ImageLine(intercept, line.slope)
        threshold = MIN_RESPONSE_SIGMAS * levels.noise / s
        v, u = self._dark_points(small, near, self._small(pivot_px)[1], threshold)
        if len(v) < max(4, MIN_ROWS // s):
            return None
        found = coarse_line(v.astype(np.float64), u, near)
        if abs(found.slope) > SLOPE_LIMIT:
            return None
        shift = 0.5 * (s - 1)
        return Points(self._whole(found), s * v.astype(np.float64) + shift, s * u + shift)

    def _whole(self, line: ImageLine) -> ImageLine:
        """Scale a line to the whole picture."""
        s = self._scale
        return ImageLine(s * line.intercept_px + 0.5 * (s - 1) * (1.0 - line.slope), line.slope)

    def _dark_points(
        self, image: Grey, near: ImageLine, pivot_v: float, threshold: float
    ) -> tuple[Rows, FloatArray]:
        """Find the thin dark points of the strip: rows (N,) and columns (N,) to 0.1 px.

        At most one point in each group of rows.
        """
        start = np.rint(near.at(self._group_rows)).astype(np.intp) - STRIP_PX // 2
        start = np.minimum(np.maximum(start, 0), self._width - STRIP_PX)
        strip = pixel_runs(image, self._group_rows * self._width + start, STRIP_PX)
        response = line_response(strip.reshape(1, -1)).reshape(self._strip_weight.shape)
        weighted = cv2.multiply(response, self._strip_weight, scale=1.0 / 255.0)
        column = weighted.argmax(axis=1)
        below = self._group_rows > pivot_v + CLEAR_ROWS
        dark = (weighted[self._groups, column] > threshold) & below
        v = self._group_rows[dark]
        u = (start + column)[dark]
        half = TEMPLATES.half_px
        inside = (u >= half) & (u < self._width - half)
        return v[inside], refined_columns(image, v[inside], u[inside], TEMPLATES)

    def _reduced(self, image: Grey) -> Grey:
        if self._scale == 1:
            return image
        s = self._scale
        whole = image[: s * self._height, : s * self._width]
        size = (self._width, self._height)
        return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.uint8)

    def _small(self, pivot_px: tuple[float, float]) -> tuple[float, float]:
        """Scale a place in the whole picture."""
        s = self._scale
        return (pivot_px[0] + 0.5) / s - 0.5, (pivot_px[1] + 0.5) / s - 0.5
