"""Envelope of a mode with viscous, quadratic and Coulomb damping: B' = -(k + d B + b B^2).

d = viscous decay rate [1/s]; b = 4 q w / (3 pi) for a drag q |x'| x'; k = 2 c / (pi w) for a dry
friction c sign(x'): the first-order averages over a period (Nayfeh & Mook 1979).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.free_swing import SwingEnvelope
from rig.analysis.identify.least_squares import derivative

FloatArray = npt.NDArray[np.float64]
Numbers = npt.NDArray[Any]

NODES = 240  # of the spline through the envelope, which is slow
SMALL = 1e-6  # rate times time below which sinh(x)/x is its series


def envelope_with_terms(tau: FloatArray, numbers: FloatArray, *, elliptic: bool) -> SwingEnvelope:
    """Compute the envelope (N,) and its derivatives by numbers = (B0, d, b, k).

    Computed at nodes and interpolated by cubic splines; their integral gives the lag.
    """
    from scipy.interpolate import CubicSpline

    nodes = np.linspace(min(0.0, float(tau[0])), float(tau[-1]), NODES)

    def at_nodes(q: Numbers) -> Numbers:
        return riccati(nodes, q)

    B = np.maximum(at_nodes(numbers), 0.0)
    slopes = derivative(at_nodes, numbers)
    slopes[B == 0] = 0.0
    if not np.isfinite(slopes).all():  # a step far beyond any decay: its cost is no number
        nothing = np.full((tau.size, numbers.size), np.nan)
        return SwingEnvelope(nothing[:, 0], nothing, nothing[:, 0], nothing)
    curves = CubicSpline(nodes, np.column_stack([B, slopes]))(tau)
    amplitude, amplitude_slopes = np.maximum(curves[:, 0], 0.0), curves[:, 1:]
    if not elliptic:
        return SwingEnvelope(amplitude, amplitude_slopes, np.zeros_like(tau), 0 * amplitude_slopes)
    rate = B**2 / 16 + 3 / 1024 * B**4
    rate_slopes = (B / 8 + 3 / 256 * B**3)[:, None] * slopes
    rates = CubicSpline(nodes, np.column_stack([rate, rate_slopes]))
    integral = rates.antiderivative()
    lags = integral(tau) - integral(0.0)
    return SwingEnvelope(amplitude, amplitude_slopes, lags[:, 0], lags[:, 1:])


def riccati(t: FloatArray, numbers: Numbers) -> Numbers:
    """Solve B' = -(k + d B + b B^2) from B0 at t = 0, numbers = (B0, d, b, k), exactly."""
    B0, d, b, k = numbers
    r = np.sqrt(d * d - 4 * b * k + 0j)
    x = r * t / 2
    is_small = np.abs(x) < SMALL
    safe = np.where(is_small, 1, x)
    with np.errstate(all="ignore"):  # a trial far beyond any decay overflows
        C = np.cosh(x)
        S = t / 2 * np.where(is_small, 1 + x * x / 6, np.sinh(safe) / safe)  # sinh(r t/2) / r
        B = _ratio(B0, d, b, k, C, S)
    return B if np.iscomplexobj(numbers) else np.asarray(B.real)


def _ratio(B0: Any, d: Any, b: Any, k: Any, C: Numbers, S: Numbers) -> Numbers:
    return np.asarray((B0 * (C - d * S) - 2 * k * S) / (C + (d + 2 * b * B0) * S))


def damping_rate(amplitude: FloatArray, d: float, b: float, k: float) -> FloatArray:
    """Compute the decay rate -B'/B [1/s] at an amplitude."""
    return d + b * amplitude + k / amplitude
