"""Line fit of a thin dark line: template correlation in each row, Huber line over the rows.

The line is exact to a hundredth of a pixel.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, overload

import numpy as np

Grey = np.ndarray[Any, np.dtype[np.uint8]]
FloatArray = np.ndarray[Any, np.dtype[np.float64]]
Rows = np.ndarray[Any, np.dtype[np.intp]]

TEMPLATE_SIGMA_PX = 1.2  # close to a 2 to 3 px cable behind a sharp lens (sigma 1.0 to 1.25 px)
TEMPLATE_HALF_PX = 6  # template of 13 taps: five sigma to each side
TAPS = 2 * TEMPLATE_HALF_PX + 1
PHASES = 64  # templates per pixel
HUBER_SIGMAS = 1.345  # 95 % efficient with normal noise (Huber 1981)
SIGMA_PER_MAD = 1.4826  # normal standard deviation over median absolute deviation
HUBER_ITERATIONS = 2  # reweighted fits, from a robust line
COARSE_SCALES_PX = (5.0, 1.5)  # outlier scales of the coarse line, from strip to pixel
MIN_SCALE_PX = 1e-3  # lower bound: without noise the rows may agree exactly
MIN_ROWS = 8  # fewer rows give no useful scatter
MIN_CURVATURE = 1e-6  # grey/px^2; avoids a division by zero


class ImageLine(NamedTuple):
    """Line in the image: u = intercept_px + slope * v, in pixels (integer = pixel centre)."""

    intercept_px: float
    slope: float

    @overload
    def at(self, v: float) -> float: ...
    @overload
    def at(self, v: FloatArray | Rows) -> FloatArray: ...
    def at(self, v: float | FloatArray | Rows) -> float | FloatArray:
        """Compute the column u at row v [px]."""
        return self.intercept_px + self.slope * v  # type: ignore[return-value]


class RowOffsets(NamedTuple):
    """Distance of the cable from a line, row by row."""

    offset_px: FloatArray  # (N,)
    # (N,) of the correlation [grey/px^2]; noise / curvature is the standard deviation of the row
    curvature: FloatArray


class LineFit(NamedTuple):
    """Fitted line and the scatter of its rows."""

    line: ImageLine
    rows: int  # within three deviations of the line
    scatter_px: float  # rms distance of those rows
    sigma_slope: float  # one standard deviation, from the scatter
    curvature: float  # rms over those rows [grey/px^2]


def _templates() -> np.ndarray[Any, np.dtype[np.float32]]:
    """Compute the templates (PHASES, 2, TAPS): derivatives 1 and 2 of a unit Gaussian.

    One pair for each sub-pixel phase, from -0.5 up to 0.5. Each sums to zero, so the level of the
    background cancels.
    """
    phase = np.arange(PHASES)[:, None] / PHASES - 0.5
    x = (np.arange(-TEMPLATE_HALF_PX, TEMPLATE_HALF_PX + 1) - phase) / TEMPLATE_SIGMA_PX
    gauss = np.exp(-0.5 * x * x) / (np.sqrt(2.0 * np.pi) * TEMPLATE_SIGMA_PX)
    first = -x * gauss / TEMPLATE_SIGMA_PX
    second = (x * x - 1.0) * gauss / TEMPLATE_SIGMA_PX**2
    pair = np.stack([first, second], axis=1)
    return np.asarray(pair - pair.mean(axis=2, keepdims=True), np.float32)


TEMPLATES = _templates()
# noise of the first and of the second derivative per grey level of noise
FIRST_NORM = float(np.linalg.norm(TEMPLATES[PHASES // 2, 0]))
SECOND_NORM = float(np.linalg.norm(TEMPLATES[PHASES // 2, 1]))


def pixel_runs(image: Grey, first: Rows, width: int) -> Grey:
    """Gather runs of `width` pixels of a C-contiguous image.

    first: (N,) flat index of the first pixel of each run. Returns (N, width); a run is gathered
    as one element.
    """
    every = np.ndarray((image.size - width + 1,), f"V{width}", image, strides=(1,))
    return every[first].view(np.uint8).reshape(-1, width)


def row_offsets(image: Grey, v: Rows, u: FloatArray) -> RowOffsets:
    """Take one Newton step in each row to the stationary point of the correlation with a Gaussian.

    image (H, W) uint8 contiguous, v (N,) rows, u (N,) columns near the cable, at least
    TEMPLATE_HALF_PX from the border. A symmetric profile is stationary on its axis for any width,
    and the template is sampled at the sub-pixel phase: unlike a parabola through three pixels, the
    result is not biased towards whole or half pixels.
    """
    step = np.rint(u * PHASES)
    whole = step.astype(np.intp) + PHASES // 2
    centre = whole // PHASES
    templates = TEMPLATES.take(whole - centre * PHASES, axis=0)
    first, second = np.einsum("nj,nkj->kn", _pixels(image, v, centre), templates).astype(np.float64)
    curvature = np.maximum(second, MIN_CURVATURE)
    return RowOffsets(first / curvature + (step / PHASES - u), curvature)


def refined_columns(image: Grey, v: Rows, u: Rows) -> FloatArray:
    """Take the Newton step of row_offsets from whole pixels u (N,), in less time.

    Exact to 0.06 px; the step is at most one pixel.
    """
    first, second = (_pixels(image, v, u) @ TEMPLATES[PHASES // 2].T).T
    step = np.minimum(np.maximum(first / np.maximum(second, MIN_CURVATURE), -1.0), 1.0)
    return np.asarray(u + step, np.float64)


def _pixels(image: Grey, v: Rows, centre: Rows) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Gather the (N, TAPS) pixels around columns centre (N,) of rows v (N,)."""
    first = v * image.shape[1] + (centre - TEMPLATE_HALF_PX)
    return pixel_runs(image, first, TAPS).astype(np.float32)


