"""Nonlinear least squares with a derivative by complex steps, and covariance of its parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]
Numbers = npt.NDArray[Any]  # float, or complex while a derivative is computed

MAX_ITERATIONS = 60
MAX_DAMPING = 1e6  # no step reduces the cost any more
MIN_GAIN_REL = 1e-7  # of the variance of one sample


def derivative(f: Callable[[Numbers], Numbers], p: FloatArray) -> FloatArray:
    """Compute the Jacobian (M, P) by complex steps, exact to rounding (Squire & Trapp 1998)."""
    h = 1e-30
    return np.stack([f(p + 1j * h * unit).imag / h for unit in np.eye(p.size)], axis=-1)


def levenberg_marquardt(
    model: Callable[[Numbers], Numbers],
    y: FloatArray,
    p: FloatArray,
    is_inside: Callable[[FloatArray], bool],
) -> FloatArray:
    """Minimise the sum of squares of y - model(p), from p on, where is_inside holds.

    Stops when a step would gain less than a ten-millionth of the variance of one sample.
    """

    def cost(q: FloatArray) -> float:
        inside = is_inside(q)
        return float(np.sum((y - model(q)) ** 2)) if inside else math.inf

    best = cost(p)
    damping = 1e-6
    for _ in range(MAX_ITERATIONS):
        J = derivative(model, p)
        scale = np.linalg.norm(J, axis=0)
        H = (J / scale).T @ (J / scale)
        g = (J / scale).T @ (y - model(p))
        step = np.linalg.solve(H + damping * np.eye(p.size), g)
        trial = cost(p + step / scale)
        if trial < best:
            p = p + step / scale
            best = trial
            damping = damping / 10
        else:
            damping *= 10
        if step @ g < MIN_GAIN_REL * best / y.size or damping > MAX_DAMPING:
            break
    return p


def unit_covariance(
    pseudo_inverse: FloatArray, tau: FloatArray, average_frames: int, frame_period_s: float
) -> FloatArray:
    """Compute the covariance (P, P) of the parameters for samples of unit variance.

    pseudo_inverse (P, N): influence of each sample on each parameter.

    A sample is the mean of N frames and its variance s^2 that of a frame over N. The noise of one
    frame enters the N samples around it, each with weight 1/N, so a parameter receives v_f / N of
    it, v_f the sum of the influences of those samples:
    covariance = N s^2 sum_f (v_f / N)(v_f / N)'. A slow model has v_f = N times one influence: the
    covariance is N times that of white samples. Averaging neighbours brings no information.
    """
    if average_frames == 1:
        return pseudo_inverse @ pseudo_inverse.T
    frame = np.rint(tau / frame_period_s).astype(np.int64)
    v = np.zeros((int(frame[-1]) + average_frames, pseudo_inverse.shape[0]))
    for k in range(average_frames):
        np.add.at(v, frame + k, pseudo_inverse.T)
    covariance: FloatArray = v.T @ v / average_frames
    return covariance


def degrees_of_freedom(covariance: FloatArray, J: FloatArray) -> float:
    """Compute the expected sum of squared residuals of samples of unit variance.

    It is N minus the variance that the model takes up. Raises AnalysisError when it is below 1.
    """
    degrees = float(J.shape[0] - np.sum((J @ covariance) * J))
    if degrees < 1:
        raise AnalysisError(
            f"{J.shape[0]} samples leave {degrees:.1f} degrees of freedom; need 1: watch longer"
        )
    return degrees
