"""Effect of noise, and of any small change of the samples, on what is printed of one mode."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_fit import FittedDecay
from rig.analysis.identify.decay_model import DRIFTS, drift
from rig.analysis.identify.least_squares import influence
from rig.analysis.identify.spectrum import noise_excess

FloatArray = npt.NDArray[np.float64]

DIFFERENCE = 1e-6


class Effect(NamedTuple):
    """Change, or standard deviation, of the quantities of a mode."""

    frequency_hz: float
    damping_ratio: float  # at the amplitude it is named for
    amplitude: float


class Sensitivity:
    """Derivatives of the quantities of mode k by the samples, of first order."""

    def __init__(self, found: FittedDecay, k: int, at: float) -> None:
        self._found = found
        self._inverse = influence(found.jacobian)
        w0, _ = found.model.natural(found.p, k)
        self._excess = noise_excess(found.record, found.residual, w0 / (2 * math.pi))

        def frequency_hz(p: FloatArray) -> float:
            return found.model.natural(p, k)[0] / (2 * math.pi)

        def damping_ratio(p: FloatArray) -> float:
            return found.model.damping_ratio(p, k, at)

        def amplitude(p: FloatArray) -> float:
            return float(found.model.amplitude(p, k, np.zeros(1))[0])

        quantities = (frequency_hz, damping_ratio, amplitude)
        self._gradients = np.array([_gradient(quantity, found.p) for quantity in quantities])

    def of_noise(self) -> Effect:
        """Propagate the noise, with its density near the mode over its mean."""
        covariance = self._found.covariance(self._inverse) * self._excess
        variances = np.einsum("qp,pr,qr->q", self._gradients, covariance, self._gradients)
        return Effect(*np.sqrt(np.maximum(variances, 0.0)).tolist())

    def of_samples(self, change: FloatArray) -> Effect:
        """Propagate a change (N,) of the samples."""
        return Effect(*(self._gradients @ (self._inverse @ change)).tolist())

    def swing(self) -> FloatArray:
        """Compute the fitted samples (N,) without offset and drift."""
        found = self._found
        swing = found.record.values - found.residual - found.p[found.layout.offset]
        for term in DRIFTS:
            part = found.tau / found.record.duration_s
            swing = swing - found.layout.value(found.p, term) * drift(part, term)
        return np.asarray(swing)


def _gradient(quantity: Callable[[FloatArray], float], p: FloatArray) -> FloatArray:
    gradient = np.zeros(p.size)
    base = quantity(p)
    for n in range(p.size):
        moved = p.copy()
        moved[n] += DIFFERENCE * max(abs(p[n]), 1e-3)
        gradient[n] = (quantity(moved) - base) / (moved[n] - p[n])
    return gradient
