"""Modes of a load of several links from the angle of its first link, as a camera sees it; pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
FREQUENCY_BAND_REL = 0.15  # about the frequency of the model, in which that of a mode is searched
MAX_DAMPING_RATIO = 0.02
MIN_SAMPLES_PER_MODE = 20
MIN_AMPLITUDE_SIGMAS = 5.0  # the frequency of a smaller mode is not known


class MeasuredMode(NamedTuple):
    """Mode in the swing of the first link; each sigma is one standard deviation."""

    frequency_hz: float | None  # undamped; None for a mode that is lost in the noise
    sigma_frequency_hz: float
    amplitude_rad: float  # of the first link, at the instant of the fit
    sigma_amplitude_rad: float


def fit_modes(
    t_s: FloatArray, angle_rad: FloatArray, model_hz: Sequence[float]
) -> tuple[MeasuredMode, ...]:
    """Fit a decaying sinusoid for each mode, and an offset, by variable projection.

    t_s (N,) from the instant of the amplitudes; angle_rad (N,) of the first link; model_hz: natural
    frequencies of the model, near which they are searched. Empty for too few samples.
    """
    from scipy.optimize import least_squares

    count = len(model_hz)
    if t_s.size < MIN_SAMPLES_PER_MODE * count:
        return ()
    start = 2.0 * math.pi * np.asarray(model_hz)
    unit = float(np.std(angle_rad)) or 1.0

    def residual(q: FloatArray) -> FloatArray:
        basis = _basis(t_s, start, q)
        found: FloatArray = angle_rad - basis @ np.linalg.lstsq(basis, angle_rad, rcond=None)[0]
        return found / unit

    first = np.concatenate([np.zeros(count), np.full(count, 1e-3)])
    bounds = (np.repeat([-1.0, 0.0], count), np.repeat([1.0, 1.0], count))
    q = least_squares(residual, first, bounds=bounds, xtol=1e-12, ftol=1e-12).x
    basis = _basis(t_s, start, q)
    coefficients = np.asarray(np.linalg.lstsq(basis, angle_rad, rcond=None)[0], np.float64)
    squares = float(np.sum(np.square(angle_rad - basis @ coefficients)))
    variance = squares / (t_s.size - 4 * count - 1)
    sigma = np.sqrt(variance * np.diag(_covariance(t_s, start, q, coefficients)))
    modes = []
    for k in range(count):
        amplitude = math.hypot(coefficients[2 * k], coefficients[2 * k + 1])
        sigma_amplitude = float(math.hypot(sigma[2 * k], sigma[2 * k + 1]) / math.sqrt(2.0))
        scale_hz = FREQUENCY_BAND_REL * model_hz[k]
        frequency: float | None = model_hz[k] + scale_hz * float(q[k])
        sigma_frequency = scale_hz * float(sigma[2 * count + 1 + k])
        if amplitude < MIN_AMPLITUDE_SIGMAS * sigma_amplitude:
            frequency, sigma_frequency = None, 0.0
        modes.append(MeasuredMode(frequency, sigma_frequency, amplitude, sigma_amplitude))
    return tuple(modes)


def largest_link_swing(
    modes: Sequence[MeasuredMode], mode_shapes: FloatArray
) -> tuple[float, float]:
    """Compute the swing of the link that swings most when the modes come into phase, and its sigma.

    mode_shapes (links, modes): angles of the links in each mode of the model.
    """
    shares = np.abs(mode_shapes / mode_shapes[0])  # of the first link
    amplitudes = np.array([mode.amplitude_rad for mode in modes])
    sigmas = np.array([mode.sigma_amplitude_rad for mode in modes])
    link = int(np.argmax(shares @ amplitudes))
    return float(shares[link] @ amplitudes), float(np.linalg.norm(shares[link] * sigmas))


def _basis(t_s: FloatArray, start_rad_s: FloatArray, q: FloatArray) -> FloatArray:
    """Compute the basis (N, 2 n + 1): decaying cosine and sine of each mode, and one."""
    count = start_rad_s.size
    columns = []
    for k in range(count):
        omega = start_rad_s[k] * (1.0 + FREQUENCY_BAND_REL * q[k])
        zeta = MAX_DAMPING_RATIO * q[count + k]
        envelope = np.exp(-zeta * omega * t_s)
        damped = omega * math.sqrt(1.0 - zeta * zeta)
        columns += [envelope * np.cos(damped * t_s), envelope * np.sin(damped * t_s)]
    return np.stack([*columns, np.ones_like(t_s)], axis=1)


def _covariance(
    t_s: FloatArray, start_rad_s: FloatArray, q: FloatArray, coefficients: FloatArray
) -> FloatArray:
    """Compute (J'J)^-1 of the coefficients and of q, by central differences."""
    slopes = []
    for k in range(q.size):
        step = np.zeros(q.size)
        step[k] = 1e-5
        ends = [_basis(t_s, start_rad_s, q + sign * step) @ coefficients for sign in (-1.0, 1.0)]
        slopes.append((ends[1] - ends[0]) / 2e-5)
    jacobian = np.concatenate([_basis(t_s, start_rad_s, q), np.stack(slopes, axis=1)], axis=1)
    inverse = np.linalg.pinv(jacobian)
    covariance: FloatArray = inverse @ inverse.T
    return covariance
