"""Rate, gaps, quantum, noise floor and saturation of a cleaned signal."""

from __future__ import annotations

import math

import numpy as np

from rig.analysis.readers.errors import counted
from rig.analysis.readers.signal_record import FloatArray, ReadFinding

GAP_STEPS = 1.5  # a longer step is a gap
PIECES = 16  # of the record, whose usual steps are compared
MIXED_RATIO = 1.5  # of the usual steps of two pieces
FOURTH_DIFFERENCE_VARIANCE = 70  # of white noise of variance 1: sum of binomials squared
MAD_SIGMA = 1.4826  # standard deviation over median absolute deviation, normal distribution
CLIPPED_RUN = 3  # equal samples at the largest or smallest value
CLIPPED_DROP_QUANTA = 20  # beside the run; a smooth top drops by 8 quanta over its own width
SAME_REL = 1e-9  # of the range: differences by rounding
QUANTUM_SHARE = 0.05  # of the steps between values; fewer are finer, as digits are near zero


def usual_rate_hz(t_s: FloatArray) -> float:
    """Compute the sampling rate from the steps (N - 1,) that are no gaps."""
    steps_s = np.diff(t_s)
    usual_s = float(np.median(steps_s))
    near = steps_s[(steps_s < GAP_STEPS * usual_s) & (steps_s > usual_s / GAP_STEPS)]
    mean_s = float(np.mean(near)) if near.size else usual_s
    return 1 / mean_s


def sampling_findings(t_s: FloatArray) -> list[ReadFinding]:
    """Report gaps, and two rates in one record."""
    steps_s = np.diff(t_s)
    mixed = _mixed_rates(t_s, steps_s)
    if mixed is not None:
        return [mixed]
    usual_s = float(np.median(steps_s))
    gaps = np.flatnonzero(steps_s > GAP_STEPS * usual_s)
    if not gaps.size:
        return []
    widest = int(gaps[np.argmax(steps_s[gaps])])
    text = (
        f"{counted(gaps.size, 'gap')} in time, the longest {steps_s[widest]:.4g} s "
        f"at {t_s[widest]:.6g} s (usual step {usual_s:.4g} s)"
    )
    shown = tuple(int(k) + 1 for k in gaps[:5])
    return [ReadFinding("gaps", text, int(gaps.size), shown)]


def _mixed_rates(t_s: FloatArray, steps_s: FloatArray) -> ReadFinding | None:
    """Compare the usual steps of pieces of the record."""
    if steps_s.size < 4 * PIECES:
        return None
    pieces = np.array_split(steps_s, PIECES)
    usual_s = np.array([np.median(piece) for piece in pieces])
    if usual_s.max() < MIXED_RATIO * usual_s.min():
        return None
    changed = np.abs(np.log(usual_s / usual_s[0])) > math.log(MIXED_RATIO)
    k = int(np.argmax(changed))
    start = sum(piece.size for piece in pieces[:k])
    text = (
        f"two rates in one record: {1 / usual_s[0]:.4g} Hz, from about {t_s[start]:.5g} s on "
        f"{1 / usual_s[k]:.4g} Hz: take one part with --from and --to"
    )
    return ReadFinding("mixed_rates", text)


def quantum(values: FloatArray) -> float:
    """Find the smallest usual step between different values (N,); 0 for a constant.

    5 % of the steps may be smaller: programs print more decimals near zero.
    """
    distinct = np.unique(values)
    if distinct.size < 2:
        return 0.0
    steps = np.diff(distinct)
    rounding = SAME_REL * (distinct[-1] - distinct[0])
    steps = steps[steps > rounding]
    return float(np.quantile(steps, QUANTUM_SHARE, method="lower")) if steps.size else 0.0


def noise_floor(values: FloatArray, quantum_step: float) -> float:
    """Estimate the standard deviation of the noise from the fourth differences of values (N,).

    Not below that of the rounding to the quantum, quantum / sqrt(12).
    """
    differences = np.abs(np.diff(values, 4))
    median = float(np.median(differences)) if differences.size else 0.0
    sigma = MAD_SIGMA * median / math.sqrt(FOURTH_DIFFERENCE_VARIANCE)
    return max(sigma, quantum_step / math.sqrt(12))


def value_findings(values: FloatArray, quantum_step: float) -> list[ReadFinding]:
    """Report a constant, or samples cut off at a limit."""
    if values.min() == values.max():
        text = f"constant: all {values.size} samples are {values[0]:g}: try another --signal"
        return [ReadFinding("constant", text, int(values.size))]
    findings = []
    for limit, word in ((float(values.max()), "largest"), (float(values.min()), "smallest")):
        count = _clipped(np.abs(values - limit), quantum_step)
        if count:
            text = (
                f"{count} samples stay at the {word} value, {limit:.6g}, and leave it abruptly: "
                "the sensor or its range is saturated"
            )
            findings.append(ReadFinding("clipped", text, count))
    return findings


def _clipped(distance: FloatArray, quantum_step: float) -> int:
    """Count the samples in runs at a limit with an abrupt edge; distance (N,) from the limit."""
    at_limit = np.concatenate([[False], distance == 0, [False]])
    edges = np.flatnonzero(np.diff(at_limit.astype(np.int8)))
    starts = edges[0::2]
    ends = edges[1::2]
    count = 0
    for start, end in zip(starts, ends, strict=True):
        length = int(end - start)
        if length < CLIPPED_RUN:
            continue
        beside = [k for k in (start - length, end - 1 + length) if 0 <= k < distance.size]
        drops = [distance[k] for k in beside]
        if drops and min(drops) > CLIPPED_DROP_QUANTA * quantum_step:
            count += length
    return count
