"""Natural frequencies of a load of several links from its recorded free swing; pure."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
MIN_SAMPLES_PER_STATE = 10


def natural_frequencies_hz(
    t_s: FloatArray, angles_rad: FloatArray, rates_rad_s: FloatArray
) -> tuple[float, ...]:
    """Fit the undamped natural frequencies of the modes [Hz], slowest first.

    t_s (N,) in equal steps h; angles and rates (N, n). For small swings the state x = [th, th']
    obeys x(t + h) = P x(t). P is fitted by least squares (dynamic mode decomposition, Schmid 2010);
    its eigenvalues are exp(mu h), with frequencies |mu| / 2 pi. Empty for too few samples.
    """
    states = np.hstack([angles_rad, rates_rad_s])  # (N, 2n)
    count, size = states.shape
    if size == 0 or count < MIN_SAMPLES_PER_STATE * size:
        return ()
    transposed, *_ = np.linalg.lstsq(states[:-1], states[1:], rcond=None)
    eigenvalues = np.linalg.eigvals(transposed)
    oscillatory = eigenvalues[eigenvalues.imag > 0.0]
    step_s = (t_s[-1] - t_s[0]) / (count - 1)
    rates_1_s = np.log(oscillatory) / step_s
    frequencies_hz = np.sort(np.abs(rates_1_s)) / (2.0 * math.pi)
    return tuple(frequencies_hz.tolist())
