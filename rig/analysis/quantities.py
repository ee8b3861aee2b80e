"""The quantities of a run: measured, true and planned; initial swing and error of the swing."""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np

from rig.analysis.identify.decay import (
    DecayFit,
    cable_length_m,
    cable_length_sigma_m,
    fit_decay,
    is_identifiable,
)
from rig.analysis.identify.errors import AnalysisError
from rig.analysis.identify.latency import swing_error_rms_rad
from rig.analysis.identify.swing import (
    initial_swing_rad,
    largest_gap_s,
    peak_swing_rad,
    residual_amplitude_rad,
    settling_time_s,
)
from rig.analysis.run_log import RunLog
from rig.analysis.summary import BudgetTerm, Planned, Quantities, SwingError
from rig.analysis.true_load import is_beyond_a_pendulum, true_load, true_motion, true_rate
from rig.analysis.uncertainty import budget_of, total

FITTED = ("residual_swing_rad", "natural_frequency_hz", "damping_ratio", "cable_length_m")
MAX_MISSING_FRAMES = 2  # in a row, while the largest swing is looked for


def measured_quantities(
    run: RunLog, fit: DecayFit | None
) -> tuple[Quantities, Quantities, list[BudgetTerm]]:
    """Compute the measured quantities, the deviations of their noise, and their budget.

    A value whose whole standard deviation exceeds half of it is None.
    """
    measured, noise = Quantities(), Quantities()
    t, angle, sigma_rad = run.single_frames
    if run.t_start_s is not None and t.size and peak_gap_s(run) is None:
        with suppress(AnalysisError):
            measured.peak_swing_rad = peak_swing_rad(t, angle, *run.swing_window_s)
            noise.peak_swing_rad = float(np.median(sigma_rad))
    if fit is not None and math.isfinite(fit.sigma_amplitude_rad):
        _add_fitted(run, fit, measured, noise)
    terms = run.facts.analysis
    scale_rel = terms.angle_scale_rel
    if scale_rel is None:
        scale_rel = run.angle_scale_of(run.main_camera).sigma_rel
    budget = budget_of(
        measured, noise, fit, _halves(run, fit), terms, run.facts.gravity_m_s2, scale_rel
    )
    whole = total(budget)
    for name in FITTED:
        value, deviation = getattr(measured, name), getattr(whole, name)
        if value is not None and not is_identifiable(value, deviation):
            setattr(measured, name, None)
    return measured, noise, budget


def _add_fitted(run: RunLog, fit: DecayFit, measured: Quantities, noise: Quantities) -> None:
    """Add the quantities of the swing after the move."""
    g = run.facts.gravity_m_s2
    frequency_hz = fit.natural_frequency_hz
    sigma_frequency_hz = fit.sigma_natural_frequency_hz
    residual_rad = float(fit.amplitude_at(np.array(run.t_settled_s)))
    sigma_length_m = cable_length_sigma_m(frequency_hz, sigma_frequency_hz, g)
    found = {
        "residual_swing_rad": (residual_rad, fit.sigma_amplitude_rad),
        "natural_frequency_hz": (frequency_hz, sigma_frequency_hz),
        "damping_ratio": (fit.damping_ratio, fit.sigma_damping_ratio),
        "cable_length_m": (cable_length_m(frequency_hz, g), sigma_length_m),
    }
    if run.facts.is_chain:
        del found["cable_length_m"]
    for name, (value, deviation) in found.items():
        setattr(measured, name, value)
        setattr(noise, name, deviation)


def _halves(run: RunLog, fit: DecayFit | None) -> tuple[DecayFit, DecayFit] | None:
    """Fit both halves of the record by themselves; None where one is too short."""
    if fit is None or not math.isfinite(fit.sigma_amplitude_rad):
        return None
    t, angle, _ = run.swing
    middle_s = 0.5 * (run.t_settled_s + float(t[-1]))
    period_s = 1.0 / run.facts.rate_of(run.main_camera)
    found = []
    for part in ((t >= run.t_settled_s) & (t < middle_s), t >= middle_s):
        try:
            half = fit_decay(
                t[part],
                angle[part],
                average_frames=run.facts.average_frames,
                frame_period_s=period_s,
            )
        except AnalysisError:
            return None
        if not math.isfinite(half.sigma_amplitude_rad):
            return None
        found.append(half)
    return found[0], found[1]


