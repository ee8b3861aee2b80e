"""Free swing of a damped pendulum at any amplitude, sampled by a moving average of frames."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Numbers = npt.NDArray[Any]  # float, or complex while a derivative is computed
SUBNORMAL = 1e-290  # a product below it may be a subnormal number of few digits


def free_swing(
    p: Numbers, tau: FloatArray, *, average_frames: int, frame_period_s: float
) -> Numbers:
    """Compute the angle [rad] at times tau (N,) after the start.

    p = (damped frequency [rad/s], decay rate [1/s], amplitude, phase, offset [rad]).

    Averaging (action-angle) solution of theta'' + 2 zeta w0 theta' + w0^2 sin(theta) = 0. Linear
    damping makes the action fall as exp(-2 zeta w0 t), so B = sqrt(2 action / w0) falls as
    exp(-zeta w0 t) at any amplitude. With A the turning point: A = B (1 + 5 B^2/192),
    w(B) = w0 (1 - B^2/16 - 3 B^4/1024), the same as the elliptic w(A) = w0 (1 - A^2/16 + A^4/3072);
    theta = (B + B^3/32) cos(psi) - B^3/192 cos(3 psi), psi = integral of w.
    """
    wd, decay, amplitude, phase, offset = p
    w0 = np.sqrt(wd * wd + decay * decay)
    B0 = action_amplitude(amplitude)
    B = B0 * np.exp(-decay * tau)
    BB = B * B
    # integral of 1 - w/w0
    slower = _decaying_integral(2 * decay, tau) * (B0**2 / 16 + 3 / 2048 * B0**2 * (B0**2 + BB))
    c = np.cos(wd * tau - w0 * slower + phase)
    # phase from frame to frame; its change by damping is negligible
    frame_phase = w0 * (1 - B0**2 / 16) * frame_period_s
    gain_1 = _average_gain(frame_phase, average_frames)
    gain_3 = _average_gain(3 * frame_phase, average_frames)
    third = gain_3 * BB / 192 * (4 * c * c - 3)  # 4 c^2 - 3 = cos(3 psi) / cos(psi)
    swing: Numbers = offset + B * c * (gain_1 * (1 + BB / 32) - third)
    return swing


def turning_point(B: FloatArray) -> FloatArray:
    """Compute the turning point A = B (1 + 5 B^2/192) [rad] from the action amplitude B."""
    return B * (1 + 5 / 192 * B**2)


def action_amplitude(amplitude: Any) -> Any:
    """Invert A = B (1 + 5 B^2/192), to 1e-7 relative at 0.4 rad."""
    B = amplitude / (1 + 5 / 192 * amplitude**2)
    return amplitude / (1 + 5 / 192 * B**2)


def _decaying_integral(rate: Any, tau: FloatArray) -> Numbers:
    """Integrate exp(-rate u) over u from 0 to tau; tau itself where rate tau is subnormal."""
    x = rate * tau
    is_tau = np.abs(x) < SUBNORMAL
    return np.where(is_tau, tau, -np.expm1(-x) / np.where(is_tau, 1, rate))


def _average_gain(frame_phase: Any, frames: int) -> Any:
    """Compute the gain of the centred mean of N frames: sin(N x/2) / (N sin(x/2)).

    x = phase from frame to frame.
    """
    if frames == 1:
        return 1.0
    return np.sin(frames * frame_phase / 2) / (frames * np.sin(frame_phase / 2))
