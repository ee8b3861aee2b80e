"""The decay fit against a pendulum integrated by scipy, and against the Cramer-Rao bound."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from rig.analysis.identify.decay import (
    DecayFit,
    cable_length_m,
    cable_length_sigma_m,
    fit_decay,
    is_identifiable,
)
from rig.analysis.identify.errors import AnalysisError

Array = npt.NDArray[np.float64]

PERIOD_S = 0.02
FREQUENCY_HZ = 0.508
DAMPING_RATIO = 0.000237  # source 004
ESTIMATES = ("natural_frequency_hz", "damping_ratio", "amplitude_rad", "phase_rad", "offset_rad")


def pendulum(
    t_s: Array,
    amplitude_rad: float,
    frequency_hz: float = FREQUENCY_HZ,
    damping_ratio: float = DAMPING_RATIO,
) -> Array:
    """Full nonlinear pendulum, released from rest at t_s[0]."""
    w = 2 * math.pi * frequency_hz

    def rates(_t: float, x: Array) -> list[float]:
        return [x[1], -w * w * math.sin(x[0]) - 2 * damping_ratio * w * x[1]]

    span = (float(t_s[0]), float(t_s[-1]))
    solution: Any = solve_ivp(
        rates, span, [amplitude_rad, 0.0], method="DOP853", t_eval=t_s, rtol=1e-11, atol=1e-13
    )
    return np.asarray(solution.y[0])


def damped_sinusoid(t_s: Array, p: Array) -> Array:
    """Linear swing for p = (natural frequency [Hz], damping ratio, amplitude, phase, offset)."""
    w = 2 * math.pi * p[0]
    return np.asarray(
        p[2] * np.exp(-p[1] * w * t_s) * np.cos(w * math.sqrt(1 - p[1] ** 2) * t_s + p[3]) + p[4]
    )


def cramer_rao_sigma(t_s: Array, p: Array, noise_rad: float) -> Array:
    """Bound for white noise, derivatives by central differences."""
    h = np.array([1e-6, 1e-6, 1e-7, 1e-6, 1e-7])
    J = np.stack(
        [
            (damped_sinusoid(t_s, p + d) - damped_sinusoid(t_s, p - d)) / 2 / d.max()
            for d in np.diag(h)
        ],
        axis=-1,
    )
    return np.asarray(noise_rad * np.sqrt(np.diag(np.linalg.inv(J.T @ J))))


def averaged(frames: Array, count: int) -> Array:
    return np.convolve(frames, np.ones(count) / count, "valid")


def values(fit: DecayFit) -> Array:
    return np.array([getattr(fit, name) for name in ESTIMATES])


def sigmas(fit: DecayFit) -> Array:
    return np.array([getattr(fit, "sigma_" + name) for name in ESTIMATES])


def test_a_noisy_averaged_free_decay_of_24_s_gives_frequency_to_1e_5_and_damping_to_1_percent() -> (
    None
):
    rng = np.random.default_rng(4)
    t = np.arange(0, 24.04, PERIOD_S)
    frames = pendulum(t, 0.06) + 0.0035 + rng.normal(0, 1e-5, t.size)
    fit = fit_decay(t[1:-1], averaged(frames, 3), average_frames=3, frame_period_s=PERIOD_S)
    assert fit.natural_frequency_hz == pytest.approx(FREQUENCY_HZ, rel=1e-5)
    assert fit.damping_ratio == pytest.approx(DAMPING_RATIO, rel=0.01)
    assert fit.amplitude_rad == pytest.approx(0.06, rel=2e-4)
    assert fit.offset_rad == pytest.approx(0.0035, abs=2e-6)
    assert fit.periods == pytest.approx(24 * FREQUENCY_HZ, rel=1e-3)
    assert fit.samples == t.size - 2


@pytest.mark.parametrize(
    ("amplitude_rad", "damping_ratio", "model_error"),
    [
        (1e-4, 0.000237, 1e-9),
        (0.06, 0.000237, 1e-9),
        (0.06, 0.005, 1e-7),
        (0.3, 0.000237, 1e-5),
        (0.3, 0.02, 1e-5),
    ],
)
def test_the_model_is_the_nonlinear_pendulum(
    amplitude_rad: float, damping_ratio: float, model_error: float
) -> None:
    t = np.arange(0, 20, PERIOD_S)
    truth = pendulum(t, amplitude_rad, damping_ratio=damping_ratio)
    fit = fit_decay(t, truth)
    assert fit.natural_frequency_hz == pytest.approx(FREQUENCY_HZ, rel=1e-6)
    assert fit.damping_ratio == pytest.approx(damping_ratio, rel=3e-4)
    assert np.max(np.abs(fit.angle(t) - truth)) < model_error
    turns = (
        np.flatnonzero(
            (np.abs(truth[1:-1]) >= np.abs(truth[:-2])) & (np.abs(truth[1:-1]) >= np.abs(truth[2:]))
        )
        + 1
    )
    np.testing.assert_allclose(fit.amplitude_at(t[turns]), np.abs(truth[turns]), rtol=2e-3)


@pytest.mark.parametrize(("average_frames", "missing"), [(1, 0.0), (3, 0.0), (3, 0.05)])
def test_the_scatter_is_the_cramer_rao_bound_and_equals_the_reported_sigma(
    average_frames: int, missing: float
) -> None:
    rng = np.random.default_rng(7)
    truth, noise_rad, half = (
        np.array([FREQUENCY_HZ, 0.003, 0.004, 0.8, 0.002]),
        2e-5,
        average_frames // 2,
    )
    t = np.linspace(-half * PERIOD_S, (499 + half) * PERIOD_S, 500 + 2 * half)
    clean, inner = damped_sinusoid(t, truth), t[half : t.size - half]
    found, reported = [], []
    for _ in range(250):
        keep = rng.random(inner.size) >= missing
        keep[0] = True
        samples = averaged(clean + rng.normal(0, noise_rad, t.size), average_frames)
        fit = fit_decay(
            inner[keep], samples[keep], average_frames=average_frames, frame_period_s=PERIOD_S
        )
        found.append(values(fit))
        reported.append(sigmas(fit))
    spread, bound = np.std(found, axis=0), cramer_rao_sigma(t, truth, noise_rad)
    assert np.all(spread < 1.15 * bound)
    np.testing.assert_allclose(np.median(reported, axis=0), spread, rtol=0.15)
    bias = np.mean(found, axis=0) - truth
    assert np.all(
        np.abs(bias) < 4 * spread / math.sqrt(250) + [0, 0, 4e-8, 0, 0]
    )  # amplitude^2 terms: 0.004^3/192


def test_a_residual_of_3_mrad_over_10_s_gives_the_cable_within_half_a_millimetre() -> None:
    rng = np.random.default_rng(2)
    length_m = 9.81 / (2 * math.pi * FREQUENCY_HZ) ** 2
    t = np.arange(0, 10, PERIOD_S)
    clean = pendulum(t, 0.003)
    for _ in range(10):
        fit = fit_decay(t[1:-1], averaged(clean + rng.normal(0, 2e-5, t.size), 3), average_frames=3)
        assert cable_length_m(fit.natural_frequency_hz) == pytest.approx(length_m, abs=0.5e-3)
        sigma_m = cable_length_sigma_m(fit.natural_frequency_hz, fit.sigma_natural_frequency_hz)
        assert abs(cable_length_m(fit.natural_frequency_hz) - length_m) < 4 * sigma_m < 0.5e-3


def test_true_stamps_may_be_jittered_and_missing() -> None:
    rng = np.random.default_rng(5)
    even = np.arange(0, 24, PERIOD_S)
    t = np.sort(even + rng.uniform(0, 0.008, even.size))[rng.random(even.size) > 0.05]
    fit = fit_decay(t, pendulum(t, 0.06))
    assert fit.natural_frequency_hz == pytest.approx(FREQUENCY_HZ, rel=1e-8)
    assert fit.damping_ratio == pytest.approx(DAMPING_RATIO, rel=1e-5)


def test_averaging_does_not_reduce_the_fitted_amplitude() -> None:
    t = np.arange(0, 12, PERIOD_S)
    frames = pendulum(t, 0.05, frequency_hz=1.5)
    fit = fit_decay(t[7:-7], averaged(frames, 15), average_frames=15, frame_period_s=PERIOD_S)
    assert np.ptp(averaged(frames, 15)) < 0.75 * np.ptp(frames)
    assert fit.amplitude_at(t[:1]) == pytest.approx(0.05, rel=1e-4)
    np.testing.assert_allclose(
        fit.angle(t), frames, atol=1e-5
    )  # the gain leaves the phase alone: 2e-4 rad by damping


@settings(max_examples=60, deadline=None)
@given(
    frequency_hz=st.floats(0.3, 3.0),
    periods=st.floats(0.85, 15.0),
    amplitude_rad=st.floats(1e-6, 0.3),
    phase_rad=st.floats(-math.pi, math.pi),
    damping_ratio=st.floats(0.0, 0.03),
    offset_rad=st.floats(-0.05, 0.05),
)
def test_the_swing_is_found_from_less_than_a_period_up_at_any_phase_and_offset(
    frequency_hz: float,
    periods: float,
    amplitude_rad: float,
    phase_rad: float,
    damping_ratio: float,
    offset_rad: float,
) -> None:
    truth = DecayFit(
        t_start_s=3.0,
        natural_frequency_hz=frequency_hz,
        damping_ratio=damping_ratio,
        amplitude_rad=amplitude_rad,
        phase_rad=phase_rad,
        offset_rad=offset_rad,
        sigma_natural_frequency_hz=0,
        sigma_damping_ratio=0,
        sigma_amplitude_rad=0,
        sigma_phase_rad=0,
        sigma_offset_rad=0,
        residual_rms_rad=0,
        periods=periods,
        samples=0,
    )
    t = 3.0 + np.arange(0, periods / frequency_hz, 0.01)
    fit = fit_decay(t, truth.angle(t))
    assert fit.natural_frequency_hz == pytest.approx(frequency_hz, rel=1e-4)
    assert fit.damping_ratio == pytest.approx(damping_ratio, abs=1e-4)
    assert fit.amplitude_rad == pytest.approx(amplitude_rad, rel=1e-3)
    assert fit.offset_rad == pytest.approx(offset_rad, abs=1e-3 * amplitude_rad)
    assert abs(math.remainder(fit.phase_rad - phase_rad, 2 * math.pi)) < 1e-3
    assert abs(fit.phase_rad) <= math.pi


@pytest.mark.parametrize("average_frames", [1, 3])
def test_noise_alone_gives_no_significant_swing(average_frames: int) -> None:
    rng = np.random.default_rng(9)
    t = np.arange(0, 10, PERIOD_S)
    for _ in range(60):
        noise = averaged(rng.normal(0, 1e-5, t.size + average_frames - 1), average_frames)
        fit = fit_decay(t, noise, average_frames=average_frames)
        assert not is_identifiable(fit.natural_frequency_hz, fit.sigma_natural_frequency_hz)
        assert not is_identifiable(fit.amplitude_rad, fit.sigma_amplitude_rad)


def test_a_value_is_identifiable_up_to_a_sigma_of_half_of_it() -> None:
    assert is_identifiable(-2.0, 1.0)
    assert not is_identifiable(2.0, 1.01)
    assert not is_identifiable(2.0, math.inf)
    assert not is_identifiable(2.0, math.nan)


def test_the_length_sigma_is_the_derivative_of_the_length() -> None:
    change_m = cable_length_m(0.508 - 1e-6) - cable_length_m(0.508 + 1e-6)
    assert cable_length_sigma_m(0.508, 1e-6) == pytest.approx(change_m / 2, rel=1e-6)
    assert cable_length_m(0.508, gravity_m_s2=9.81) == pytest.approx(0.9629, abs=1e-4)


T = PERIOD_S * np.arange(100)


@pytest.mark.parametrize(
    ("t_s", "angle_rad", "average_frames", "message"),
    [
        (T[:19], np.cos(3 * T[:19]), 1, "19 samples; need 20"),
        (T, np.cos(1.5 * T), 1, "0.4. periods in 1.98 s; need 0.8"),
        (T, np.full(100, 0.002), 1, "in all 100 samples; must vary"),
        (T, np.where(T < 1, np.nan, 1.0), 1, "finite"),
        (T[::-1], np.cos(T), 1, "stamps must rise"),
        (T, np.cos(T[:50]), 1, r"\(100,\).*\(50,\)"),
        (T, np.cos(3 * T), 0, "average_frames = 0"),
        (T[:20] / 8, np.cos(15 * T[:20]), 1, "less than half a swing"),
        (T[:20], np.cos(15 * T[:20]), 400, "degrees of freedom"),
    ],
)
def test_data_insufficient_for_a_fit_are_refused_with_the_reason(
    t_s: Array, angle_rad: Array, average_frames: int, message: str
) -> None:
    with pytest.raises(AnalysisError, match=message):
        fit_decay(t_s, angle_rad, average_frames=average_frames)


def test_the_averaged_angle_of_a_fit_is_the_mean_of_its_frames() -> None:
    t = np.arange(0.0, 8.0, PERIOD_S)
    fit = fit_decay(t, pendulum(t, 0.1))
    frames = [fit.angle(t + shift * PERIOD_S) for shift in (-1, 0, 1)]
    averaged = fit.angle(t, average_frames=3, frame_period_s=PERIOD_S)
    assert np.max(np.abs(averaged - np.mean(frames, axis=0))) < 1e-7
    assert np.max(np.abs(averaged - frames[1])) > 1e-5