def coarse_line(
    v: FloatArray, u: FloatArray, start: ImageLine, weight: FloatArray | float = 1.0
) -> ImageLine:
    """Fit a line to points (N,), N >= 2, with many outliers.

    The Geman-McClure weights, with decreasing scale, are multiplied by weight (N,).
    """
    offset = u - start.at(v)
    moments = _moments(v, offset)
    residual = offset - _median(offset)
    line = ImageLine(0.0, 0.0)
    for scale in COARSE_SCALES_PX:
        line = _solve(moments, weight / np.square(1.0 + np.square(residual / scale)))
        residual = offset - line.at(v)
    return _add(start, line)


def huber_line(v: FloatArray, offsets: RowOffsets, start: ImageLine) -> LineFit:
    """Fit a Huber line by reweighted least squares at rows v (N,), N >= MIN_ROWS.

    start is a robust line. The weight of a row is its curvature squared, as in a Gauss-Newton step
    on the image.
    """
    offset, curvature = offsets
    moments = _moments(v, offset)
    precision = curvature * curvature
    line = ImageLine(0.0, 0.0)
    residual = offset
    threshold = 0.0
    min_threshold = MIN_SCALE_PX * float(curvature.max())
    distance = np.abs(offset) * curvature  # proportional to the distance in sigmas
    for _ in range(HUBER_ITERATIONS):
        threshold = max(HUBER_SIGMAS * SIGMA_PER_MAD * _median(distance), min_threshold)
        # least squares up to the threshold, absolute values beyond
        line = _solve(moments, precision / np.maximum(distance, threshold))
        residual = offset - line.at(v)
        distance = np.abs(residual) * curvature
    near = distance <= 3.0 / HUBER_SIGMAS * threshold
    rows = int(np.count_nonzero(near))
    return _with_scatter(_add(start, line), moments, residual, precision * near, rows)


def _add(a: ImageLine, b: ImageLine) -> ImageLine:
    return ImageLine(a.intercept_px + b.intercept_px, a.slope + b.slope)


def _with_scatter(
    line: ImageLine, moments: FloatArray, residual: FloatArray, precision: FloatArray, rows: int
) -> LineFit:
    """Compute the scatter of the rows about a line.

    sigma_slope^2 = (scatter^2 per unit weight) / (weighted spread of the rows).
    """
    total, first, second, _, _ = (moments @ precision).tolist()
    squares = float(precision @ np.square(residual))
    spread = max(second - first * first / total, 1e-9)
    sigma_slope = math.sqrt(squares / max(rows - 2, 1) / spread)
    return LineFit(line, rows, math.sqrt(squares / total), sigma_slope, math.sqrt(total / rows))


def _moments(v: FloatArray, y: FloatArray) -> FloatArray:
    """Compute (5, N): 1, v, v^2, y, v y; their weighted sums give the least squares line."""
    moments = np.empty((5, len(v)))
    moments[0] = 1.0
    moments[1] = v
    moments[3] = y
    np.multiply(v, v, out=moments[2])
    np.multiply(v, y, out=moments[4])
    return moments


def _solve(moments: FloatArray, weight: FloatArray) -> ImageLine:
    """Solve the weighted least squares of a line y over v."""
    s0, s1, s2, y0, y1 = (moments @ weight).tolist()
    determinant = s0 * s2 - s1 * s1
    return ImageLine((s2 * y0 - s1 * y1) / determinant, (s0 * y1 - s1 * y0) / determinant)


def _median(x: FloatArray) -> float:
    """Compute the upper median to seven digits.

    Sorting some hundred single-precision numbers takes a ninth of the time of np.median.
    """
    ordered = x.astype(np.float32)
    ordered.sort()
    return float(ordered[len(x) // 2])
