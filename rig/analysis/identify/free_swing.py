"""Free swing of one mode at any amplitude, sampled by a moving average of frames.

Averaging (action-angle) solution of theta'' + 2 zeta w0 theta' + w0^2 sin(theta) = 0. Linear
damping makes the action fall as exp(-2 zeta w0 t), so B = sqrt(2 action / w0) falls as
exp(-zeta w0 t) at any amplitude. With A the turning point: A = B (1 + 5 B^2/192),
w(B) = w0 (1 - B^2/16 - 3 B^4/1024), the same as the elliptic w(A) = w0 (1 - A^2/16 + A^4/3072);
theta = (B + B^3/32) cos(psi) - B^3/192 cos(3 psi), psi = integral of w.

A linear oscillator is the same without the powers of B.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
SERIES_BELOW = 0.02  # rate times time; the series to x^4 is exact to rounding here


class SwingEnvelope(NamedTuple):
    """Amplitude of a mode over time, and how much it lags behind the small swing.

    slopes: derivatives by (amplitude at 0, decay rate, ...), as many as the damping has numbers.
    """

    amplitude: FloatArray  # B (N,)
    amplitude_slopes: FloatArray  # (N, K)
    lag: FloatArray  # (N,) integral of B^2/16 + 3 B^4/1024 [s]; zero for a linear oscillator
    lag_slopes: FloatArray  # (N, K)


def free_swing(
    p: FloatArray, tau: FloatArray, *, average_frames: int, frame_period_s: float
) -> FloatArray:
    """Compute the angle [rad] of a pendulum at times tau (N,) after the start.

    p = (damped frequency [rad/s], decay rate [1/s], amplitude, phase, offset [rad]).
    """
    return pendulum_swing(p, tau, average_frames, frame_period_s)[0]


def pendulum_swing(
    p: FloatArray, tau: FloatArray, average_frames: int, frame_period_s: float
) -> tuple[FloatArray, FloatArray]:
    """Compute the angle (N,) of free_swing and its Jacobian (N, 5)."""
    wd, decay, amplitude, phase, offset = p
    B0 = action_amplitude(amplitude)
    envelope = viscous_envelope(tau, B0, decay, elliptic=True)
    mode = np.array([wd, decay, B0, phase])
    swing, slopes = mode_swing(mode, tau, envelope, average_frames, frame_period_s)
    jacobian = np.column_stack([slopes, np.ones_like(tau)])
    jacobian[:, 2] /= 1 + 5 / 64 * B0**2  # by the turning point, no longer by B
    return swing + offset, jacobian


def mode_swing(
    p: FloatArray,
    tau: FloatArray,
    envelope: SwingEnvelope,
    average_frames: int,
    frame_period_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Compute the swing (N,) of one mode, and its derivatives (N, 4 or more).

    p = (damped frequency [rad/s], decay rate [1/s], amplitude B, phase); derivatives by p, then by
    what else the envelope has. The change of the average's gain with frequency is left out: it
    lies in the span of the other columns.
    """
    wd, decay, B0, phase = p
    w0 = math.hypot(wd, decay)
    B, lag = envelope.amplitude, envelope.lag
    is_elliptic = bool(lag.any())
    psi = wd * tau - w0 * lag + phase
    c, s = np.cos(psi), np.sin(psi)
    frame_phase = w0 * (1 - is_elliptic * B0**2 / 16) * frame_period_s
    gain_1 = average_gain(frame_phase, average_frames)
    if is_elliptic:
        BB = B * B
        third = average_gain(3 * frame_phase, average_frames) * BB / 192
        cos_3 = 4 * c * c - 3  # cos(3 psi) / cos(psi)
        sin_3 = 3 - 4 * s * s
        swing = B * c * (gain_1 * (1 + BB / 32) - third * cos_3)
        by_B = c * (gain_1 * (1 + 3 / 32 * BB) - 3 * third * cos_3)
        by_psi = B * s * (3 * third * sin_3 - gain_1 * (1 + BB / 32))
    else:
        swing = gain_1 * B * c
        by_B = gain_1 * c
        by_psi = -gain_1 * B * s
    by_envelope = by_B[:, None] * envelope.amplitude_slopes
    by_envelope -= (w0 * by_psi)[:, None] * envelope.lag_slopes
    by_decay = by_envelope[:, 1] - by_psi * lag * (decay / w0)
    by_wd = by_psi * (tau - lag * (wd / w0))
    columns = [by_wd, by_decay, by_envelope[:, 0], by_psi, *by_envelope[:, 2:].T]
    return swing, np.stack(columns, axis=-1)


def viscous_envelope(tau: FloatArray, B0: float, decay: float, *, elliptic: bool) -> SwingEnvelope:
    """Compute the envelope of viscous damping, B0 exp(-decay tau), with its two derivatives."""
    E = np.exp(-decay * tau)
    B = B0 * E
    B_slopes = np.stack([E, -tau * B], axis=-1)
    if not elliptic:
        return SwingEnvelope(B, B_slopes, np.zeros_like(tau), np.zeros_like(B_slopes))
    D, by_rate = _decaying_integral(2 * decay, tau)
    by_decay = 2 * by_rate
    EE = E * E
    fourth = 3 / 2048 * D * (1 + EE)  # 3/1024 integral of exp(-4 decay tau)
    fourth_by_decay = 3 / 2048 * (by_decay * (1 + EE) - 2 * D * tau * EE)
    lag = B0**2 * (D / 16 + B0**2 * fourth)
    by_B0 = B0 * (D / 8 + 4 * B0**2 * fourth)
    lag_by_decay = B0**2 * (by_decay / 16 + B0**2 * fourth_by_decay)
    return SwingEnvelope(B, B_slopes, lag, np.stack([by_B0, lag_by_decay], axis=-1))


def turning_point(B: FloatArray) -> FloatArray:
    """Compute the turning point A = B (1 + 5 B^2/192) [rad] from the action amplitude B."""
    return B * (1 + 5 / 192 * B**2)


def action_amplitude(amplitude: Any) -> Any:
    """Invert A = B (1 + 5 B^2/192), to 1e-7 relative at 0.4 rad."""
    B = amplitude / (1 + 5 / 192 * amplitude**2)
    return amplitude / (1 + 5 / 192 * B**2)


def average_gain(frame_phase: float, frames: int) -> float:
    """Compute the gain of the centred mean of N frames: sin(N x/2) / (N sin(x/2)).

    x = phase from frame to frame.
    """
    if frames == 1 or frame_phase == 0:
        return 1.0
    return math.sin(frames * frame_phase / 2) / (frames * math.sin(frame_phase / 2))


def _decaying_integral(rate: float, tau: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Integrate exp(-rate u) over u from 0 to tau, with the derivative by rate."""
    x = rate * tau
    if np.max(np.abs(x), initial=0.0) < SERIES_BELOW:
        integral = tau * (1 - x / 2 * (1 - x / 3 * (1 - x / 4 * (1 - x / 5 * (1 - x / 6)))))
        slope = 1 / 2 - x * (1 / 3 - x * (1 / 8 - x * (1 / 30 - x * (1 / 144 - x / 840))))
        return integral, -tau * tau * slope
    integral = -np.expm1(-x) / rate
    by_rate = (tau * np.exp(-x) - integral) / rate
    near = np.abs(x) < SERIES_BELOW  # where the difference would cancel
    by_rate[near] = (-tau * tau * (1 / 2 - x / 3 + x * x / 8 - x**3 / 30 + x**4 / 144))[near]
    return integral, by_rate
