"""Samples of a record: stamps, step, gaps, quantum, noise; thinned by means of blocks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.errors import RefusedError

FloatArray = npt.NDArray[np.float64]

MIN_SAMPLES = 20
GAP_STEPS = 1.5  # a longer step is a gap
MAX_UNEVEN = 0.5  # spread of the steps, 90 % minus 10 %, over their median
MAX_RATE_CHANGE = 0.05  # median step of one half over that of the other
QUANTUM_VALUES = 5  # samples per different value from which on a record counts as quantised


@dataclass(frozen=True, kw_only=True, eq=False)
class Sampled:
    """Samples (N,) with rising stamps, each the centred mean of average_frames frames."""

    t_s: FloatArray
    values: FloatArray
    step_s: float
    average_frames: int
    frame_period_s: float
    quantum: float  # smallest step between different values; 0 where values hardly repeat

    @property
    def duration_s(self) -> float:
        """Time from the first stamp to the last [s]."""
        return float(self.t_s[-1] - self.t_s[0])

    @property
    def gap_count(self) -> int:
        """Number of steps longer than 1.5 times the median step."""
        return int(np.count_nonzero(np.diff(self.t_s) > GAP_STEPS * self.step_s))

    @property
    def correlated_frames(self) -> int:
        """Frames that a sample shares noise over with its neighbours; 1 for white noise."""
        overlaps = self.step_s < (self.average_frames - 0.5) * self.frame_period_s
        return self.average_frames if overlaps else 1

    def part(self, first: int, stop: int) -> Sampled:
        """Select the samples first to stop - 1."""
        return self.kept(np.arange(first, stop))

    def kept(self, index: npt.NDArray[np.intp]) -> Sampled:
        """Select samples by index."""
        return Sampled(
            t_s=self.t_s[index],
            values=self.values[index],
            step_s=self.step_s,
            average_frames=self.average_frames,
            frame_period_s=self.frame_period_s,
            quantum=self.quantum,
        )


def sampled(
    t_s: FloatArray, values: FloatArray, average_frames: int, frame_period_s: float
) -> Sampled:
    """Check and convert samples; raises RefusedError with the reason and the row."""
    t = np.asarray(t_s, dtype=np.float64)
    y = np.asarray(values, dtype=np.float64)
    if t.ndim != 1 or t.shape != y.shape:
        raise RefusedError(
            "shape", f"stamps have shape {t.shape}, values {y.shape}; need two equal (N,)"
        )
    if t.size < MIN_SAMPLES:
        raise RefusedError(
            "too_few_samples", f"{t.size} samples; need {MIN_SAMPLES}: record longer, or faster"
        )
    finite = np.isfinite(t) & np.isfinite(y)
    if not finite.all():
        row = int(np.argmin(finite))
        raise RefusedError(
            "not_finite", f"row {row} of {t.size} holds no number: pass valid samples only"
        )
    steps = np.diff(t)
    if steps.min() <= 0:
        row = int(np.argmax(steps <= 0)) + 1
        raise RefusedError(
            "spliced",
            f"the stamp of row {row} ({t[row]:.6g} s) is not after the one before "
            f"({t[row - 1]:.6g} s): two records in one, or rows out of order; pass one record",
        )
    if np.ptp(y) == 0:
        raise RefusedError(
            "constant", f"all {y.size} values are {y[0]:g}: nothing moves, or the sensor holds"
        )
    step_s = float(np.median(steps))
    return Sampled(
        t_s=t,
        values=y,
        step_s=step_s,
        average_frames=average_frames,
        frame_period_s=frame_period_s or step_s,
        quantum=quantum_of(y),
    )


def quantum_of(values: FloatArray) -> float:
    """Find the smallest step between different values, 0 where values hardly repeat."""
    different = np.unique(values)
    if different.size < 2 or different.size * QUANTUM_VALUES > values.size:
        return 0.0
    steps = np.diff(different)
    return float(np.min(steps[steps > 1e-9 * np.ptp(values)]))


def noise_rms(values: FloatArray, average_frames: int = 1) -> float:
    """Estimate white noise from fourth differences, which remove what is slow.

    The median keeps outliers out. A moving average of white frames has smaller differences than
    white samples of the same variance, by a known factor.
    """
    weights = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
    if values.size < weights.size + 3:
        return 0.0
    d4 = np.convolve(values, weights, "valid")
    averaged = np.convolve(weights, np.ones(average_frames))
    power = float(averaged @ averaged) / average_frames
    return 1.4826 * float(np.median(np.abs(d4))) / math.sqrt(power)


def clock_doubt(record: Sampled) -> str | None:
    """Say what is irregular in the stamps; None for steps that only jitter or lack samples."""
    steps = np.diff(record.t_s)
    low, high = np.quantile(steps, (0.1, 0.9))
    if high - low > MAX_UNEVEN * record.step_s:
        return (
            f"steps vary from {low:.4g} to {high:.4g} s (10 to 90 %), median {record.step_s:.4g} s"
        )
    half = steps.size // 2
    first, second = float(np.median(steps[:half])), float(np.median(steps[half:]))
    if abs(second / first - 1) > MAX_RATE_CHANGE:
        return f"two rates: a step of {first:.4g} s in the first half, {second:.4g} s after it"
    return None


def thinned(record: Sampled, block: int) -> Sampled:
    """Replace blocks of consecutive samples by their mean, a zero-phase filter of known gain.

    The mean of a block is a moving average over its frames: the fit takes it into account
    exactly, the noise stays white, and a gap ends a block.
    """
    if block < 2:
        return record
    steps = np.diff(record.t_s)
    is_break = steps > GAP_STEPS * record.step_s
    run = np.concatenate([[0], np.cumsum(is_break)])
    first_of_run = np.concatenate([[0], np.flatnonzero(is_break) + 1])
    within = np.arange(record.t_s.size) - first_of_run[run]
    starts = np.flatnonzero(within % block == 0)
    counts = np.diff(np.append(starts, record.t_s.size))
    t = np.add.reduceat(record.t_s, starts) / counts
    y = np.add.reduceat(record.values, starts) / counts
    full = counts == block
    return Sampled(
        t_s=t[full],
        values=y[full],
        step_s=block * record.step_s,
        average_frames=block,
        frame_period_s=record.step_s,
        quantum=0.0,
    )
