"""Filter option of `rig track`: moving average or notch on the angle, its loss undone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import lombscargle

from rig.errors import ConfigError
from vision.filters import (
    FilteredAngles,
    FilterResponse,
    FloatArray,
    average_response,
    averaged,
    notch_coefficients,
    notch_response,
    notched,
    undone,
)
from vision.tracked import TrackedFrame

FORM = "average:N or notch:HZ[:Q]"
EXAMPLE = "for example --filter average:3 or --filter notch:12.5:5"
MAX_FRAMES = 1000
DEFAULT_QUALITY = 5.0
MAX_GAP_PERIODS = 1.5  # between two frames; beyond, the filter starts again
MIN_FRAMES = 16  # with an angle, for the frequency of the swing
GRID_PER_CYCLE = 4  # frequencies tried in 1 / (duration of the video)
MIN_GAIN = 0.05  # less cannot be undone


class Filtered(NamedTuple):
    """Filtered angles, None where there is none, and what the filter did."""

    t_s: list[float]
    angle_rad: list[float | None]
    swing_hz: float
    response: FilterResponse
    text: str

    def facts(self) -> dict[str, Any]:
        """Collect the figures for JSON."""
        return {
            "swing_hz": self.swing_hz,
            "gain": self.response.gain,
            "delay_s": self.response.delay_s,
            "t_s": self.t_s,
            "angle_rad": self.angle_rad,
        }


class AngleFilter(NamedTuple):
    """Filter as given: frames of an average, or frequency and quality of a notch."""

    frames: int = 0
    notch_hz: float = 0.0
    quality: float = DEFAULT_QUALITY

    def apply(self, rows: Sequence[TrackedFrame]) -> Filtered:
        """Filter the angles and undo delay and loss at the frequency of the swing."""
        t_s = np.array([row.t_s for row in rows])
        angles = [math.nan if row.angle_rad is None else row.angle_rad for row in rows]
        angle_rad = np.array(angles)
        intervals_s = np.diff(t_s)
        forward_s = intervals_s[intervals_s > 0.0]
        known = np.isfinite(angle_rad)
        if forward_s.size == 0 or np.count_nonzero(known) < MIN_FRAMES:
            raise ConfigError(
                f"--filter with {np.count_nonzero(known)} angles; must be {MIN_FRAMES} or more at "
                "rising times: leave it out"
            )
        period_s = float(np.median(forward_s))
        swing_hz = frequency_of(t_s[known], angle_rad[known], period_s)
        max_gap_s = MAX_GAP_PERIODS * period_s
        if self.frames:
            what = f"mean of {self.frames} frames"
            response = average_response(self.frames, period_s, swing_hz)
            raw = averaged(t_s, angle_rad, self.frames, max_gap_s)
            delay_s = 0.0  # the mean time contains it
        else:
            what = f"notch at {self.notch_hz:g} Hz, Q {self.quality:g}"
            response = self._notch_response(period_s, swing_hz)
            coefficients = notch_coefficients(self.notch_hz, self.quality, period_s)
            raw = notched(t_s, angle_rad, coefficients, max_gap_s)
            delay_s = response.delay_s
        if response.gain < MIN_GAIN:
            raise ConfigError(
                f"--filter {what}: gain {response.gain:.3f} at the swing of {swing_hz:.3f} Hz; "
                f"must be >= {MIN_GAIN}: filter another frequency"
            )
        text = (
            f"filter: {what}; at the swing of {swing_hz:.3f} Hz gain {response.gain:.5f} and delay "
            f"{1e3 * response.delay_s:.2f} ms, both undone"
        )
        return _as_filtered(undone(raw, response, delay_s), swing_hz, response, text)

    def _notch_response(self, period_s: float, swing_hz: float) -> FilterResponse:
        if self.notch_hz >= 0.5 / period_s:
            raise ConfigError(
                f"--filter notch:{self.notch_hz:g} at {1.0 / period_s:.4g} frames/s; must be below "
                f"half of that, {0.5 / period_s:.4g} Hz: choose a lower frequency"
            )
        coefficients = notch_coefficients(self.notch_hz, self.quality, period_s)
        return notch_response(coefficients, period_s, swing_hz)


def filter_of(text: str) -> AngleFilter:
    """Parse the option; raises ConfigError."""
    kind, *numbers = text.split(":")
    try:
        values = [float(number) for number in numbers]
    except ValueError:
        values = []
    if kind == "average" and len(values) == 1 and values[0].is_integer():
        if 2 <= values[0] <= MAX_FRAMES:
            return AngleFilter(frames=int(values[0]))
        raise ConfigError(f"--filter '{text}'; N must be 2 to {MAX_FRAMES} frames: {EXAMPLE}")
    if kind == "notch" and len(values) in (1, 2):
        if all(0.0 < value < math.inf for value in values):
            return AngleFilter(0, *values)
        raise ConfigError(f"--filter '{text}'; HZ and Q must be > 0 and finite: {EXAMPLE}")
    raise ConfigError(f"--filter '{text}'; must be {FORM}: {EXAMPLE}")


def frequency_of(t_s: FloatArray, angle_rad: FloatArray, period_s: float) -> float:
    """Find the frequency of the strongest sine in angles (N,), gaps allowed [Hz].

    A constant is fitted with the sine: the mean of a part of a period is not its middle.
    """
    span_s = float(t_s.max() - t_s.min())
    step_hz = 1.0 / (GRID_PER_CYCLE * span_s)
    grid_hz = np.arange(0.5 / span_s, 0.5 / period_s, step_hz)
    power = lombscargle(t_s, angle_rad - angle_rad.mean(), math.tau * grid_hz)
    strongest_hz = float(grid_hz[int(np.argmax(power))])

    def misfit(frequency_hz: float) -> float:
        phase = math.tau * frequency_hz * t_s
        design = np.stack([np.cos(phase), np.sin(phase), np.ones_like(phase)], axis=1)
        _, residual, rank, _ = np.linalg.lstsq(design, angle_rad, rcond=None)
        return float(residual[0]) if rank == 3 else math.inf

    bounds = (max(strongest_hz - 2.0 * step_hz, 0.25 / span_s), strongest_hz + 2.0 * step_hz)
    return float(minimize_scalar(misfit, bounds=bounds, method="bounded").x)


def _as_filtered(
    angles: FilteredAngles, swing_hz: float, response: FilterResponse, text: str
) -> Filtered:
    values = [float(a) if math.isfinite(a) else None for a in angles.angle_rad]
    return Filtered(angles.t_s.tolist(), values, swing_hz, response, text)
