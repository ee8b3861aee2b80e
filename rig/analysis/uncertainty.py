"""Uncertainty of the quantities of a run: noise and named systematic terms."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rig.analysis.facts import AnalysisFacts
from rig.analysis.identify.decay import DecayFit
from rig.analysis.summary import BudgetTerm, Quantities

PPM = 1e-6
HALVES_SIGMAS = 2.0  # a smaller difference of the halves is noise


def budget_of(
    measured: Quantities,
    noise: Quantities,
    fit: DecayFit | None,
    halves: tuple[DecayFit, DecayFit] | None,
    terms: AnalysisFacts,
    gravity_m_s2: float,
    scale_rel: float,
) -> list[BudgetTerm]:
    """List the terms of the uncertainty; noise first.

    The scale of the angle enters the frequency by the amplitude term A^2 / 16 of a pendulum. A
    drift of the scale over the record looks like damping. halves: fits of both halves of the
    record; half of what they differ beyond their noise is the term of the model.
    """
    rows = [BudgetTerm(term="noise", **_values(noise))]
    rows.append(
        BudgetTerm(
            term="angle scale",
            peak_swing_rad=_times(measured.peak_swing_rad, scale_rel),
            residual_swing_rad=_times(measured.residual_swing_rad, scale_rel),
        )
    )
    frequency_hz, length_m = measured.natural_frequency_hz, measured.cable_length_m
    if fit is None or frequency_hz is None:
        return rows
    by_scale = 0.125 * fit.amplitude_rad**2 * scale_rel
    rows[1].natural_frequency_hz = by_scale * frequency_hz
    rows[1].cable_length_m = _times(length_m, 2.0 * by_scale)
    clock_rel = terms.clock_ppm * PPM
    rows.append(
        BudgetTerm(
            term="clock",
            natural_frequency_hz=clock_rel * frequency_hz,
            cable_length_m=_times(length_m, 2.0 * clock_rel),
        )
    )
    record_s = fit.periods / frequency_hz
    drift = terms.gain_drift_rel / (2.0 * math.pi * frequency_hz * record_s)
    rows.append(BudgetTerm(term="gain drift", damping_ratio=drift))
    if halves is not None:
        rows.append(_model_term(halves, frequency_hz, length_m))
    gravity_rel = terms.gravity_sigma_m_s2 / gravity_m_s2
    rows.append(BudgetTerm(term="gravity", cable_length_m=_times(length_m, gravity_rel)))
    return rows


def total(rows: Sequence[BudgetTerm]) -> Quantities:
    """Add the terms in quadrature; None where no term is known."""
    found = Quantities()
    for name in Quantities.__struct_fields__:
        values = [getattr(row, name) for row in rows]
        known = [value for value in values if value is not None]
        if known and getattr(rows[0], name) is not None:
            setattr(found, name, math.hypot(*known))
    return found


def _model_term(
    halves: tuple[DecayFit, DecayFit], frequency_hz: float, length_m: float | None
) -> BudgetTerm:
    first, second = halves
    frequency = _beyond_noise(
        second.natural_frequency_hz - first.natural_frequency_hz,
        first.sigma_natural_frequency_hz,
        second.sigma_natural_frequency_hz,
    )
    damping = _beyond_noise(
        second.damping_ratio - first.damping_ratio,
        first.sigma_damping_ratio,
        second.sigma_damping_ratio,
    )
    return BudgetTerm(
        term="halves",
        natural_frequency_hz=frequency,
        damping_ratio=damping,
        cable_length_m=_times(length_m, 2.0 * frequency / frequency_hz),
    )


def _beyond_noise(difference: float, first: float, second: float) -> float:
    """Half of a difference where it exceeds its noise, else 0."""
    noise = math.hypot(first, second)
    return 0.5 * abs(difference) if abs(difference) > HALVES_SIGMAS * noise else 0.0


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else abs(value) * factor


def _values(quantities: Quantities) -> dict[str, float | None]:
    return {name: getattr(quantities, name) for name in Quantities.__struct_fields__}
