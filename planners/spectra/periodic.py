"""Fourier series of the acceleration of a periodic motion."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import PlanError
from planners.spectra.spectrum import transform
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

PERIOD_ROUNDING_REL = 1e-12  # of the duration; a period shorter by less is rounding


class Harmonics(NamedTuple):
    """Fourier series a(t) = sum_k amplitudes_k cos(2 pi k t / period + phases_k), k from 0."""

    period_s: float
    amplitudes_m_s2: FloatArray  # (count + 1,) the first is the mean, with its sign
    phases_rad: FloatArray  # (count + 1,) the first is 0

    def at(self, t_s: ArrayLike) -> FloatArray:
        """Compute the sum at times of any shape [m/s^2]."""
        k = np.arange(self.amplitudes_m_s2.size)
        angles = np.multiply.outer(
            np.asarray(t_s, dtype=np.float64), 2.0 * math.pi / self.period_s * k
        )
        return np.asarray(np.cos(angles + self.phases_rad) @ self.amplitudes_m_s2)


def harmonics(trajectory: Trajectory, count: int, period_s: float | None = None) -> Harmonics:
    """Compute the first `count` harmonics of the acceleration of a repeated motion.

    The motion restarts every period_s, its duration by default.
    v_k = 2 |X(2 pi k / period)| / period with X the transform of one motion, 2 pi V'(k) / T
    without a pause. For a move of h metres in T seconds v_k is h / T^2 times that of the unit
    move; source 000 prints h / T, and a 1 / T in the other factor.
    Raises PlanError for a negative count or a period shorter than the motion.
    """
    period = trajectory.duration_s if period_s is None else period_s
    if count < 0:
        raise PlanError(f"count = {count} harmonics; must be >= 0: 0 is the mean alone")
    if not trajectory.duration_s * (1.0 - PERIOD_ROUNDING_REL) <= period < math.inf:
        raise PlanError(
            f"period_s = {period} of a motion; must be finite and >= its duration, "
            f"{trajectory.duration_s} s: lengthen the period"
        )
    x = transform(trajectory, 2j * math.pi / period * np.arange(count + 1)) / period
    amplitudes = 2.0 * np.abs(x)
    amplitudes[0] = x[0].real
    phases = np.angle(x)
    phases[0] = 0.0
    return Harmonics(period, amplitudes, phases)
