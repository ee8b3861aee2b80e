"""Distance of the cable from an assumed axis, row by row: one Newton step of a correlation.

It is exact to a hundredth of a pixel.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.line_fit import FloatArray, Grey, RowOffsets, Rows
from vision.templates import PHASES, Templates

GRADIENT_ROWS = 40  # of a block in which the gradient of the background is averaged
GRADIENT_SIGMAS, MIN_GRADIENT_1_PX = 4.0, 0.1  # less is noise, rounding or a blurred edge
GAP_ROWS = 5  # in a row that show no cable; fewer are noise
MARGIN_ROWS = 12  # beside a gap; compression spreads an edge over 8 rows, and over 16 in colour
MAX_SCATTERED = 0.05  # of the rows, bad by themselves
MIN_LEFT = 0.6  # of the good rows
MAX_GRADIENT_1_PX = 3.0  # grey levels a pixel; more is an edge beside the cable
MIN_CURVATURE = 1e-6  # grey/px^2; avoids a division by zero


def pixel_runs(image: Grey, first: Rows, width: int) -> Grey:
    """Gather runs of `width` pixels of a C-contiguous image.

    first: (N,) flat index of the first pixel of each run. Returns (N, width); a run is gathered
    as one element.
    """
    every = np.ndarray((image.size - width + 1,), f"V{width}", image, strides=(1,))
    return every[first].view(np.uint8).reshape(-1, width)


def row_offsets(
    image: Grey, v: Rows, u: FloatArray, templates: Templates, noise: float
) -> RowOffsets:
    """Take one Newton step in each row to the stationary point of the correlation with a template.

    image (H, W) uint8 contiguous, v (N,) rows, u (N,) columns near the cable, at least the half
    width of the template from the border. A symmetric profile is stationary on its axis for any
    width, and the template is sampled at the sub-pixel phase: unlike a parabola through three
    pixels, the result is not biased towards whole or half pixels.
    """
    step = np.rint(u * PHASES)
    whole = step.astype(np.intp) + PHASES // 2
    centre = whole // PHASES
    chosen = templates.pairs.take(whole - centre * PHASES, axis=0)
    pixels = _pixels(image, v, centre, templates)
    first, second = np.einsum("nj,nkj->kn", pixels, chosen).astype(np.float64)
    gradient = _background_gradient(pixels, templates, noise)
    if gradient is not None:
        first -= templates.trend * gradient
    curvature = np.maximum(second, MIN_CURVATURE)
    return RowOffsets(first / curvature + (step / PHASES - u), curvature)


def _background_gradient(
    pixels: np.ndarray[Any, np.dtype[np.float32]], templates: Templates, noise: float
) -> FloatArray | None:
    """Measure the gradient of the background along rows (N, taps) [grey levels/px]; None if none.

    From the outer pixels on each side, which show no cable; means over blocks of rows.
    """
    blocks = len(pixels) // GRADIENT_ROWS
    if blocks < 2:
        return None
    part = pixels[: blocks * GRADIENT_ROWS].reshape(blocks, GRADIENT_ROWS, -1)
    noise_1_px = noise * templates.outer_norm / math.sqrt(GRADIENT_ROWS)
    limit = max(GRADIENT_SIGMAS * noise_1_px, MIN_GRADIENT_1_PX)
    if not _exceeds(np.einsum("bnj,j->b", part, templates.outer) / GRADIENT_ROWS, limit):
        return None
    gradient = np.einsum("bnj,j->bn", part, templates.outer)
    gradient[np.abs(gradient) > MAX_GRADIENT_1_PX] = 0.0
    mean = gradient.mean(axis=1)
    if not _exceeds(mean, limit):
        return None
    middles = (np.arange(blocks) + 0.5) * GRADIENT_ROWS - 0.5
    return np.asarray(np.interp(np.arange(len(pixels)), middles, mean))


def _exceeds(values: FloatArray, limit: float) -> bool:
    return any(abs(value) > limit for value in values.tolist())


def near_gap(good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark rows (N,) beside a gap in good rows: the edge of a load or a hand pulls them aside.

    None where single rows are bad all over, as in noise, or where too few rows would be left.
    """
    bad = (~good).astype(np.uint8)[:, None]
    kernel = np.ones((GAP_ROWS, 1), np.uint8)
    gaps = cv2.morphologyEx(bad, cv2.MORPH_OPEN, kernel)
    scattered = int(bad.sum()) - int(gaps.sum())
    none = np.zeros(good.size, np.bool_)
    if scattered > MAX_SCATTERED * good.size:
        return none
    joined = cv2.morphologyEx(bad, cv2.MORPH_CLOSE, kernel)  # across single rows that seem good
    gaps = cv2.morphologyEx(joined, cv2.MORPH_OPEN, kernel)
    near = cv2.dilate(gaps, np.ones((2 * MARGIN_ROWS + 1, 1), np.uint8)).ravel() > 0
    left = int(np.count_nonzero(good & ~near))
    return near if left >= MIN_LEFT * np.count_nonzero(good) else none


def refined_columns(image: Grey, v: Rows, u: Rows, templates: Templates) -> FloatArray:
    """Take the Newton step of row_offsets from whole pixels u (N,), in less time.

    Exact to 0.06 px; the step is at most one pixel.
    """
    pixels = _pixels(image, v, u, templates)
    first, second = (pixels @ templates.pairs[PHASES // 2].T).T
    step = np.minimum(np.maximum(first / np.maximum(second, MIN_CURVATURE), -1.0), 1.0)
    return np.asarray(u + step, np.float64)


def _pixels(
    image: Grey, v: Rows, centre: Rows, templates: Templates
) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Gather the (N, taps) pixels around columns centre (N,) of rows v (N,)."""
    first = v * image.shape[1] + (centre - templates.half_px)
    return pixel_runs(image, first, templates.taps).astype(np.float32)
