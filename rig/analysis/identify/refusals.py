"""Records that are no free decay: clipped, spliced, growing; each refused with the evidence."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.errors import RefusedError
from rig.analysis.identify.sampled import Sampled, noise_rms
from rig.analysis.identify.turning_points import TurningPoints

FloatArray = npt.NDArray[np.float64]

MIN_FLAT = 5  # equal values in a row at the limit
FLAT_FACTOR = 2.0  # over what the quantum explains
MIN_SIDE = 4  # samples on each side of a jump
JUMP_NOISE = 10.0
JUMP_SLOW = 3.0  # over the same measure elsewhere, which the swing itself gives
PLACES = 16  # of a record that one jump disturbs
MAX_JUMPS = 12  # judged
LONGEST_SIDE = 10
ROBUST_PASSES = 12
SPIKE_NOISE = 8.0
MAX_GROWTH = 1.3  # of the envelope, where its largest value stands at the end
GROWTH_PERIODS = 3  # half swings that rise before it


def refuse_clipped(record: Sampled, frequency_hz: float) -> None:
    """Refuse a record whose turning points lie on a limit of the sensor, more than once."""
    y = record.values
    amplitude = float(np.ptp(y)) / 2
    for limit in (float(y.max()), float(y.min())):
        runs = _runs(np.abs(y - limit) <= 1e-9 * max(amplitude, abs(limit)))
        if not runs:
            continue
        explained = 0.0
        if record.quantum:
            angle = math.acos(max(-1.0, 1 - 2 * record.quantum / amplitude))
            explained = 2 * angle / (2 * math.pi * frequency_hz * record.step_s)
        flat = [run for run in runs if run >= max(MIN_FLAT, FLAT_FACTOR * explained)]
        if len(flat) >= 2 or (flat and flat[0] * record.step_s * frequency_hz > 0.15):
            raise RefusedError(
                "saturated",
                f"the values stay at {limit:.6g} for up to {max(flat)} samples in a row, "
                f"{len(flat)} times: the sensor is at its limit; widen its range",
            )


def refuse_spliced(record: Sampled, frequency_hz: float) -> None:
    """Refuse a record with a jump that no swing of this frequency makes.

    Compares the lines through the four samples before and after each place; the largest jumps are
    judged again by parabolas that spikes do not move.
    """
    samples_per_period = 1 / (frequency_hz * record.step_s)
    if record.values.size < 4 * MIN_SIDE or samples_per_period < 4 * MIN_SIDE:
        return
    y = _bridged(record.values)
    u = np.arange(MIN_SIDE)
    weights = np.linalg.pinv(np.stack([np.ones(MIN_SIDE), u + 0.5], axis=-1))[0]
    before = np.convolve(y, weights, "valid")[:-MIN_SIDE]  # window reversed: nearest first
    after = np.correlate(y, weights, "valid")[MIN_SIDE:]
    even = np.ptp(_sliding_steps(record.t_s), axis=-1) < 0.5 * record.step_s
    even[:MIN_SIDE] = False  # a spike at an end has no other side
    even[-MIN_SIDE:] = False
    size = np.where(even, np.abs(after - before), 0.0)
    noise = noise_rms(record.values, record.correlated_frames)
    usual = _usual(size[even])
    limit = max(
        JUMP_NOISE * noise * math.sqrt(2 * weights @ weights),
        JUMP_SLOW * usual,
        2 * record.quantum,
    )
    side = int(np.clip(samples_per_period / 6, MIN_SIDE + 1, LONGEST_SIDE))
    for _ in range(MAX_JUMPS):
        place = int(np.argmax(size)) + MIN_SIDE  # the first sample after the jump
        if not size[place - MIN_SIDE] > limit:
            return
        jump = abs(_robust_jump(record, place, side, noise))
        if jump > limit:
            raise RefusedError(
                "spliced",
                f"the values jump by {jump:.3g} at {record.t_s[place]:.6g} s, "
                f"{jump / max(usual, 1e-300):.0f} times what the swing does elsewhere: "
                "two records in one, or a blow; choose one part by its stamps",
            )
        size[max(0, place - 2 * MIN_SIDE) : place] = 0.0


def refuse_growing(record: Sampled, points: TurningPoints, start: int) -> None:
    """Refuse a record whose envelope is largest at its end and grew up to there."""
    half_swings = points.half_swings
    rises = half_swings[max(0, start - 2 * GROWTH_PERIODS) : start + 1]
    left_s = float(record.t_s[-1] - points.t_s[start])
    is_late = left_s < 0.15 * record.duration_s
    if is_late and rises.size > GROWTH_PERIODS and rises[-1] > MAX_GROWTH * rises[0]:
        raise RefusedError(
            "growing",
            f"the swing grows from {rises[0]:.3g} to {rises[-1]:.3g} up to {left_s:.3g} s before "
            "the end: driven, or the decay was not recorded",
        )


def refuse_large_unit(amplitude: float) -> None:
    """Refuse angles that a pendulum in radians cannot have."""
    if amplitude > math.pi:
        raise RefusedError(
            "unit",
            f"a swing of {amplitude:.3g} rad is beyond the upright position (3.14 rad): "
            "are the values degrees? Give the unit",
        )


def _bridged(values: FloatArray) -> FloatArray:
    """Replace single and paired spikes by a line: far from both sides, which agree in slope."""
    is_spike = np.zeros(values.size, dtype=bool)
    for lag in (1, 2):
        inner = slice(2 * lag, -2 * lag)
        before, after = np.roll(values, lag)[inner], np.roll(values, -lag)[inner]
        further = np.roll(values, -2 * lag)[inner] - np.roll(values, 2 * lag)[inner]
        away = np.abs(values[inner] - (before + after) / 2)
        bend = np.abs(after - before - further / 2)
        usual = 1.4826 * float(np.median(away))
        is_spike[inner] |= (away > SPIKE_NOISE * usual) & (bend < away / 2)
    kept = np.flatnonzero(~is_spike)
    return np.asarray(np.interp(np.arange(values.size), kept, values[kept]))


def _robust_jump(record: Sampled, place: int, side: int, noise: float) -> float:
    """Compute the jump between the parabolas through the samples before and from a place on.

    Samples beyond a gap are left out; 0 where too few remain.
    """
    middle_s = (record.t_s[place - 1] + record.t_s[place]) / 2
    ends = []
    for part in (slice(max(0, place - side), place), slice(place, place + side)):
        u = np.abs(record.t_s[part] - middle_s) / record.step_s
        near = u < side
        if np.count_nonzero(near) <= MIN_SIDE:
            return 0.0
        ends.append(_robust_end(u[near], record.values[part][near], noise))
    return ends[1] - ends[0]


def _robust_end(u: FloatArray, values: FloatArray, noise: float) -> float:
    """Extrapolate to u = 0 by the parabola of least absolute residuals."""
    basis = np.stack([np.ones_like(u), u, u * u], axis=-1)
    weights = np.ones_like(u)
    for _ in range(ROBUST_PASSES):
        root = np.sqrt(weights)
        solution = np.linalg.lstsq(basis * root[:, None], values * root)[0]
        weights = 1 / np.maximum(np.abs(values - basis @ solution), max(noise, 1e-300))
        weights = weights / weights.max()
    return float(solution[0])


def _usual(sizes: FloatArray) -> float:
    """Find the largest size but for those that one jump makes; inf where there are too few."""
    if sizes.size < 3 * PLACES:
        return math.inf
    return float(np.quantile(sizes, 1 - max(0.01, PLACES / sizes.size)))


def _runs(flags: npt.NDArray[np.bool_]) -> list[int]:
    """Lengths of the runs of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [int(stop - first) for first, stop in edges.reshape(-1, 2)]


def _sliding_steps(t_s: FloatArray) -> FloatArray:
    """Steps (M, 2 MIN_SIDE - 1) around each place that is judged."""
    return np.lib.stride_tricks.sliding_window_view(np.diff(t_s), 2 * MIN_SIDE - 1)
