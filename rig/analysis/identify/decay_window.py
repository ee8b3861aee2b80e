"""Part of a record that is one free decay."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_fit import FittedDecay, advanced, refit
from rig.analysis.identify.errors import RefusedError
from rig.analysis.identify.sampled import Sampled
from rig.analysis.identify.turning_points import TurningPoints

FloatArray = npt.NDArray[np.float64]

LARGEST = 0.97  # of the largest envelope; the first turning point from there on starts the window
BLOCKS_PER_PERIOD = 12  # in which samples before the window are compared with the model
MISMATCH_SIGMAS = 5.0  # of the mean square of a block of noise
MEAN_SIGMAS = 3.5  # of its mean
WHOLE_HALF = 0.85  # of a half period, from a first sample that is a turning point to the next
NOISE_SIGMAS = 4.0  # of a half swing
RISE = 1.5  # of the envelope over its least value before; a new excitation, or a beat
MIN_DECAYED_SWINGS = 4  # before a rise counts
FADED_NOISE = 0.02  # of the noise: an amplitude below it tells nothing


def start_of_decay(points: TurningPoints) -> int:
    """Find the turning point that starts the first of the largest half swings, as noise allows."""
    half_swings = points.half_swings
    if half_swings.size < 1:
        raise RefusedError("noise_only", "no turning point stands out of the noise: nothing swings")
    half_swings = half_swings.copy()
    half_periods_s = np.diff(points.t_s)
    if half_periods_s[0] < WHOLE_HALF * np.median(half_periods_s):
        half_swings[0] = 0.0  # the record begins in mid-swing
    largest = float(half_swings.max())
    least = min(LARGEST * largest, largest - NOISE_SIGMAS * points.noise)
    return int(np.argmax(half_swings >= least))


def stop_before_rise(points: TurningPoints, start: int) -> int | None:
    """Find the sample before which the envelope stops falling; None where it falls throughout."""
    half_swings = points.half_swings[start:]
    least = np.minimum.accumulate(half_swings)
    is_rise = half_swings > RISE * least + 2 * NOISE_SIGMAS * points.noise
    is_rise[:MIN_DECAYED_SWINGS] = False
    if not is_rise.any():
        return None
    first = int(np.argmax(is_rise))
    bottom = int(np.argmin(half_swings[: first + 1]))
    return int(points.sample[start + bottom]) if bottom >= MIN_DECAYED_SWINGS else None


def extended(found: FittedDecay, whole: Sampled, first: int) -> FittedDecay:
    """Take the samples before the window too, as far back as the model explains them.

    whole: the record; first: index of the first sample of the window in it.
    """
    if first == 0 or found.is_large:
        return found
    w0, _ = found.model.natural(found.p, 0)
    block = max(3, round(2 * math.pi / w0 / whole.step_s / BLOCKS_PER_PERIOD))
    noise = math.sqrt(found.variance)
    before = whole.part(0, first)
    with np.errstate(all="ignore"):
        difference = before.values - found.predict(before)
    earliest = first
    while earliest > 0:
        low = max(0, earliest - block)
        if not _is_noise(difference[low:earliest] / noise, whole.correlated_frames):
            break
        earliest = low
    if earliest == first:
        return found
    window = whole.part(earliest, whole.values.size)
    stop = np.searchsorted(window.t_s, found.record.t_s[-1], side="right")
    window = window.part(0, int(stop))
    shift_s = float(window.t_s[0] - found.record.t_s[0])
    return refit(found, window, advanced(found.p, found.layout, shift_s))


def faded_after(found: FittedDecay) -> int | None:
    """Find the sample after which all modes are far below the noise; None where they are not."""
    tau = found.tau
    amplitude = np.zeros_like(tau)
    for k in range(found.layout.modes):
        amplitude += found.model.amplitude(found.p, k, tau)
    is_faded = amplitude < FADED_NOISE * math.sqrt(found.variance)
    return int(np.argmax(is_faded)) if is_faded.any() else None


def _is_noise(block: FloatArray, frames: int) -> bool:
    """Tell if a block in units of the noise is white noise about zero."""
    independent = block.size / frames
    square, mean = float(np.mean(block**2)), float(np.mean(block))
    is_small = square < 1 + MISMATCH_SIGMAS * math.sqrt(2 / independent)
    return is_small and abs(mean) * math.sqrt(independent) < MEAN_SIGMAS
