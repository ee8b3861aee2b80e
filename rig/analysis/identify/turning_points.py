"""Turning points of a record, and the envelope between them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.sampled import Sampled, noise_rms

FloatArray = npt.NDArray[np.float64]

SMOOTHED_PER_PERIOD = 12  # samples are averaged over this part of a period
MIN_PROMINENCE_REL = 0.02  # of the range of the values
MIN_PROMINENCE_NOISE = 6.0


class TurningPoints(NamedTuple):
    """Extremes of the smoothed values, a high after a low."""

    sample: npt.NDArray[np.intp]  # (K,) indices
    t_s: FloatArray
    values: FloatArray
    noise: float  # of the smoothed values

    @property
    def half_swings(self) -> FloatArray:
        """Half the way from each turning point to the next (K - 1,): an envelope free of offset."""
        return np.abs(np.diff(self.values)) / 2


def smoothed(record: Sampled, frequency_hz: float) -> FloatArray:
    """Remove spikes by a median of five and average over a twelfth of a period (N,)."""
    from scipy.ndimage import median_filter, uniform_filter1d

    width = int(1 / (SMOOTHED_PER_PERIOD * frequency_hz * record.step_s))
    values = record.values
    if width >= 2:
        values = median_filter(values, 5, mode="mirror")
    return np.asarray(uniform_filter1d(values, max(1, width), mode="nearest"))


def turning_points(record: Sampled, frequency_hz: float) -> TurningPoints:
    """Find the extremes that stand out of noise; the first sample counts as one."""
    from scipy.signal import find_peaks

    y = smoothed(record, frequency_hz)
    width = max(1, int(1 / (SMOOTHED_PER_PERIOD * frequency_hz * record.step_s)))
    frames = record.correlated_frames
    noise = noise_rms(record.values, frames) / math.sqrt(max(1.0, width / frames))
    prominence = max(MIN_PROMINENCE_NOISE * noise, MIN_PROMINENCE_REL * float(np.ptp(y)))
    highs = find_peaks(y, prominence=prominence)[0]
    lows = find_peaks(-y, prominence=prominence)[0]
    index = np.sort(np.concatenate([[0], highs, lows])).astype(np.intp)
    index = _alternating(index, y)
    return TurningPoints(index, record.t_s[index], y[index], noise)


def _alternating(index: npt.NDArray[np.intp], y: FloatArray) -> npt.NDArray[np.intp]:
    """Keep the more extreme one of neighbours that both turn the same way."""
    kept: list[int] = []
    for i in index:
        if len(kept) >= 2 and (y[i] - y[kept[-1]]) * (y[kept[-1]] - y[kept[-2]]) >= 0:
            kept[-1] = int(i)
        else:
            kept.append(int(i))
    return np.array(kept, dtype=np.intp)
