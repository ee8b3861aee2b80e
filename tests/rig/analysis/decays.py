"""Decays in closed form or integrated, for the tests of the identification."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

Array = npt.NDArray[np.float64]


def damped(
    t_s: Array, frequency_hz: float, damping_ratio: float, amplitude: float, phase: float = 0.3
) -> Array:
    """Linear decay of one mode."""
    w = 2 * math.pi * frequency_hz
    envelope = amplitude * np.exp(-damping_ratio * w * t_s)
    return np.asarray(envelope * np.cos(w * math.sqrt(1 - damping_ratio**2) * t_s + phase))


def pendulum(
    t_s: Array,
    amplitude: float,
    frequency_hz: float = 0.5,
    damping_ratio: float = 1e-3,
    drag: float = 0.0,
    friction: float = 0.0,
) -> Array:
    """Pendulum released at rest at t = 0; friction is c / w^2 [rad]."""
    w = 2 * math.pi * frequency_hz

    def rates(_t: float, x: Array) -> list[float]:
        loss = 2 * damping_ratio * w * x[1] + drag * abs(x[1]) * x[1]
        dry = friction * w * w * math.tanh(x[1] / (1e-3 * w * amplitude))
        return [x[1], -w * w * math.sin(x[0]) - loss - dry]

    found = solve_ivp(
        rates,
        (0.0, float(t_s[-1])),
        [amplitude, 0.0],
        method="DOP853",
        t_eval=t_s,
        rtol=1e-10,
        atol=1e-12,
    )
    return np.asarray(found.y[0])


def noisy(values: Array, noise: float, seed: int) -> Array:
    """Add white noise."""
    return values + np.random.default_rng(seed).normal(0, noise, values.size)
