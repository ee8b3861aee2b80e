"""Fit of the axis of a thin line over its rows: a Huber fit, and the correlation of the rows."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, overload

import numpy as np

Grey = np.ndarray[Any, np.dtype[np.uint8]]
FloatArray = np.ndarray[Any, np.dtype[np.float64]]
Rows = np.ndarray[Any, np.dtype[np.intp]]

HUBER_SIGMAS = 1.345  # 95 % efficient with normal noise (Huber 1981)
SIGMA_PER_MAD = 1.4826  # normal standard deviation over median absolute deviation
HUBER_ITERATIONS = 2  # reweighted fits, from a robust line
COARSE_SCALES_PX = (5.0, 1.5)  # outlier scales of the coarse line, from strip to pixel
MIN_SCALE_PX = 1e-3  # lower bound: without noise the rows may agree exactly
MIN_ROWS = 8  # fewer rows give no useful scatter
NO_NUMBERS: FloatArray = np.zeros(0)
NO_COVARIANCE: FloatArray = np.zeros((0, 0))
BLOCK_ROWS = 16  # rows averaged to see their correlation


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
    """Distance of the cable from an assumed axis, row by row."""

    offset_px: FloatArray  # (N,)
    # (N,) of the correlation [grey/px^2]; noise / curvature is the standard deviation of the row
    curvature: FloatArray


class AxisFit(NamedTuple):
    """Fitted axis and the scatter of its rows."""

    shift: float  # at t = 0, to be added to the assumed axis
    slope: float  # of t
    variance_slope: float
    further: FloatArray  # (P - 2,) of the rest of the basis
    is_near: np.ndarray[Any, np.dtype[np.bool_]]  # (N,) within three deviations of the axis
    rows: int  # number of those
    scatter_px: float  # rms distance of those rows
    curvature: float  # rms over those rows [grey/px^2]
    residual_px: FloatArray  # (N,)
    covariance: FloatArray  # (P, P) of the coefficients, from the scatter; (0, 0) of a line


def coarse_line(
    v: FloatArray, u: FloatArray, start: ImageLine, weight: FloatArray | float = 1.0
) -> ImageLine:
    """Fit a line to points (N,), N >= 2, with many outliers.

    The Geman-McClure weights, with decreasing scale, are multiplied by weight (N,).
    """
    offset = u - start.at(v)
    basis = np.stack([np.ones_like(v), v])
    residual = offset - median(offset)
    found = np.zeros(2)
    for scale in COARSE_SCALES_PX:
        found = _solve(basis, offset, weight / np.square(1.0 + np.square(residual / scale)))
        residual = offset - found @ basis
    return ImageLine(start.intercept_px + float(found[0]), start.slope + float(found[1]))


def huber_line(t: FloatArray, offsets: RowOffsets) -> AxisFit:
    """Fit a line over t (N,) to offsets (N,), N >= MIN_ROWS, as huber_fit does in more time."""
    offset, curvature = offsets
    moments = np.empty((5, len(t)))  # their weighted sums give the least squares line
    moments[0] = 1.0
    moments[1] = t
    moments[3] = offset
    np.multiply(t, t, out=moments[2])
    np.multiply(t, offset, out=moments[4])
    precision = curvature * curvature
    shift = slope = threshold = 0.0
    residual = offset
    min_threshold = MIN_SCALE_PX * float(curvature.max())
    distance = np.abs(offset) * curvature
    for _ in range(HUBER_ITERATIONS):
        threshold = max(HUBER_SIGMAS * SIGMA_PER_MAD * median(distance), min_threshold)
        s0, s1, s2, y0, y1 = (moments @ (precision / np.maximum(distance, threshold))).tolist()
        determinant = s0 * s2 - s1 * s1
        shift = (s2 * y0 - s1 * y1) / determinant
        slope = (s0 * y1 - s1 * y0) / determinant
        residual = offset - (shift + slope * t)
        distance = np.abs(residual) * curvature
    is_near = distance <= 3.0 / HUBER_SIGMAS * threshold
    rows = int(np.count_nonzero(is_near))
    used = precision * is_near
    total, first, second = (moments[:3] @ used).tolist()
    squares = float(used @ np.square(residual))
    spread = max(second - first * first / total, 1e-12)
    return AxisFit(
        shift,
        slope,
        squares / max(rows - 2, 1) / spread,
        NO_NUMBERS,
        is_near,
        rows,
        math.sqrt(squares / total),
        math.sqrt(total / max(rows, 1)),
        residual,
        NO_COVARIANCE,
    )


def huber_fit(basis: FloatArray, offsets: RowOffsets) -> AxisFit:
    """Fit a linear combination of basis (P, N) to offsets (N,), N >= MIN_ROWS.

    Reweighted least squares (Huber), from the assumed axis, which is robust. The weight of a row is
    its curvature squared, as in a Gauss-Newton step on the image.
    """
    offset, curvature = offsets
    precision = curvature * curvature
    found = np.zeros(len(basis))
    residual = offset
    threshold = 0.0
    min_threshold = MIN_SCALE_PX * float(curvature.max())
    distance = np.abs(offset) * curvature  # proportional to the distance in sigmas
    for _ in range(HUBER_ITERATIONS):
        threshold = max(HUBER_SIGMAS * SIGMA_PER_MAD * median(distance), min_threshold)
        # least squares up to the threshold, absolute values beyond
        found = _solve(basis, offset, precision / np.maximum(distance, threshold))
        residual = offset - found @ basis
        distance = np.abs(residual) * curvature
    is_near = distance <= 3.0 / HUBER_SIGMAS * threshold
    rows = int(np.count_nonzero(is_near))
    used = precision * is_near
    total = float(used.sum())
    squares = float(used @ np.square(residual))
    inverse = _inverse((basis * used) @ basis.T)
    covariance = squares / max(rows - len(basis), 1) * inverse
    return AxisFit(
        float(found[0]),
        float(found[1]),
        float(covariance[1, 1]),
        found[2:],
        is_near,
        rows,
        math.sqrt(squares / total),
        math.sqrt(total / max(rows, 1)),
        residual,
        covariance,
    )


def correlation_factor(residual_px: FloatArray) -> float:
    """Estimate how much the correlation of rows raises the variance of a fitted line, >= 0.

    residual_px: (N,) of neighbouring rows, 0 where a row is not used. The variance of sums of
    BLOCK_ROWS rows over that of independent rows; about 1 for white noise, 1 + 2 sum rho in
    general.
    """
    blocks = len(residual_px) // BLOCK_ROWS
    if blocks < 4:
        return 1.0
    used = residual_px[: blocks * BLOCK_ROWS]
    sums = used.reshape(blocks, BLOCK_ROWS).sum(axis=1)
    whole = float(np.dot(used, used))
    return float(np.dot(sums, sums)) / whole if whole > 0.0 else 1.0


def local_noise(residual_px: FloatArray) -> tuple[float, float]:
    """Estimate the noise of rows around a smooth curve: deviation [px], correlation factor.

    residual_px: (N,) of neighbouring rows, in which a smooth curve may be left. The deviation is
    that within blocks of rows, the factor is that of second differences of their means.
    """
    blocks = len(residual_px) // BLOCK_ROWS
    if blocks < 4:
        return math.sqrt(float(np.mean(np.square(residual_px)))), 1.0
    parts = residual_px[: blocks * BLOCK_ROWS].reshape(blocks, BLOCK_ROWS)
    means = parts.mean(axis=1)
    inner = parts - means[:, None]
    variance = float(np.square(inner).sum()) / (blocks * (BLOCK_ROWS - 1))
    bends = means[:-2] - 2.0 * means[1:-1] + means[2:]
    # of independent rows: 1 + 4 + 1 times the variance of a mean
    expected = 6.0 * max(variance, 1e-12) / BLOCK_ROWS
    return math.sqrt(variance), float(np.mean(np.square(bends))) / expected


def _solve(basis: FloatArray, y: FloatArray, weight: FloatArray) -> FloatArray:
    """Solve the weighted least squares of y (N,) over basis (P, N)."""
    weighted = basis * weight
    return np.asarray(_inverse(weighted @ basis.T) @ (weighted @ y))


def _inverse(a: FloatArray) -> FloatArray:
    """Invert a symmetric matrix; of two or three rows LAPACK takes three times as long."""
    if len(a) > 3:
        return np.asarray(np.linalg.pinv(a, hermitian=True))
    if len(a) == 2:
        (p, q), (_, r) = a.tolist()
        scale = 1.0 / max(p * r - q * q, 1e-300)
        return np.array([[r * scale, -q * scale], [-q * scale, p * scale]])
    (p, q, r), (_, s, t), (_, _, w) = a.tolist()
    x, y, z = s * w - t * t, r * t - q * w, q * t - r * s
    determinant = p * x + q * y + r * z
    scale = 1.0 / determinant if determinant else 0.0
    m, n, k = p * w - r * r, q * r - p * t, p * s - q * q
    return np.array([[x, y, z], [y, m, n], [z, n, k]]) * scale


def median(x: FloatArray) -> float:
    """Compute the upper median to seven digits.

    Sorting some hundred single-precision numbers takes a ninth of the time of np.median.
    """
    ordered = x.astype(np.float32)
    ordered.sort()
    return float(ordered[len(x) // 2])
