"""The acceleration of a motion that is repeated for ever: its Fourier series."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import PlanError
from planners.spectra.spectrum import transform
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

PERIOD_ROUNDING_REL = 1e-12  # of the duration; a period shorter by less is meant to be the duration


class Harmonics(NamedTuple):
    """a(t) = sum_k amplitudes_k cos(2 pi k t / period + phases_k), k from 0."""

    period_s: float
    amplitudes_m_s2: FloatArray  # (count + 1,) the first is the mean, with its sign
    phases_rad: FloatArray  # (count + 1,) the first is 0

    def at(self, t_s: ArrayLike) -> FloatArray:
        """The sum at times of any shape [m/s^2]."""
        k = np.arange(self.amplitudes_m_s2.size)
        angles = np.multiply.outer(
            np.asarray(t_s, dtype=np.float64), 2.0 * math.pi / self.period_s * k
        )
        return np.asarray(np.cos(angles + self.phases_rad) @ self.amplitudes_m_s2)


def harmonics(trajectory: Trajectory, count: int, period_s: float | None = None) -> Harmonics:
    """The first `count` harmonics of the acceleration when the motion begins anew every period_s (its duration by default).

    v_k = 2 |X(2 pi k / period)| / period with X the transform of one motion, 2 pi V'(k) / T without a pause. For a move of
    h metres in T seconds v_k = h / T^2 times that of the unit move: source 000 prints h / T, and leaves a 1 / T in the rest.
    Raises PlanError for a negative count or a period shorter than the motion.
    """
    period = trajectory.duration_s if period_s is None else period_s
    if count < 0:
        raise PlanError(f"count = {count} harmonics; must be >= 0: 0 is the mean alone")
    if not trajectory.duration_s * (1.0 - PERIOD_ROUNDING_REL) <= period < math.inf:
        raise PlanError(
            f"period_s = {period} of a motion; must be finite and >= its {trajectory.duration_s} s: wait for its end"
        )
    x = transform(trajectory, 2j * math.pi / period * np.arange(count + 1)) / period
    amplitudes, phases = 2.0 * np.abs(x), np.angle(x)
    amplitudes[0], phases[0] = x[0].real, 0.0
    return Harmonics(period, amplitudes, phases)
