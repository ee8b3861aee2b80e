"""Filters of the angle, with the time at which the result holds and the amplitude they cost."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

import numpy as np

from vision.errors import VisionError

FloatArray = np.ndarray[Any, np.dtype[np.float64]]


class Angle(NamedTuple):
    """Angle with the time at which it holds and its standard deviation."""

    t_ns: int
    angle_rad: float
    sigma_rad: float


class MovingAverage:
    """Moving average of the newest `frames` angles.

    An average over equal periods has a delay of (frames - 1) / 2 periods at every frequency; the
    mean time stamp contains it, also while the window fills. A missing frame would change the
    delay, so the average restarts after a gap of more than max_gap_ns between two time stamps.
    """

    def __init__(self, frames: int, max_gap_ns: int) -> None:
        if frames < 1 or max_gap_ns < 1:
            raise VisionError(
                f"moving average of {frames} frames, gap {max_gap_ns} ns; both must be at least 1: "
                "check [vision]"
            )
        self._window: deque[Angle] = deque(maxlen=frames)
        self._max_gap_ns = max_gap_ns

    def restart(self) -> None:
        """Clear the window, after a frame without an angle."""
        self._window.clear()

    def add(self, t_ns: int, angle_rad: float, sigma_rad: float) -> Angle:
        """Add an angle that holds at t_ns; return the mean of the window at its mean time.

        The errors of the frames are taken as independent.
        """
        if self._window and not 0 < t_ns - self._window[-1].t_ns <= self._max_gap_ns:
            self._window.clear()
        self._window.append(Angle(t_ns, angle_rad, sigma_rad))
        n = len(self._window)
        return Angle(
            sum(a.t_ns for a in self._window) // n,
            math.fsum(a.angle_rad for a in self._window) / n,
            math.hypot(*(a.sigma_rad for a in self._window)) / n,
        )


class FilterResponse(NamedTuple):
    """Effect of a filter on a sine of one frequency."""

    gain: float  # amplitude out over amplitude in
    delay_s: float  # of the sine


class FilteredAngles(NamedTuple):
    """Filtered angles with the times at which they hold; NaN where the filter has no value."""

    t_s: FloatArray  # (N,)
    angle_rad: FloatArray  # (N,)


def average_response(frames: int, period_s: float, frequency_hz: float) -> FilterResponse:
    """Compute the response of a mean over frames: sin(N x) / (N sin x) with x = pi f T."""
    x = math.pi * frequency_hz * period_s
    gain = 1.0 if math.sin(x) == 0.0 else math.sin(frames * x) / (frames * math.sin(x))
    return FilterResponse(gain, 0.5 * (frames - 1) * period_s)


def notch_coefficients(notch_hz: float, quality: float, period_s: float) -> FloatArray:
    """Compute numerator and denominator (2, 3) of a notch filter.

    Bilinear transform of (s^2 + w^2) / (s^2 + s w / Q + w^2), with w prewarped; its gain at
    frequency 0 is 1.
    """
    w = math.tau * notch_hz * period_s
    alpha = 0.5 * math.sin(w) / quality
    cosine = -2.0 * math.cos(w)
    return np.array([[1.0, cosine, 1.0], [1.0 + alpha, cosine, 1.0 - alpha]]) / (1.0 + alpha)


def notch_response(
    coefficients: FloatArray, period_s: float, frequency_hz: float
) -> FilterResponse:
    """Compute the response of a notch filter (2, 3)."""
    z = np.exp(-1j * math.tau * frequency_hz * period_s * np.arange(3))
    numerator, denominator = coefficients @ z
    value = complex(numerator / denominator)
    delay_s = -math.atan2(value.imag, value.real) / (math.tau * frequency_hz)
    return FilterResponse(abs(value), delay_s)


def averaged(
    t_s: FloatArray, angle_rad: FloatArray, frames: int, max_gap_s: float
) -> FilteredAngles:
    """Average the newest frames of each angle, at their mean time, with no gap among them.

    t_s, angle_rad: (N,), NaN where a frame has no angle.
    """
    out_t, out = t_s.copy(), np.full(len(t_s), math.nan)
    for part in segments(t_s, angle_rad, max_gap_s):
        for last in range(part.start + frames - 1, part.stop):
            window = slice(last - frames + 1, last + 1)
            out_t[last], out[last] = t_s[window].mean(), angle_rad[window].mean()
    return FilteredAngles(out_t, out)


def notched(
    t_s: FloatArray, angle_rad: FloatArray, coefficients: FloatArray, max_gap_s: float
) -> FilteredAngles:
    """Filter each part without a gap, from the steady state of its first angle.

    t_s, angle_rad: (N,), NaN where a frame has no angle. The times are those of the newest angle.
    """
    out = np.full(len(t_s), math.nan)
    (b0, b1, b2), (_, a1, a2) = coefficients.tolist()
    for part in segments(t_s, angle_rad, max_gap_s):
        x1 = x2 = y1 = y2 = float(angle_rad[part.start])
        for index in range(part.start, part.stop):
            x = float(angle_rad[index])
            y = b0 * x + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2
            x1, x2, y1, y2 = x, x1, y, y1
            out[index] = y
    return FilteredAngles(t_s.copy(), out)


def undone(filtered: FilteredAngles, response: FilterResponse, delay_s: float) -> FilteredAngles:
    """Undo the loss of amplitude about the mean, and a delay that the times do not contain."""
    known = np.isfinite(filtered.angle_rad)
    if not known.any():
        return filtered
    mean = float(filtered.angle_rad[known].mean())
    angle_rad = mean + (filtered.angle_rad - mean) / response.gain
    return FilteredAngles(filtered.t_s - delay_s, angle_rad)


def segments(t_s: FloatArray, angle_rad: FloatArray, max_gap_s: float) -> list[slice]:
    """List the parts in which every frame has an angle and no interval exceeds max_gap_s."""
    known = np.isfinite(angle_rad)
    parts: list[slice] = []
    start: int | None = None
    for index in range(len(t_s)):
        goes_on = start is not None and 0.0 < t_s[index] - t_s[index - 1] <= max_gap_s
        if start is not None and not (goes_on and known[index]):
            parts.append(slice(start, index))
            start = None
        if start is None and known[index]:
            start = index
    if start is not None:
        parts.append(slice(start, len(t_s)))
    return parts
