"""A straight dark line to a hundredth of a pixel: template correlation in each row, Huber line over the rows."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, overload

import numpy as np

Grey = np.ndarray[Any, np.dtype[np.uint8]]
FloatArray = np.ndarray[Any, np.dtype[np.float64]]
Rows = np.ndarray[Any, np.dtype[np.intp]]

TEMPLATE_SIGMA_PX = 1.2  # close to a 2 to 3 px cable behind a sharp lens (deviation 1.0 to 1.25 px)
REACH_PX = 6  # template of 13 taps: five deviations to each side
TAPS = 2 * REACH_PX + 1
PHASES = 64  # templates a pixel
HUBER = 1.345  # deviations; 95 % efficient under normal noise (Huber 1981)
MAD_SIGMA = 1.4826  # normal deviation over median absolute deviation
HUBER_ROUNDS = 2  # reweighted fits of rows that already lie about a robust line
COARSE_PX = (5.0, 1.5)  # the coarse line's outlier scale shrinks from strip to pixel
FINEST_PX = 1e-3  # rows of a picture without noise may agree exactly; that makes nobody an outlier
MIN_ROWS = 8  # below this a scatter means nothing


class ImageLine(NamedTuple):
    """u = intercept_px + slope * v, in pixel coordinates (integer = pixel centre)."""

    intercept_px: float
    slope: float

    @overload
    def at(self, v: float) -> float: ...
    @overload
    def at(self, v: FloatArray | Rows) -> FloatArray: ...
    def at(self, v: float | FloatArray | Rows) -> float | FloatArray:
        """Column at row v [px]."""
        return self.intercept_px + self.slope * v  # type: ignore[return-value]


class RowOffsets(NamedTuple):
    """How far the cable is from a line in each row, and how well the row knows it."""

    offset_px: FloatArray  # (N,)
    stiffness: FloatArray  # (N,) curvature of the correlation [grey/px^2]; noise / stiffness is the row's deviation


class LineFit(NamedTuple):
    """A line and how well its rows agree."""

    line: ImageLine
    rows: int  # within three deviations of the line
    scatter_px: float  # rms distance of those rows
    sigma_slope: float  # one standard deviation, from the scatter
    stiffness: float  # rms over those rows [grey/px^2]


def _templates() -> np.ndarray[Any, np.dtype[np.float32]]:
    """(PHASES, 2, TAPS): first and second derivative of a unit Gaussian at each sub-pixel phase, -0.5 up to 0.5.

    Each sums to zero, so the background's level drops out.
    """
    phase = np.arange(PHASES)[:, None] / PHASES - 0.5
    x = (np.arange(-REACH_PX, REACH_PX + 1) - phase) / TEMPLATE_SIGMA_PX
    bell = np.exp(-0.5 * x * x) / (np.sqrt(2.0 * np.pi) * TEMPLATE_SIGMA_PX)
    pair = np.stack(
        [-x * bell / TEMPLATE_SIGMA_PX, (x * x - 1.0) * bell / TEMPLATE_SIGMA_PX**2], axis=1
    )
    return np.asarray(pair - pair.mean(axis=2, keepdims=True), np.float32)


TEMPLATES = _templates()
SLOPE_NORM = float(
    np.linalg.norm(TEMPLATES[PHASES // 2, 0])
)  # noise of the first derivative per grey level of noise
CURVE_NORM = float(np.linalg.norm(TEMPLATES[PHASES // 2, 1]))  # and of the second


def runs(image: Grey, first: Rows, width: int) -> Grey:
    """(N, width) pixels of the flat, C-contiguous image from first (N,) on; a run is gathered as one element."""
    every = np.ndarray((image.size - width + 1,), f"V{width}", image, strides=(1,))
    return every[first].view(np.uint8).reshape(-1, width)


def row_offsets(image: Grey, v: Rows, u: FloatArray) -> RowOffsets:
    """One Newton step, in each row, to where the correlation with a Gaussian is stationary.

    image (H, W) uint8 contiguous, v (N,) rows, u (N,) columns near the cable, at least REACH_PX from the border.
    A symmetric profile is stationary on its axis whatever its width, and the template is sampled at the sub-pixel phase:
    unlike a parabola through three pixels this has no preference for whole or half pixels.
    """
    step = np.rint(u * PHASES)
    whole = step.astype(np.intp) + PHASES // 2
    centre = whole // PHASES
    templates = TEMPLATES.take(whole - centre * PHASES, axis=0)
    first, second = np.einsum("nj,nkj->kn", _pixels(image, v, centre), templates).astype(np.float64)
    stiffness = np.maximum(second, 1e-6)
    return RowOffsets(first / stiffness + (step / PHASES - u), stiffness)


def refined_columns(image: Grey, v: Rows, u: Rows) -> FloatArray:
    """The same Newton step from whole pixels u (N,), quicker: good to 0.06 px, and never more than a pixel."""
    first, second = (_pixels(image, v, u) @ TEMPLATES[PHASES // 2].T).T
    return np.asarray(
        u + np.minimum(np.maximum(first / np.maximum(second, 1e-6), -1.0), 1.0), np.float64
    )


def _pixels(image: Grey, v: Rows, centre: Rows) -> np.ndarray[Any, np.dtype[np.float32]]:
    """(N, TAPS) pixels about columns centre (N,) of rows v (N,)."""
    return runs(image, v * image.shape[1] + (centre - REACH_PX), TAPS).astype(np.float32)


def coarse_line(
    v: FloatArray, u: FloatArray, start: ImageLine, trust: FloatArray | float = 1.0
) -> ImageLine:
    """Line through points (N,), N >= 2, many of them wrong: Geman-McClure weights, times trust, with a shrinking scale."""
    offset = u - start.at(v)
    moments = _moments(v, offset)
    residual = offset - _median(offset)
    line = ImageLine(0.0, 0.0)
    for scale in COARSE_PX:
        line = _solve(moments, trust / np.square(1.0 + np.square(residual / scale)))
        residual = offset - line.at(v)
    return ImageLine(start.intercept_px + line.intercept_px, start.slope + line.slope)


def huber_line(v: FloatArray, offsets: RowOffsets, start: ImageLine) -> LineFit:
    """Huber line by reweighted least squares at rows v (N,), N >= MIN_ROWS, about start, a robust line already.

    A row counts by its stiffness squared, as in a Gauss-Newton step on the picture itself.
    """
    offset, stiffness = offsets
    moments = _moments(v, offset)
    precision = stiffness * stiffness
    line, residual, reach = ImageLine(0.0, 0.0), offset, 0.0
    finest = FINEST_PX * float(stiffness.max())
    apart = np.abs(offset) * stiffness  # from the line, in deviations but for a factor
    for _ in range(HUBER_ROUNDS):
        reach = max(HUBER * MAD_SIGMA * _median(apart), finest)
        line = _solve(
            moments, precision / np.maximum(apart, reach)
        )  # least squares up to reach, then absolute values
        residual = offset - line.at(v)
        apart = np.abs(residual) * stiffness
    near = apart <= 3.0 / HUBER * reach
    moved = ImageLine(start.intercept_px + line.intercept_px, start.slope + line.slope)
    return _described(moved, moments, residual, precision * near, int(np.count_nonzero(near)))


def _described(
    line: ImageLine, moments: FloatArray, residual: FloatArray, precision: FloatArray, rows: int
) -> LineFit:
    """The fit with its scatter and sigma_slope^2 = (scatter^2 per unit weight) / (weighted spread of the rows)."""
    total, first, second, _, _ = (moments @ precision).tolist()
    squares = float(precision @ np.square(residual))
    spread = max(second - first * first / total, 1e-9)
    sigma_slope = math.sqrt(squares / max(rows - 2, 1) / spread)
    return LineFit(line, rows, math.sqrt(squares / total), sigma_slope, math.sqrt(total / rows))


def _moments(v: FloatArray, y: FloatArray) -> FloatArray:
    """(5, N): 1, v, v^2, y, v y, whose weighted sums are all that a straight line needs."""
    moments = np.empty((5, len(v)))
    moments[0], moments[1], moments[3] = 1.0, v, y
    np.multiply(v, v, out=moments[2])
    np.multiply(v, y, out=moments[4])
    return moments


def _solve(moments: FloatArray, weight: FloatArray) -> ImageLine:
    """Weighted least squares line y over v."""
    s0, s1, s2, y0, y1 = (moments @ weight).tolist()
    determinant = s0 * s2 - s1 * s1
    return ImageLine((s2 * y0 - s1 * y1) / determinant, (s0 * y1 - s1 * y0) / determinant)


def _median(x: FloatArray) -> float:
    """Upper median to seven digits: sorting some hundred single-precision numbers is nine times quicker than np.median."""
    ordered = x.astype(np.float32)
    ordered.sort()
    return float(ordered[len(x) // 2])
