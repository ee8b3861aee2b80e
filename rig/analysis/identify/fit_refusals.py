"""Fits that are no free decay, refused with the evidence; and doubts about single modes."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_fit import FittedDecay
from rig.analysis.identify.errors import RefusedError
from rig.analysis.identify.identification import Mode, Reason

FloatArray = npt.NDArray[np.float64]

MIN_PERIODS = 0.8  # below this, offset and swing cannot be separated
MIN_REDUCTION = 30.0  # of the squares by the swing, in variances
MAX_UNEXPLAINED = 0.25  # residual over signal, where it is not noise
RESIDUAL_NOISE = 3.0
FAR_UNEXPLAINED, FAR_NOISE = 0.12, 10.0
CANCELLING = 1.5  # sum of the amplitudes over the range of the values
GROWTH_SIGMAS = 4.0
MIN_GROWTH = 1.05  # of the amplitude over the window
STEADY_DAMPING = 5e-5  # damping ratio that no free decay of a cable falls below
RESOLVED_BEATS = 0.6  # periods of the beat in the window, below which two modes are one
LARGEST_SWING_RAD = 2.6
FORCED_SHARE = 0.5  # of the swing at the end of the window


def refuse_wrong_fit(found: FittedDecay, noise: float) -> None:
    """Refuse a record of noise, one too short, and one that is no decay."""
    record = found.record
    values, residual = record.values, found.residual
    frames = record.correlated_frames
    w0, _ = found.model.natural(found.p, 0)
    periods = record.duration_s * w0 / (2 * math.pi)
    reduction = values.size * float(np.var(values)) - float(residual @ residual)
    if reduction < MIN_REDUCTION * found.variance * frames:
        raise RefusedError(
            "noise_only",
            f"the best swing explains {max(reduction, 0) / found.variance / frames:.1f} variances "
            f"of the noise; need {MIN_REDUCTION:.0f}: nothing swings",
        )
    if periods < MIN_PERIODS:
        raise RefusedError(
            "too_short",
            f"{periods:.2f} periods in {record.duration_s:.3g} s; need {MIN_PERIODS}: watch longer",
        )
    rms = math.sqrt(found.variance)
    unexplained = rms / float(np.std(values))
    is_moved = unexplained > MAX_UNEXPLAINED and rms > RESIDUAL_NOISE * noise
    is_far_off = unexplained > FAR_UNEXPLAINED and rms > FAR_NOISE * noise
    amplitudes = [
        float(found.model.amplitude(found.p, k, np.zeros(1))[0]) for k in range(found.layout.modes)
    ]
    cancels = sum(amplitudes) > CANCELLING * float(np.ptp(values)) and rms > FAR_NOISE * noise
    if is_moved or is_far_off or cancels:
        raise RefusedError(
            "no_decay",
            f"the best free decay leaves {unexplained:.0%} of the signal, "
            f"{rms / max(noise, 1e-300):.0f} times its noise: driven, or moved by hand",
        )


def refuse_wrong_damping(found: FittedDecay, modes: tuple[Mode, ...]) -> None:
    """Refuse a swing that grows, or whose envelope is that of a steady drive.

    Two modes that the window cannot tell apart have no damping of their own to judge by.
    """
    if _unresolved(found, modes):
        return
    duration_s = found.record.duration_s
    ends = [float(found.model.amplitude(found.p, k, found.tau[-1:])[0]) for k in range(len(modes))]
    for k, mode in enumerate(modes):
        share = ends[k] / max(sum(ends), 1e-300)
        if share < FORCED_SHARE:
            continue
        damping, sigma = mode.damping_ratio, mode.sigma_damping_ratio
        growth = math.exp(min(-damping * 2 * math.pi * mode.frequency_hz * duration_s, 50))
        if len(modes) == 1 and damping < -GROWTH_SIGMAS * sigma and growth > MIN_GROWTH:
            raise RefusedError(
                "growing",
                f"the swing grows by {growth - 1:.1%} in {duration_s:.3g} s "
                f"(damping ratio {damping:.2g} +- {sigma:.1g}): driven, or the wrong window",
            )
        if damping + 2 * sigma < STEADY_DAMPING and sigma < STEADY_DAMPING:
            raise RefusedError(
                "driven",
                f"the envelope is constant: damping ratio {damping:.1e} +- {sigma:.1e}; a free "
                f"decay has more than {STEADY_DAMPING:g}: a forced line, not a natural frequency",
            )


def mode_reasons(found: FittedDecay, modes: tuple[Mode, ...]) -> list[Reason]:
    """Doubt negative damping, modes that the window cannot tell apart, and the model's range."""
    reasons = []
    for mode in modes:
        if mode.damping_ratio < -2 * mode.sigma_damping_ratio:
            text = f"damping ratio {mode.damping_ratio:.2g} +- {mode.sigma_damping_ratio:.1g} < 0"
            reasons.append(Reason("negative_damping", text + ": driven, or the wrong window"))
    reasons += _unresolved(found, modes)
    if found.elliptic and modes[0].amplitude > LARGEST_SWING_RAD:
        text = f"a swing of {modes[0].amplitude:.3g} rad comes near the upright position"
        reasons.append(Reason("amplitude", text))
    return reasons


def _unresolved(found: FittedDecay, modes: tuple[Mode, ...]) -> list[Reason]:
    """Name pairs of modes that beat less than once in the window."""
    reasons = []
    frequencies = np.sort([mode.frequency_hz for mode in modes])
    for low, high in pairwise(frequencies):
        beats = (high - low) * found.record.duration_s
        if beats < RESOLVED_BEATS:
            text = f"two modes {high - low:.3g} Hz apart make {beats:.2g} of a beat in the window"
            reasons.append(
                Reason("unresolved", text + ": they cannot be told apart; record longer")
            )
    return reasons
