"""Circle through points: the pivot of a bob, and its distance from it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vision.line_fit import FloatArray

MIN_POINTS = 5
ITERATIONS = 30
OUTLIER_SIGMAS = 4.0
MIN_SCATTER_PX = 0.01
SIGMA_PER_MAD = 1.4826


class Circle(NamedTuple):
    """Circle with its standard deviations [px]."""

    centre_px: tuple[float, float]
    radius_px: float
    sigma_centre_px: tuple[float, float]
    correlation: float  # of the errors of the two coordinates of the centre
    sigma_radius_px: float
    scatter_px: float  # rms distance of the points from the circle
    points: int  # within the scatter


def fit_circle(x: FloatArray, y: FloatArray) -> Circle | None:
    """Fit a circle to points x, y (N,) by least squared distances; None if they are on a line.

    Gauss-Newton from the algebraic fit (Kasa 1976); points beyond four deviations are left out.
    """
    near = np.ones(len(x), bool)
    found: Circle | None = None
    for _ in range(3):
        if np.count_nonzero(near) < MIN_POINTS:
            return None
        found = _fitted(x[near], y[near])
        if found is None:
            return None
        u, v = found.centre_px
        miss = np.abs(np.hypot(x - u, y - v) - found.radius_px)
        scatter = max(SIGMA_PER_MAD * float(np.median(miss)), MIN_SCATTER_PX)
        near = miss <= OUTLIER_SIGMAS * scatter
    return found


def _fitted(x: FloatArray, y: FloatArray) -> Circle | None:
    middle_x, middle_y = float(x.mean()), float(y.mean())
    u, v = x - middle_x, y - middle_y
    design = np.stack([2.0 * u, 2.0 * v, np.ones_like(u)], axis=1)
    start, _, rank, _ = np.linalg.lstsq(design, u * u + v * v, rcond=None)
    if rank < 3:
        return None
    a, b = float(start[0]), float(start[1])
    q = np.array([a, b, math.sqrt(max(float(start[2]) + a * a + b * b, 1e-12))])
    jacobian = design
    for _ in range(ITERATIONS):
        distance = np.maximum(np.hypot(u - q[0], v - q[1]), 1e-9)
        jacobian = np.stack([(q[0] - u) / distance, (q[1] - v) / distance, -np.ones_like(u)], 1)
        step = np.linalg.lstsq(jacobian, q[2] - distance, rcond=None)[0]
        q = q + step
        if float(np.abs(step).max()) < 1e-9:
            break
    if not np.isfinite(q).all():
        return None
    miss = np.hypot(u - q[0], v - q[1]) - q[2]
    variance = float(miss @ miss) / max(len(u) - 3, 1)
    # of the Jacobian, not of its square: the columns of a short arc are nearly the same
    _, singular, basis = np.linalg.svd(jacobian, full_matrices=False)
    scaled = basis.T / np.maximum(singular, 1e-12)
    inverse = scaled @ scaled.T
    deviations = np.sqrt(np.diag(inverse) * variance)
    correlation = float(inverse[0, 1]) / math.sqrt(float(inverse[0, 0] * inverse[1, 1]))
    return Circle(
        (middle_x + float(q[0]), middle_y + float(q[1])),
        float(q[2]),
        (float(deviations[0]), float(deviations[1])),
        correlation,
        float(deviations[2]),
        math.sqrt(float(miss @ miss) / len(u)),
        len(u),
    )
