"""Pendulum at any amplitude: its equation integrated, where the series in the amplitude ends.

theta'' + 2 d theta' + Q |theta'| theta' + C sign(theta') + w0^2 sin(theta) = 0, with
Q = 3 pi b / (4 w0) and C = pi k w0 / 2: d, b and k are the rates of damped_envelope at small
amplitude.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_model import DAMPING_TERMS, DRIFTS, ParameterLayout, drift
from rig.analysis.identify.sampled import Sampled

FloatArray = npt.NDArray[np.float64]

STEPS_PER_PERIOD = 100  # of the small swing; Runge-Kutta of order 4: 1.3e-7 in frequency
DIFFERENCE = 1e-6  # relative step of the derivatives
FRICTION_WIDTH = 0.02  # rate, over that of the swing, below which dry friction falls to zero


class LargeSwing:
    """Model of the samples of one window; parameters as those of ModeSum with one mode.

    Differences: the frequency is undamped, and amplitude and phase stand for the state at the
    start, angle A cos(phase) and rate -w0 A sin(phase).
    """

    def __init__(self, record: Sampled, layout: ParameterLayout) -> None:
        self.layout = layout
        self.tau = record.t_s - record.t_s[0]
        frames, period_s = record.average_frames, record.frame_period_s
        self._average_s2 = (frames**2 - 1) * period_s**2 / 24  # times the second derivative
        self._dynamic = [
            *range(4),
            *(layout.position(term) for term in layout.terms if is_damping(term)),
        ]
        self._last: tuple[bytes, FloatArray, FloatArray, FloatArray] | None = None

    def __call__(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute values (N,) and Jacobian (N, P)."""
        from scipy.interpolate import CubicSpline

        nodes, angles, _ = self._trajectories(p)
        if not np.isfinite(angles).all():  # a trial that runs away: its cost is no number
            return np.full(self.tau.size, np.nan), np.zeros((self.tau.size, self.layout.size))
        spline = CubicSpline(nodes, angles)
        curves = spline(self.tau)
        if self._average_s2:
            curves = curves + self._average_s2 * spline(self.tau, 2)
        J = np.zeros((self.tau.size, self.layout.size))
        for n, index in enumerate(self._dynamic):
            J[:, index] = (curves[:, n + 1] - curves[:, 0]) / self._step(p, index)
        J[:, self.layout.offset] = 1.0
        values = curves[:, 0] + p[self.layout.offset]
        for term in DRIFTS:
            if term in self.layout.terms:
                J[:, self.layout.position(term)] = drift(self.tau / self.tau[-1], term)
                values += self.layout.value(p, term) * drift(self.tau / self.tau[-1], term)
        return values, J

    def natural(self, p: FloatArray, k: int) -> tuple[float, float]:
        """Compute undamped frequency [rad/s] and viscous decay rate [1/s]."""
        return float(p[0]), float(p[1])

    def amplitude(self, p: FloatArray, k: int, tau: FloatArray) -> FloatArray:
        """Compute the turning point [rad] at tau (N,), from the energy."""
        nodes, angles, rates = self._trajectories(p)
        cosine = np.cos(angles[:, 0]) - (rates[:, 0] / p[0]) ** 2 / 2
        return np.asarray(np.interp(tau, nodes, np.arccos(np.clip(cosine, -1.0, 1.0))))

    def damping_ratio(self, p: FloatArray, k: int, amplitude: float) -> float:
        """Compute the ratio of the viscous damping that takes the same energy in a period."""
        from scipy.special import ellipe, ellipk

        w0 = float(p[0])
        drag, friction = self._friction(p)
        m = math.sin(amplitude / 2) ** 2
        action = float(ellipe(m) - (1 - m) * ellipk(m))
        by_drag = drag * (math.sin(amplitude) - amplitude * math.cos(amplitude)) / (4 * action)
        by_friction = friction * amplitude / (8 * w0**2 * action)
        return float(p[1]) / w0 + by_drag + by_friction

    def _friction(self, p: FloatArray) -> tuple[float, float]:
        quadratic, coulomb = (self.layout.value(p, term) for term in DAMPING_TERMS)
        return 3 * math.pi * quadratic / (4 * p[0]), math.pi * coulomb * p[0] / 2

    def _step(self, p: FloatArray, index: int) -> float:
        is_rate = index not in (2, 3)
        return DIFFERENCE * (float(p[0]) if is_rate else 1.0)

    def _trajectories(self, p: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Integrate p and its neighbours: nodes (M,), angles and rates (M, 1 + dynamic)."""
        key = p.tobytes()
        if self._last is not None and self._last[0] == key:
            return self._last[1:]
        columns = np.tile(p, (1 + len(self._dynamic), 1))
        for n, index in enumerate(self._dynamic):
            columns[n + 1, index] += self._step(p, index)
        span_s = float(self.tau[-1])
        count = max(8, math.ceil(span_s * p[0] / (2 * math.pi) * STEPS_PER_PERIOD))
        angles, rates = self._integrate(columns, span_s / count, count)
        nodes = np.linspace(0.0, span_s, count + 1)
        self._last = (key, nodes, angles, rates)
        return nodes, angles, rates

    def _integrate(
        self, columns: FloatArray, h: float, count: int
    ) -> tuple[FloatArray, FloatArray]:
        w0, decay, amplitude, phase = columns[:, :4].T
        frictions = np.array([self._friction(column) for column in columns])
        ww, double, drag, dry = w0 * w0, 2 * decay, frictions[:, 0], frictions[:, 1]
        narrow = (FRICTION_WIDTH * w0 * amplitude) ** 2
        is_dry = bool(dry.any())

        def acceleration(x: FloatArray, v: FloatArray) -> FloatArray:
            a: FloatArray = -ww * np.sin(x) - v * (double + drag * np.abs(v))
            if is_dry:
                a -= dry * v / np.sqrt(v * v + narrow)
            return a

        x, v = amplitude * np.cos(phase), -w0 * amplitude * np.sin(phase)
        angles, rates = np.empty((count + 1, x.size)), np.empty((count + 1, x.size))
        angles[0], rates[0] = x, v
        half = h / 2
        for n in range(count):
            a1 = acceleration(x, v)
            a2 = acceleration(x + half * v, v + half * a1)
            a3 = acceleration(x + half * v + half * half * a1, v + half * a2)
            a4 = acceleration(x + h * v + h * half * a2, v + h * a3)
            x = x + h * v + h * h / 6 * (a1 + a2 + a3)
            v = v + h / 6 * (a1 + 2 * (a2 + a3) + a4)
            angles[n + 1], rates[n + 1] = x, v
        return angles, rates


def is_damping(term: str) -> bool:
    """Tell if a term enters the equation of motion."""
    return term in DAMPING_TERMS


def natural_over_swing(amplitude: float) -> float:
    """Compute the frequency of the small swing over that at an amplitude [rad] below pi."""
    from scipy.special import ellipk

    return float(ellipk(math.sin(amplitude / 2) ** 2)) * 2 / math.pi
