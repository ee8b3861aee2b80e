"""Spectra of a record: strongest line, windowed peaks, what a residual holds near a frequency."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.sampled import Sampled

FloatArray = npt.NDArray[np.float64]

NEAR = (0.4, 2.2)  # band around a mode whose noise the fit takes up, in its frequency

UNDITHERED = 0.4  # residual rms over the quantum, below which no noise blurs it; 0.29 without any
UNDITHERED_EXCESS = 3.0


def even(record: Sampled, values: FloatArray) -> FloatArray:
    """Interpolate values (N,) of a record linearly to an even grid from its first stamp on."""
    count = round(record.duration_s / record.step_s) + 1
    grid = record.t_s[0] + record.step_s * np.arange(count)
    return np.asarray(np.interp(grid, record.t_s, values))


def strongest_frequency_hz(record: Sampled, values: FloatArray) -> float:
    """Find the peak of the zero-padded periodogram of detrended values, half a period and up."""
    z = even(record, values)
    n = np.arange(z.size)
    z = z - np.polyval(np.polyfit(n, z, 1), n)
    padding = 8 if z.size < 20_000 else 2
    size = padding * 2 ** math.ceil(math.log2(z.size))
    magnitude = np.abs(np.fft.rfft(z, size))
    frequency_hz = np.fft.rfftfreq(size, record.step_s)
    magnitude[frequency_hz < 0.5 / record.duration_s] = 0.0
    return float(frequency_hz[np.argmax(magnitude)])


def windowed_peak_hz(record: Sampled, values: FloatArray, window: str) -> float:
    """Find the bin of the highest line under a window of scipy.signal, as spectra are read."""
    from scipy.signal import get_window

    z = even(record, values)
    magnitude = np.abs(np.fft.rfft((z - z.mean()) * get_window(window, z.size)))
    magnitude[0] = 0.0
    return float(np.fft.rfftfreq(z.size, record.step_s)[np.argmax(magnitude)])


def line_amplitudes(record: Sampled, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute the amplitudes (M,) of the sinusoids at the frequencies (M,) of the Fourier grid."""
    z = even(record, values)
    amplitudes = np.asarray(2 / z.size * np.abs(np.fft.rfft(z - z.mean())), dtype=np.float64)
    lines_hz = np.asarray(np.fft.rfftfreq(z.size, record.step_s), dtype=np.float64)
    return lines_hz, amplitudes


def noise_excess(record: Sampled, residual: FloatArray, frequency_hz: float) -> float:
    """Compute the power density of a residual near a mode over that of its noise; at least 1.

    The density of white noise is its mean; that of a moving average is n times it at low
    frequency. What a quantum alone leaves is no noise: it repeats from swing to swing.
    """
    lines_hz, amplitudes = line_amplitudes(record, residual)
    power = amplitudes[1:] ** 2
    lines_hz = lines_hz[1:]
    near = (lines_hz >= NEAR[0] * frequency_hz) & (lines_hz <= NEAR[1] * frequency_hz)
    if not near.any() or not power.any():
        return 1.0
    excess = float(np.mean(power[near]) / np.mean(power)) / record.correlated_frames
    rms = float(np.sqrt(np.mean(residual**2)))
    least = UNDITHERED_EXCESS if rms < UNDITHERED * record.quantum else 1.0
    return max(least, excess)
