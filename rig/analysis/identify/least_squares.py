"""Nonlinear least squares for models that give their Jacobian, and covariance of the parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]
Numbers = npt.NDArray[Any]  # float, or complex while a derivative is computed
Model = Callable[[FloatArray], tuple[FloatArray, FloatArray]]  # p -> values (N,), Jacobian (N, P)

MAX_ITERATIONS = 60
MAX_DAMPING = 1e6  # no step reduces the cost any more
MIN_GAIN_REL = 1e-7  # of the variance of one sample
SINGULAR_REL = 1e-13  # eigenvalue of the scaled normal matrix below which a direction is unknown


def derivative(f: Callable[[Numbers], Numbers], p: FloatArray) -> FloatArray:
    """Compute the Jacobian (M, P) by complex steps, exact to rounding (Squire & Trapp 1998)."""
    h = 1e-30
    return np.stack([f(p + 1j * h * unit).imag / h for unit in np.eye(p.size)], axis=-1)


def levenberg_marquardt(
    model: Model,
    y: FloatArray,
    p: FloatArray,
    is_inside: Callable[[FloatArray], bool],
    min_gain: float = MIN_GAIN_REL,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Minimise the sum of squares of y - model(p), from p on, where is_inside holds.

    Stops when a step would gain less than min_gain, by default a ten-millionth, of the variance of
    one sample. Returns parameters (P,), residual (N,) and Jacobian (N, P).
    """
    values, J = model(p)
    residual = y - values
    best = float(residual @ residual)
    damping = 1e-6
    for _ in range(MAX_ITERATIONS):
        scale = _column_scale(J)
        H = (J.T @ J) / np.outer(scale, scale)
        g = (J.T @ residual) / scale
        step = np.linalg.solve(H + damping * np.eye(p.size), g)
        q = p + step / scale
        cost = math.inf
        if is_inside(q):
            values, J_q = model(q)
            residual_q = y - values
            cost = float(residual_q @ residual_q)
        if cost < best:
            p, best, residual, J = q, cost, residual_q, J_q
            damping = damping / 10
        else:
            damping *= 10
        if step @ g < min_gain * best / y.size or damping > MAX_DAMPING:
            break
    return p, residual, J


def influence(J: FloatArray) -> FloatArray:
    """Compute the pseudo-inverse (P, N) of a Jacobian: effect of each sample on each parameter."""
    scale = _column_scale(J)
    Js = J / scale
    eigenvalues, V = np.linalg.eigh(Js.T @ Js)
    known = eigenvalues > SINGULAR_REL * eigenvalues[-1]
    V = V[:, known]
    inverse: FloatArray = (V / eigenvalues[known]) @ (V.T @ Js.T) / scale[:, None]
    return inverse


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


def _column_scale(J: FloatArray) -> FloatArray:
    """Compute the norm of each column, 1 for a column of zeros."""
    scale = np.sqrt(np.einsum("np,np->p", J, J))
    return np.where(scale > 0, scale, 1.0)
