"""Records of decays whose truth is integrated, independently of the models that are fitted.

theta'' + 2 zeta w theta' + q |theta'| theta' + c sign(theta') + w^2 g(theta) = 0 by DOP853.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.integrate import quad, solve_ivp

FloatArray = npt.NDArray[np.float64]

FREQUENCY_HZ = 0.508
RATE_HZ = 50.0


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """What a record adds to its swing; amplitudes in rad."""

    noise: float = 5e-4
    ar1: float | None = None  # correlation of the noise from sample to sample
    walk: bool = False  # noise is a random walk of this standard deviation
    offset: float = 0.0
    trend: float = 0.0  # over the whole record
    trend_squared: float = 0.0
    lost: float = 0.0  # share of samples
    burst: int = 1  # lost in a row
    jitter_s: float = 0.0
    stamps_nominal: bool = False
    quantum: float = 0.0
    outliers: float = 0.0  # share of samples, of 20 mrad
    average_frames: int = 1
    second: tuple[float, float] | None = None  # frequency over the first, amplitude over the first
    clock: float = 0.0  # relative, beside what is drawn
    scale: float = 0.0
    gain_drift: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Swing:
    """A swing released at rest."""

    amplitude: float = 0.1
    damping_ratio: float = 2.37e-4
    duration_s: float = 24.0
    drag: float = 0.0
    friction: float = 0.0  # c / w^2 [rad]
    force: str = "pendulum"  # pendulum, linear or cubic
    cubic: float = 0.0

    def restoring(self, x: float) -> float:
        """Restoring force over w^2."""
        if self.force == "pendulum":
            return math.sin(x)
        return x + self.cubic * x**3

    @cached_property
    def solution(self):
        """Dense solution over one period more than the record."""
        w = 2 * math.pi * FREQUENCY_HZ
        friction = self.friction * w * w

        def rates(_t: float, s: FloatArray) -> list[float]:
            x, v = float(s[0]), float(s[1])
            a = -w * w * self.restoring(x) - 2 * self.damping_ratio * w * v - self.drag * abs(v) * v
            return [v, a - friction * math.tanh(v / (1e-4 * w * self.amplitude))]

        method = {"rtol": 1e-11, "atol": 1e-13} if not friction else {"rtol": 1e-9, "atol": 1e-11}
        return solve_ivp(
            rates,
            (0, self.duration_s + 1.5 / FREQUENCY_HZ),
            [self.amplitude, 0.0],
            method="DOP853",
            dense_output=True,
            **method,
        ).sol

    def damping_at(self, amplitude: float) -> float:
        """Viscous damping ratio that takes the same energy in a period at this amplitude."""

        def energy(x: float) -> float:
            if self.force == "pendulum":
                return math.cos(x) - math.cos(amplitude)
            fourth = self.cubic / 4 * (amplitude**4 - x**4)
            return (amplitude**2 - x * x) / 2 + fourth

        def speed(u: float) -> float:  # x = A sin u: smooth at the turning point
            x = amplitude * math.sin(u)
            return math.sqrt(2 * max(energy(x), 0.0)) * amplitude * math.cos(u)

        loop = quad(speed, 0, math.pi / 2)[0]
        square = quad(lambda x: 2 * energy(x), 0, amplitude)[0]
        return self.damping_ratio + (self.drag * square + self.friction * amplitude) / (2 * loop)


def record(
    swing: Swing, disturbance: Disturbance, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, float]:
    """Draw a record: stamps, angles, and the time between release and first sample."""
    d = disturbance
    start_s = rng.uniform(0, 1 / FREQUENCY_HZ)
    half = d.average_frames // 2
    count = round(swing.duration_s * RATE_HZ) + 2 * half
    nominal = (np.arange(count) - half) / RATE_HZ
    taken = nominal + rng.uniform(-d.jitter_s, d.jitter_s, count)
    part = taken / swing.duration_s
    gain = (1 + d.scale) * (1 + d.gain_drift * part)
    y = swing.solution(np.maximum(start_s + taken, 0.0))[0] * gain + d.offset
    if d.second is not None:
        y = y + _second(swing, d.second, taken)
    y = y + d.trend * part + d.trend_squared * 4 * (part - 0.5) ** 2
    y = y + _noise(d, count, rng)
    stamps = nominal if d.stamps_nominal else taken
    if d.average_frames > 1:
        y = np.convolve(y, np.ones(d.average_frames) / d.average_frames, "valid")
        stamps = stamps[half : stamps.size - half]
    if d.quantum:
        y = d.quantum * np.round(y / d.quantum)
    if d.outliers:
        y = y + np.where(rng.random(y.size) < d.outliers, rng.normal(0, 0.02, y.size), 0.0)
    keep = np.ones(y.size, dtype=bool)
    if d.lost:
        hits = np.flatnonzero(rng.random(y.size) < d.lost / d.burst)
        for hit in hits:
            keep[hit : hit + d.burst] = False
    return stamps[keep] * (1 + d.clock), y[keep], start_s


def _second(swing: Swing, second: tuple[float, float], t: FloatArray) -> FloatArray:
    w = 2 * math.pi * FREQUENCY_HZ * second[0]
    zeta = swing.damping_ratio
    amplitude = swing.amplitude * second[1]
    return amplitude * np.exp(-zeta * w * t) * np.cos(w * t + 0.7)


def _noise(d: Disturbance, count: int, rng: np.random.Generator) -> FloatArray:
    white = rng.normal(0, 1, count)
    if d.ar1 is not None:
        from scipy.signal import lfilter

        white[0] /= math.sqrt(1 - d.ar1**2)
        return d.noise * math.sqrt(1 - d.ar1**2) * lfilter([1.0], [1.0, -d.ar1], white)
    if d.walk:
        walk = np.cumsum(white)
        return d.noise * (walk - walk.mean()) / walk.std()
    return d.noise * white


def bound(swing: Swing, noise: float, start_s: float) -> tuple[float, float]:
    """Compute the Cramer-Rao bounds of frequency [Hz] and damping ratio, white noise."""
    t = np.arange(0, swing.duration_s, 1 / RATE_HZ)
    zeta = swing.damping_ratio
    amplitude = swing.amplitude * math.exp(-zeta * 2 * math.pi * FREQUENCY_HZ * start_s)
    phase = 2 * math.pi * FREQUENCY_HZ * start_s
    p = np.array([FREQUENCY_HZ, zeta, amplitude, phase, 0.0])

    def model(q: FloatArray) -> FloatArray:
        w = 2 * math.pi * q[0]
        psi = w * math.sqrt(1 - q[1] ** 2) * t + q[3]
        return q[2] * np.exp(-q[1] * w * t) * np.cos(psi) + q[4]

    h = 1e-6
    J = np.stack([(model(p + h * e) - model(p - h * e)) / 2 / h for e in np.eye(5)], axis=-1)
    sigma = noise * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    return float(sigma[0]), float(sigma[1])
