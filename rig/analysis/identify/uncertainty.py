"""Whole uncertainty of the modes: noise, and what no residual shows, each a row of the budget."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_fit import FittedDecay
from rig.analysis.identify.identification import BudgetRow, Mode
from rig.analysis.identify.identify_options import IdentifyOptions
from rig.analysis.identify.sensitivity import Effect, Sensitivity

FloatArray = npt.NDArray[np.float64]

DOUBT_FACTOR = 2.0  # each failed check adds a variance of so many noise sigmas, squared


class ModeWithBudget(NamedTuple):
    """A mode and the rows of its uncertainty."""

    mode: Mode
    budget: tuple[BudgetRow, ...]


class ModelShare(NamedTuple):
    """Part of the uncertainty that the checks of the fit add."""

    frequency_hz: float  # half of the difference of the halves beyond noise
    damping_ratio: float
    failed_checks: int


def mode_with_budget(
    found: FittedDecay, k: int, options: IdentifyOptions, share: ModelShare
) -> ModeWithBudget:
    """Compute mode k and the rows of its budget."""
    w0, _ = found.model.natural(found.p, k)
    frequency_hz = w0 / (2 * math.pi)
    at = damping_amplitude(found, k)
    amplitude = float(found.model.amplitude(found.p, k, np.zeros(1))[0])
    damping = found.model.damping_ratio(found.p, k, at)
    sensitivity = Sensitivity(found, k, at)
    noise_effect = sensitivity.of_noise()
    noise = BudgetRow("noise", noise_effect.frequency_hz, noise_effect.damping_ratio)
    rows = [noise, *_systematic_rows(found, k, sensitivity, options)]
    rows.append(BudgetRow("halves", share.frequency_hz, share.damping_ratio))
    if share.failed_checks:
        factor = DOUBT_FACTOR * math.sqrt(share.failed_checks)
        rows.append(
            BudgetRow("failed checks", factor * noise.frequency_hz, factor * noise.damping_ratio)
        )
    if found.elliptic:
        rows = [_with_length(row, frequency_hz, options) for row in rows]
        rows.append(_gravity_row(frequency_hz, options))
    mode = Mode(
        frequency_hz=frequency_hz,
        damping_ratio=damping,
        amplitude=amplitude,
        at_amplitude=at,
        sigma_frequency_hz=root_sum(row.frequency_hz for row in rows),
        sigma_damping_ratio=root_sum(row.damping_ratio for row in rows),
        sigma_amplitude=math.hypot(noise_effect.amplitude, amplitude * options.angle_scale_rel),
        sigma_noise_frequency_hz=noise.frequency_hz,
        sigma_noise_damping_ratio=noise.damping_ratio,
        decay_time_s=1 / (damping * w0) if damping > 0 else math.inf,
        q=1 / (2 * damping) if damping > 0 else math.inf,
    )
    return ModeWithBudget(mode, tuple(rows))


def damping_amplitude(found: FittedDecay, k: int) -> float:
    """Compute the amplitude that a common damping ratio belongs to.

    The slope of log B over time, weighted with B^2, is the mean of the local slopes with the
    weight W(t) = integral from t to the end of (u - mean u) B^2 du.
    """
    tau = found.tau
    amplitude = found.model.amplitude(found.p, k, tau)
    energy = amplitude**2
    total = float(np.sum(energy))
    if not total > 0:
        return float(amplitude[0])
    lever = (tau - float(np.sum(tau * energy)) / total) * energy
    weight = np.maximum(np.cumsum(lever[::-1])[::-1], 0.0) * np.gradient(tau)
    return float(np.sum(weight * amplitude) / max(float(np.sum(weight)), 1e-300))


def gain_drift_hz(found: FittedDecay, options: IdentifyOptions) -> float:
    """Compute what a drift of the gain does to the frequency of the first mode, sigma."""
    sensitivity = Sensitivity(found, 0, damping_amplitude(found, 0))
    part = found.tau / found.record.duration_s
    change = options.gain_drift_rel * part * sensitivity.swing()
    return abs(sensitivity.of_samples(change).frequency_hz)


def root_sum(values: Iterable[float]) -> float:
    """Compute the root of the sum of squares."""
    return math.sqrt(sum(value * value for value in values))


def _systematic_rows(
    found: FittedDecay, k: int, sensitivity: Sensitivity, options: IdentifyOptions
) -> list[BudgetRow]:
    """Compute what wrong scale, clock and gain do; scale and gain through the fit itself."""
    w0, _ = found.model.natural(found.p, k)
    frequency_hz = w0 / (2 * math.pi)
    swing = sensitivity.swing()
    part = found.tau / found.record.duration_s
    scale = sensitivity.of_samples(options.angle_scale_rel * swing)
    gain = sensitivity.of_samples(options.gain_drift_rel * part * swing)
    rows = [
        _row("angle scale", scale),
        BudgetRow("clock", frequency_hz * options.clock_ppm * 1e-6, 0.0),
        _row("gain drift", gain),
    ]
    if found.elliptic and found.layout.modes > 1:
        at = damping_amplitude(found, k)
        rows.append(BudgetRow("coupling", frequency_hz * _coupling(found, k, at), 0.0))
    return rows


def _row(term: str, effect: Effect) -> BudgetRow:
    return BudgetRow(term, abs(effect.frequency_hz), abs(effect.damping_ratio))


def _coupling(found: FittedDecay, k: int, at: float) -> float:
    """Bound how far other modes change the frequency of mode k through the amplitude, relative.

    Which share of the angle is one mode's is not known: A^2/16 of each, doubled for the others.
    """
    others = [damping_amplitude(found, n) for n in range(found.layout.modes) if n != k]
    share = min(1.0, sum(others) / at)
    return (2 * sum(other**2 for other in others) + share * at**2) / 16


def _with_length(row: BudgetRow, frequency_hz: float, options: IdentifyOptions) -> BudgetRow:
    length_m = options.gravity_m_s2 / (2 * math.pi * frequency_hz) ** 2
    return row._replace(cable_length_m=2 * length_m * row.frequency_hz / frequency_hz)


def _gravity_row(frequency_hz: float, options: IdentifyOptions) -> BudgetRow:
    length_m = options.gravity_m_s2 / (2 * math.pi * frequency_hz) ** 2
    relative = options.gravity_sigma_m_s2 / options.gravity_m_s2
    return BudgetRow("gravity", 0.0, 0.0, length_m * relative)