def peak_gap_s(run: RunLog) -> tuple[float, float] | None:
    """Find the longest part of the swing without an angle; None if a peak cannot hide in it."""
    if run.t_start_s is None or not run.facts.rate_hz:
        return None
    t, _, _ = run.single_frames
    first_s, last_s = largest_gap_s(t, *run.swing_window_s)
    limit_s = (MAX_MISSING_FRAMES + 1.5) / run.facts.rate_of(run.main_camera)
    return (first_s, last_s) if last_s - first_s > limit_s else None


def true_quantities(run: RunLog) -> Quantities | None:
    """Compute the quantities of the simulated plant; None on a real rig."""
    omega = run.true_omega_rad_s
    if omega is None:
        return None
    motion = true_motion(run)
    if is_beyond_a_pendulum(run, motion):
        return true_load(run, motion)
    load = run.plant_params["pendulum"]
    truth = Quantities(
        natural_frequency_hz=omega / (2 * math.pi),
        damping_ratio=load["damping_ratio"],
        cable_length_m=load["length_m"],
    )
    t, angle, rate, _ = run.truth.T
    if run.t_start_s is not None and t.size > 1 and t[-1] >= run.t_settled_s:
        from scipy.interpolate import CubicHermiteSpline

        t0, t1 = run.swing_window_s
        curve = CubicHermiteSpline(t, angle, rate)
        at_s = float(run.t_settled_s)
        truth.residual_swing_rad = residual_amplitude_rad(
            float(curve(at_s)), true_rate(run, float(curve(at_s, 1))), omega, load["damping_ratio"]
        )
        truth.peak_swing_rad = peak_swing_rad(t, angle, t0, t1)
    return truth


def planned_quantities(run: RunLog) -> Planned:
    """Read the swing that the plan predicts; the residual at the instant of the measured one.

    The damping of the model acts from the end of the plan to that instant.
    """
    metrics = run.plan.metrics or {}
    residual_rad = metrics.get("residual_swing_nonlinear_rad")
    omega_rad_s = 2 * math.pi * (model_quantities(run).natural_frequency_hz or 0.0)
    if residual_rad is not None and run.t_start_s is not None:
        settling_s = run.t_settled_s - run.t_move_s - run.plan.time_s
        residual_rad *= math.exp(-run.facts.damping_ratio * omega_rad_s * settling_s)
    return Planned(peak_swing_rad=metrics.get("peak_swing_rad"), residual_swing_rad=residual_rad)


def model_quantities(run: RunLog) -> Quantities:
    """Compute the quantities of the planner's cable, f0 = sqrt(g / L) / 2 pi; none of a chain."""
    facts = run.facts
    if facts.is_chain or facts.cable_length_m <= 0.0:
        return Quantities()
    omega_rad_s = math.sqrt(facts.gravity_m_s2 / facts.cable_length_m)
    return Quantities(
        natural_frequency_hz=omega_rad_s / (2 * math.pi),
        damping_ratio=facts.damping_ratio,
        cable_length_m=facts.cable_length_m,
    )


def swing_error(run: RunLog) -> SwingError:
    """Compute the error of the measured against the true angle, at unchanged stamps."""
    error = SwingError()
    if run.truth.size == 0 or run.t_start_s is None:
        return error
    t, angle, _ = run.swing
    inside = (t >= run.t_move_s) & (t <= run.t_settled_s) & (run.plan.time_s > 0)
    outside = ~inside & (t >= run.t_start_s)
    truth = run.truth.T[:3]
    with suppress(AnalysisError):
        error.during_move_rad = swing_error_rms_rad(t[inside], angle[inside], *truth)
    with suppress(AnalysisError):
        error.outside_move_rad = swing_error_rms_rad(t[outside], angle[outside], *truth)
    return error


def initial_swing(run: RunLog) -> float | None:
    """Fit the swing before the move [rad]; None where it cannot be fitted."""
    if run.t_start_s is None or run.plan.time_s == 0:
        return None
    t, angle, _ = run.swing
    quiet = (t >= run.t_start_s) & (t < run.t_move_s)
    omega_rad_s = math.sqrt(run.facts.gravity_m_s2 / run.facts.cable_length_m)
    try:
        return initial_swing_rad(t[quiet], angle[quiet], omega_rad_s)
    except AnalysisError:
        return None


def settling(run: RunLog) -> float | None:
    """Compute the settling time after a move; None without one, or where it has not settled."""
    if run.t_start_s is None or run.plan.time_s == 0 or not run.facts.rate_hz:
        return None
    t, angle, _ = run.swing
    end_s = run.t_move_s + run.plan.time_s
    return settling_time_s(t, angle, end_s, run.facts.analysis.settling_band_rad)
