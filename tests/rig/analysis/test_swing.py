"""Swing amplitudes and the interpolated truth against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from rig.analysis.identify.errors import AnalysisError
from rig.analysis.identify.swing import (
    initial_swing_rad,
    largest_gap_s,
    peak_swing_rad,
    residual_amplitude_rad,
    settling_time_s,
    truth_at,
)

OMEGA_RAD_S = 3.192


def test_the_peak_is_the_largest_excursion_to_either_side_inside_the_window() -> None:
    t = np.arange(6.0)
    angle = np.array([0.9, 0.1, -0.3, 0.2, 0.25, -0.8])
    assert peak_swing_rad(t, angle, 1.0, 4.0) == 0.3
    assert peak_swing_rad(t, angle, 0.0, 5.0) == 0.9


def test_a_gap_counts_from_the_edges_of_the_window_too() -> None:
    t_s = np.array([0.0, 0.1, 0.2, 0.6, 0.7, 2.0])
    assert largest_gap_s(t_s, 0.0, 0.75) == pytest.approx((0.2, 0.6))
    assert largest_gap_s(t_s, 0.0, 1.5) == pytest.approx((0.7, 1.5))
    assert largest_gap_s(t_s, -1.0, 0.2) == pytest.approx((-1.0, 0.0))
    assert largest_gap_s(np.empty(0), 1.0, 3.0) == (1.0, 3.0)


def test_a_window_without_angles_has_no_peak() -> None:
    with pytest.raises(AnalysisError, match=r"\[7.000, 8.000\] s"):
        peak_swing_rad(np.arange(6.0), np.zeros(6), 7.0, 8.0)


@given(
    phase=st.floats(-math.pi, math.pi),
    amplitude_rad=st.floats(0.0, 0.3),
    t_start_s=st.floats(0, 1000),
)
def test_the_initial_swing_is_found_at_any_phase_even_on_less_than_two_periods(
    phase: float, amplitude_rad: float, t_start_s: float
) -> None:
    t = t_start_s + np.arange(0, 3.5, 0.02)
    angle = amplitude_rad * np.cos(OMEGA_RAD_S * t + phase)
    assert initial_swing_rad(t, angle, OMEGA_RAD_S) == pytest.approx(amplitude_rad, abs=1e-12)


def test_noise_moves_the_initial_swing_by_no_more_than_least_squares_allows() -> None:
    rng = np.random.default_rng(1)
    t = np.arange(0, 3.5, 0.02)
    clean = 0.002 * np.cos(OMEGA_RAD_S * t)
    found = [
        initial_swing_rad(t, clean + rng.normal(0, 5e-5, t.size), OMEGA_RAD_S) for _ in range(200)
    ]
    assert np.mean(found) == pytest.approx(0.002, abs=2e-6)
    assert np.std(found) == pytest.approx(5e-5 * math.sqrt(2 / t.size), rel=0.2)


@pytest.mark.parametrize("t_s", [np.array([0.0, 1.0]), np.arange(0, 0.4, 0.02)])
def test_a_quiet_window_too_short_for_a_sinusoid_is_refused(
    t_s: np.ndarray[tuple[int], np.dtype[np.float64]],
) -> None:
    with pytest.raises(AnalysisError, match="raise quiet_s"):
        initial_swing_rad(t_s, np.zeros(t_s.size), OMEGA_RAD_S)


@given(
    t_s=st.floats(0, 20),
    amplitude_rad=st.floats(1e-6, 1e-3),
    omega_rad_s=st.floats(1, 20),
    damping_ratio=st.floats(0, 0.3),
)
def test_the_residual_amplitude_is_the_envelope_of_a_small_damped_swing(
    t_s: float, amplitude_rad: float, omega_rad_s: float, damping_ratio: float
) -> None:
    decay_1_s = damping_ratio * omega_rad_s
    damped_rad_s = omega_rad_s * math.sqrt(1.0 - damping_ratio**2)
    envelope_rad = amplitude_rad * math.exp(-decay_1_s * t_s)
    angle_rad = envelope_rad * math.cos(damped_rad_s * t_s)
    rate_rad_s = -decay_1_s * angle_rad - damped_rad_s * envelope_rad * math.sin(damped_rad_s * t_s)
    found_rad = residual_amplitude_rad(angle_rad, rate_rad_s, omega_rad_s, damping_ratio)
    assert found_rad == pytest.approx(envelope_rad, rel=1e-6, abs=1e-15)


@pytest.mark.parametrize("amplitude_rad", [0.1, 0.5, 1.5])
def test_the_residual_amplitude_is_the_turning_point_of_a_large_swing(amplitude_rad: float) -> None:
    swing = solve_ivp(
        lambda _, y: [y[1], -(OMEGA_RAD_S**2) * math.sin(y[0])],
        (0.0, 3.0),
        [amplitude_rad, 0.0],
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
    )
    for angle_rad, rate_rad_s in swing.y.T:
        found_rad = residual_amplitude_rad(float(angle_rad), float(rate_rad_s), OMEGA_RAD_S, 0.0)
        assert found_rad == pytest.approx(amplitude_rad, rel=1e-8)


def test_the_truth_between_its_stamps_is_true() -> None:
    known = np.arange(0, 3, 0.01)
    t = np.linspace(0, known[-1], 5000)
    between = truth_at(
        t, known, np.sin(OMEGA_RAD_S * known), OMEGA_RAD_S * np.cos(OMEGA_RAD_S * known)
    )
    np.testing.assert_allclose(between, np.sin(OMEGA_RAD_S * t), atol=3e-9)


@pytest.mark.parametrize("t_s", [-0.001, 1.001])
def test_the_truth_is_not_extrapolated_beyond_its_stamps(t_s: float) -> None:
    with pytest.raises(AnalysisError, match=r"truth covers \[0.000, 1.000\] s"):
        truth_at(np.array([0.5, t_s]), np.array([0.0, 1.0]), np.zeros(2), np.zeros(2))


def test_an_empty_truth_is_an_error_unless_no_instant_is_requested() -> None:
    with pytest.raises(AnalysisError, match="truth covers nothing"):
        truth_at(np.array([0.5]), np.array([]), np.array([]), np.array([]))
    assert truth_at(np.array([]), np.array([0.0, 1.0]), np.zeros(2), np.zeros(2)).size == 0


def test_a_decay_settles_when_its_envelope_enters_the_band() -> None:
    t_s = np.arange(0.0, 20.0, 0.01)
    angle_rad = 0.05 * np.exp(-0.3 * t_s) * np.cos(OMEGA_RAD_S * t_s)
    found_s = settling_time_s(t_s, angle_rad, 2.0, 1e-3)
    expected_s = math.log(50.0) / 0.3 - 2.0
    assert found_s is not None
    assert expected_s - math.pi / OMEGA_RAD_S < found_s <= expected_s
    assert settling_time_s(t_s, 1e-4 * angle_rad, 2.0, 1e-3) == 0.0
    assert settling_time_s(t_s, np.cos(t_s), 2.0, 1e-3) is None
    assert settling_time_s(t_s, angle_rad, 30.0, 1e-3) is None
