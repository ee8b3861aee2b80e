"""Identification of a free decay in any record: window, model, checks, uncertainty, verdict."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_fit import FittedDecay
from rig.analysis.identify.decay_search import decay_of
from rig.analysis.identify.errors import RefusedError
from rig.analysis.identify.fit_refusals import (
    mode_reasons,
    refuse_wrong_damping,
    refuse_wrong_fit,
)
from rig.analysis.identify.identification import Identification, Reason, Traces
from rig.analysis.identify.identify_options import IdentifyOptions
from rig.analysis.identify.local_damping import damping_over_amplitude
from rig.analysis.identify.matrix_pencil import Pencil, stabilisation
from rig.analysis.identify.residual_checks import (
    clock_reasons,
    half_reasons,
    noise_floor,
    residual_reasons,
)
from rig.analysis.identify.sampled import GAP_STEPS, Sampled, sampled
from rig.analysis.identify.second_opinion import second_opinion, window_pencil
from rig.analysis.identify.spectrum import line_amplitudes, noise_excess
from rig.analysis.identify.uncertainty import (
    ModelShare,
    ModeWithBudget,
    gain_drift_hz,
    mode_with_budget,
    root_sum,
)

FloatArray = npt.NDArray[np.float64]

RAD_PER_DEG = math.pi / 180


def identify_record(
    t_s: npt.ArrayLike, values: npt.ArrayLike, options: IdentifyOptions | None = None
) -> Identification:
    """Identify the free decay in a record.

    t_s (N,): stamps [s]; values (N,): in options.unit, of which degrees are converted to radians.
    A record that is no free decay gives a refusal with its reason, never a frequency.
    """
    options = options or IdentifyOptions()
    t = np.asarray(t_s, dtype=np.float64)
    y = np.asarray(values, dtype=np.float64)
    if options.unit == "deg":
        y = y * RAD_PER_DEG
        options = replace(options, unit="rad")
    try:
        record = _chosen_part(t, y, options)
        found, notes = decay_of(record, options)
        return _identification(record, found, notes, options)
    except RefusedError as refused:
        return _refusal(t, refused, options)


def _chosen_part(t: FloatArray, y: FloatArray, options: IdentifyOptions) -> Sampled:
    """Select the samples between from_s and to_s, and check them."""
    chosen = np.ones(t.shape, dtype=bool)
    if options.from_s is not None:
        chosen &= t >= options.from_s
    if options.to_s is not None:
        chosen &= t <= options.to_s
    if t.shape == y.shape:
        t, y = t[chosen], y[chosen]
    return sampled(t, y, options.average_frames, options.frame_period_s)


def _identification(
    record: Sampled, found: FittedDecay, notes: list[Reason], options: IdentifyOptions
) -> Identification:
    noise = noise_floor(found, record.quantum)
    refuse_wrong_fit(found, noise)
    frequency_hz = found.model.natural(found.p, 0)[0] / (2 * math.pi)
    reasons = [note for note in notes if note.is_doubt] + residual_reasons(found, noise)
    doubts, *share = half_reasons(found, gain_drift_hz(found, options))
    reasons += doubts + clock_reasons(found.record, frequency_hz)
    ranked = _modes(found, options, ModelShare(share[0], share[1], len(reasons)))
    modes = tuple(entry.mode for entry in ranked)
    refuse_wrong_damping(found, modes)
    more = mode_reasons(found, modes)
    if more:
        reasons += more
        ranked = _modes(found, options, ModelShare(share[0], share[1], len(reasons)))
        modes = tuple(entry.mode for entry in ranked)
    decomposed = window_pencil(found.record, modes[0].frequency_hz)
    excess = noise_excess(found.record, found.residual, modes[0].frequency_hz)
    length_m = sigma_length_m = None
    if options.is_pendulum:
        length_m = options.gravity_m_s2 / (2 * math.pi * modes[0].frequency_hz) ** 2
        sigma_length_m = root_sum(row.cable_length_m for row in ranked[0].budget)
    quiet = [reason for reason in (*notes, *reasons) if not reason.is_doubt]
    doubtful = tuple(reason for reason in reasons if reason.is_doubt)
    return Identification(
        verdict="doubtful" if doubtful else "good",
        reasons=doubtful,
        notes=tuple(quiet),
        kind=_kind(options),
        unit=options.unit,
        samples=record.t_s.size,
        rate_hz=1 / record.step_s,
        gaps=record.gap_count,
        window_s=(float(found.record.t_s[0]), float(found.record.t_s[-1])),
        modes=modes,
        terms=found.layout.terms,
        offset=float(found.p[found.layout.offset]),
        small_amplitude_frequency_hz=modes[0].frequency_hz if options.is_pendulum else None,
        cable_length_m=length_m,
        sigma_cable_length_m=sigma_length_m,
        damping_over_amplitude=damping_over_amplitude(found, excess),
        noise_rms=noise,
        residual_over_noise=math.sqrt(found.variance) / noise if noise > 0 else math.inf,
        second_opinion=second_opinion(found, decomposed, modes[0]),
        budget=ranked[0].budget,
        traces=_traces(found, decomposed),
    )


def _modes(found: FittedDecay, options: IdentifyOptions, share: ModelShare) -> list[ModeWithBudget]:
    """Compute the modes, the one of most energy over the window first."""
    return [mode_with_budget(found, k, options, share) for k in range(found.layout.modes)]


def _traces(found: FittedDecay, decomposed: Pencil) -> Traces:
    lines_hz, amplitudes = line_amplitudes(found.record, found.residual)
    orders, poles_hz, damping = stabilisation(decomposed)
    return Traces(
        t_s=found.record.t_s,
        values=found.record.values,
        fitted=found.record.values - found.residual,
        residual=found.residual,
        spectrum_hz=lines_hz,
        residual_amplitude=amplitudes,
        singular_values=decomposed.singular_values,
        stabilisation_order=orders,
        stabilisation_hz=poles_hz,
        stabilisation_damping=damping,
    )


def _refusal(t: FloatArray, refused: RefusedError, options: IdentifyOptions) -> Identification:
    steps = np.diff(t) if t.ndim == 1 else np.zeros(0)
    steps = steps[np.isfinite(steps) & (steps > 0)]
    step_s = float(np.median(steps)) if steps.size else math.inf
    return Identification(
        verdict="refused",
        reasons=(Reason(refused.code, refused.text),),
        notes=(),
        kind=_kind(options),
        unit=options.unit,
        samples=int(t.size),
        rate_hz=1 / step_s,
        gaps=int(np.count_nonzero(steps > GAP_STEPS * step_s)),
    )


def _kind(options: IdentifyOptions) -> str:
    return "pendulum" if options.is_pendulum else "linear"
