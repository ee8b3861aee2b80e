"""Delays: known delays are found."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from scipy.signal import lsim

from rig.analysis.identify.errors import AnalysisError
from rig.analysis.identify.latency import (
    alignment_s,
    alignment_sigma_s,
    command_latency_s,
    swing_error_rms_rad,
    tracking_error,
)

Array = npt.NDArray[np.float64]

START_S, TIME_S, DISTANCE_M = 3.5, 1.1, 0.2
OMEGA_RAD_S = 3.192


def plan(t_s: Array) -> Array:
    """Quintic rest-to-rest move."""
    u = np.clip((t_s - START_S) / TIME_S, 0, 1)
    return np.asarray(DISTANCE_M * u**3 * (10 - 15 * u + 6 * u**2))


@pytest.mark.parametrize("delay_s", [-0.0123, 0.0, 0.0604, 0.2])
def test_a_late_platform_is_found_late_by_that_much(delay_s: float) -> None:
    rng = np.random.default_rng(3)
    t = np.sort(np.arange(0, 10, 0.01) + rng.uniform(0, 0.004, 1000))
    latency_s = command_latency_s(t, plan(t - delay_s), plan)
    assert latency_s == pytest.approx(delay_s, abs=1e-5)
    noisy_s = command_latency_s(t, plan(t - delay_s) + rng.normal(0, 2e-5, t.size), plan)
    assert noisy_s == pytest.approx(delay_s, abs=1e-4)


def test_a_servo_is_late_by_the_sum_of_its_time_constants() -> None:
    w, zeta, t = 2 * math.pi * 11, 1.0, np.arange(0, 10, 0.002)
    _, actual, _ = lsim(([w * w], [1, 2 * zeta * w, w * w]), plan(t), t)
    assert command_latency_s(t[::5], actual[::5], plan) == pytest.approx(2 * zeta / w, abs=1e-3)


def test_a_steady_error_of_the_platform_shifts_the_delay_as_least_squares_predicts() -> None:
    t, error_m = np.arange(0, 10, 0.01), 1e-4
    speed_squared = (
        10 / 7 * DISTANCE_M**2 / TIME_S
    )  # integral of the quintic's speed^2 over the move
    shift_s = error_m * DISTANCE_M / speed_squared
    assert command_latency_s(t, plan(t - 0.06) + error_m, plan) == pytest.approx(
        0.06 - shift_s, abs=5e-6
    )


def test_a_move_to_the_left_has_the_same_delay() -> None:
    t = np.arange(0, 10, 0.01)
    assert command_latency_s(t, -plan(t - 0.06), lambda at: -plan(at)) == pytest.approx(
        0.06, abs=1e-5
    )


def test_without_a_move_there_is_no_delay() -> None:
    t = np.arange(0, 10, 0.01)
    rest = np.zeros_like(t)
    assert command_latency_s(t, rest, lambda at: 0.004 * plan(at)) is None  # 0.8 mm planned
    assert command_latency_s(t, rest, plan) is None  # the platform stood still
    assert command_latency_s(t[:3], plan(t[:3]), plan) is None


def test_a_delay_outside_the_searched_range_gives_none() -> None:
    t = np.arange(0, 10, 0.01)
    assert command_latency_s(t, plan(t - 0.9), plan) is None


def truth(t_s: Array) -> tuple[Array, Array]:
    """Angle and rate of a swing after a move."""
    fall = 0.05 * np.exp(-0.02 * t_s)
    angle = fall * np.sin(OMEGA_RAD_S * t_s)
    return np.asarray(angle), np.asarray(
        OMEGA_RAD_S * fall * np.cos(OMEGA_RAD_S * t_s) - 0.02 * angle
    )


KNOWN = np.arange(0, 8, 0.01)
STAMPS = np.arange(0.1, 7.9, 0.02)


@pytest.mark.parametrize("late_s", [-0.04, 0.0, 0.0035, 0.035])
def test_a_camera_that_stamps_too_late_is_seen_as_late(late_s: float) -> None:
    measured = truth(STAMPS - late_s)[0] + np.random.default_rng(1).normal(0, 2e-5, STAMPS.size)
    assert alignment_s(STAMPS, measured, KNOWN, *truth(KNOWN)) == pytest.approx(late_s, abs=1e-4)


def test_no_swing_error_is_left_at_the_right_stamps_and_all_of_it_at_wrong_ones() -> None:
    assert swing_error_rms_rad(STAMPS, truth(STAMPS)[0], KNOWN, *truth(KNOWN)) < 1e-9
    late = swing_error_rms_rad(STAMPS, truth(STAMPS - 0.01)[0], KNOWN, *truth(KNOWN))
    assert late == pytest.approx(0.01 * float(np.sqrt(np.mean(truth(STAMPS)[1] ** 2))), rel=0.01)
    assert swing_error_rms_rad(
        STAMPS, truth(STAMPS)[0] + 1e-3, KNOWN, *truth(KNOWN)
    ) == pytest.approx(1e-3, rel=1e-6)


def test_angles_outside_the_truth_are_left_out() -> None:
    everywhere = np.arange(-3.0, 12.0, 0.02)
    inside = (everywhere >= KNOWN[0]) & (everywhere <= KNOWN[-1])
    measured = np.where(inside, truth(everywhere - 0.02)[0], 99.0)
    assert alignment_s(everywhere, measured, KNOWN, *truth(KNOWN)) == pytest.approx(0.02, abs=1e-6)
    assert swing_error_rms_rad(everywhere, measured, KNOWN, *truth(KNOWN)) < 0.01


@pytest.mark.parametrize("known", [KNOWN[:10], KNOWN[:0]])
def test_too_little_truth_is_an_error(known: Array) -> None:
    with pytest.raises(AnalysisError, match="need 10"):
        swing_error_rms_rad(STAMPS, truth(STAMPS)[0], known, *truth(known))


def test_a_load_at_rest_cannot_be_aligned() -> None:
    with pytest.raises(AnalysisError, match="the mismatch has no minimum"):
        alignment_s(
            STAMPS, np.zeros_like(STAMPS), KNOWN, np.zeros_like(KNOWN), np.zeros_like(KNOWN)
        )


def test_a_tracking_error_is_split_into_its_delay_and_what_is_left() -> None:
    delay_s, ripple_m = 0.057, 2e-4
    t_s = np.arange(0.0, 4.0, 0.01)

    def plan(at_s: np.ndarray) -> np.ndarray:
        share = np.clip((at_s - 1.0) / 1.5, 0.0, 1.0)
        return 0.1 * (1.0 - np.cos(math.pi * share))

    noise_m = np.random.default_rng(4).normal(0.0, ripple_m, t_s.size)
    found = tracking_error(t_s, plan(t_s - delay_s) + noise_m, plan)
    assert found is not None
    assert abs(found.delay_s - delay_s) < 4.0 * found.sigma_delay_s
    assert found.distortion_rms == pytest.approx(ripple_m, rel=0.15)
    # a delay d makes d times the speed: rms of 0.1 pi / 1.5 sin over the move
    assert found.delay_rms == pytest.approx(
        delay_s * 0.1 * math.pi / 1.5 / math.sqrt(2.0), rel=0.05
    )


def test_the_sigma_of_a_delay_covers_its_error() -> None:
    t_s = np.arange(0.0, 3.0, 0.01)

    def plan(at_s: np.ndarray) -> np.ndarray:
        return 0.1 * (1.0 - np.cos(math.pi * np.clip(at_s - 1.0, 0.0, 1.0)))

    scores = []
    for seed in range(60):
        noise_m = np.random.default_rng(seed).normal(0.0, 1e-4, t_s.size)
        found = tracking_error(t_s, plan(t_s - 0.03) + noise_m, plan)
        assert found is not None
        scores.append((found.delay_s - 0.03) / found.sigma_delay_s)
    assert 0.6 < np.std(scores) < 1.5


def test_the_bound_of_an_alignment_is_noise_over_the_root_of_squared_rates() -> None:
    sigma_rad, rate_rad_s = np.full(100, 1e-4), np.full(100, 0.2)
    assert alignment_sigma_s(sigma_rad, rate_rad_s) == pytest.approx(1e-4 / (0.2 * 10.0))
    assert alignment_sigma_s(sigma_rad, np.zeros(100)) == math.inf
