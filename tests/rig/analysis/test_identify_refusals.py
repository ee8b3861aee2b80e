"""Records that are no free decay, and what makes a decay doubtful."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from rig.analysis.identify.identification import Identification
from rig.analysis.identify.identify import identify_record
from rig.analysis.identify.identify_options import IdentifyOptions
from tests.rig.analysis.decays import damped, noisy

Array = npt.NDArray[np.float64]

T = np.arange(0, 24, 0.02)
LONG = np.arange(0, 60, 0.02)
LINEAR = IdentifyOptions(kind="linear")
DECAY = damped(T, 0.508, 0.005, 0.1)


def hand() -> Array:
    """Movement that follows itself and no decay: low-passed noise."""
    y = np.zeros(T.size)
    for k, push in enumerate(np.random.default_rng(1).normal(0, 0.03, T.size - 1)):
        y[k + 1] = 0.98 * y[k] + push
    return np.convolve(y, np.ones(20) / 20, "same")


REFUSED: dict[str, list[tuple[Array, Array, str]]] = {
    "spliced": [
        (T, np.where(T < 11, DECAY, damped(T - 11, 0.508, 0.005, 0.05, 2.0)), "jump"),
        (np.concatenate([T[:600], T[:600]]), DECAY, "row 600"),
    ],
    "driven": [
        (LONG, damped(LONG, 0.508, 0.0, 0.1), "envelope is constant"),
        (LONG, damped(LONG, 0.508, 0.02, 0.1) + damped(LONG, 0.9, 0, 0.05), "forced line"),
    ],
    "growing": [(T, damped(T, 0.508, -0.002, 0.05), "grows")],
    "saturated": [(T, np.clip(DECAY, -0.06, 0.06), "limit")],
    "constant": [(T, np.zeros(T.size), "nothing moves")],
    "too_few_samples": [(T[:19], DECAY[:19], "19 samples")],
    "too_short": [(T[:65], DECAY[:65], "periods")],
    "noise_only": [(T, np.zeros(T.size), "variances|turning point")],
    "no_decay": [
        (T, 0.1 * np.sin(2 * math.pi * (0.2 * T + 0.02 * T**2)), "of the signal"),
        (T, hand(), "of the signal"),
    ],
    "not_finite": [(T, np.where((T > 3) & (T < 3.1), np.nan, DECAY), "row 151")],
    "shape": [(T, DECAY[:-1], "two equal")],
}
NOISELESS = ("constant", "saturated")
CASES = [(code, *case) for code, cases in REFUSED.items() for case in cases]


@pytest.mark.parametrize(("code", "t", "y", "words"), CASES)
def test_what_is_no_free_decay_is_refused_by_name_without_a_number(
    code: str, t: Array, y: Array, words: str
) -> None:
    values = y if code in NOISELESS else noisy(y, 3e-4, 1)
    result = identify_record(t, values, LINEAR)
    assert result.verdict == "refused"
    (reason,) = result.reasons
    assert reason.code == code
    assert any(word in reason.text for word in words.split("|"))
    assert result.modes == ()
    assert result.small_amplitude_frequency_hz is None
    assert result.cable_length_m is None
    assert result.second_opinion is None
    assert result.budget == ()


def test_degrees_taken_for_radians_are_refused_or_doubted() -> None:
    large = identify_record(T, 57.3 * noisy(DECAY, 3e-4, 1))
    assert [reason.code for reason in large.reasons] == ["unit"]
    t = np.arange(0, 40, 0.02)
    small = identify_record(t, 57.3 * noisy(damped(t, 0.508, 0.002, 0.004), 2e-5, 1))
    assert "kind" in codes(small)


def codes(result: Identification) -> set[str]:
    return {reason.code for reason in result.reasons}


def doubted(t: Array, y: Array, options: IdentifyOptions = LINEAR) -> set[str]:
    result = identify_record(t, noisy(y, 3e-4, 2), options)
    assert result.verdict == "doubtful"
    assert "failed checks" in {row.term for row in result.budget}
    return codes(result)


def test_holes_are_doubted_with_their_place() -> None:
    keep = (T < 8) | (T > 11)
    assert "holes" in doubted(T[keep], DECAY[keep])


def test_two_rates_and_milliseconds_are_doubted() -> None:
    t = np.concatenate([T[:600], 12 + 0.01 * np.arange(900)])
    assert "clock" in doubted(t, damped(t, 0.508, 0.005, 0.1))
    assert "rate" in doubted(1000 * T, DECAY)


def test_a_frequency_that_changes_with_amplitude_is_doubted() -> None:
    softening = 0.1 * np.exp(-0.02 * T) * np.cos(3.2 * T + 0.05 * np.expm1(-0.04 * T) / 0.04)
    assert doubted(T, softening) & {"halves", "residual", "not_white", "unresolved"}


def test_slow_noise_widens_the_uncertainty() -> None:
    rng = np.random.default_rng(3)
    slow = np.zeros(T.size)
    for k in range(T.size - 1):
        slow[k + 1] = 0.95 * slow[k] + rng.normal(0, 2e-4)
    white = identify_record(T, noisy(DECAY, float(np.std(slow)), 1), LINEAR)
    result = identify_record(T, DECAY + slow, LINEAR)
    assert "not_white" in codes(result)
    ratio = result.modes[0].sigma_frequency_hz / white.modes[0].sigma_frequency_hz
    assert ratio > 2
    error_hz = abs(result.modes[0].frequency_hz - 0.508)
    assert error_hz < 3 * result.modes[0].sigma_frequency_hz


def test_the_whole_uncertainty_is_the_root_sum_of_the_budget() -> None:
    options = IdentifyOptions(clock_ppm=100, gain_drift_rel=0.01, gravity_sigma_m_s2=0.05)
    t = np.arange(0, 12, 0.02)
    result = identify_record(t, noisy(damped(t, 0.5, 0.002, 0.02), 1e-4, 1), options)
    rows = {row.term: row for row in result.budget}
    mode = result.modes[0]
    assert rows["clock"].frequency_hz == pytest.approx(1e-4 * mode.frequency_hz)
    drift = 0.01 / (2 * math.pi * mode.frequency_hz * 11.98)
    assert rows["gain drift"].damping_ratio == pytest.approx(drift, rel=0.02)
    assert result.cable_length_m is not None
    gravity = result.cable_length_m * 0.05 / 9.81
    assert rows["gravity"].cable_length_m == pytest.approx(gravity)
    for name in ("frequency_hz", "damping_ratio"):
        total = math.sqrt(sum(getattr(row, name) ** 2 for row in result.budget))
        assert getattr(mode, f"sigma_{name}") == pytest.approx(total)
    length = math.sqrt(sum(row.cable_length_m**2 for row in result.budget))
    assert result.sigma_cable_length_m == pytest.approx(length)


def test_a_gain_that_drifts_as_the_budget_says_stays_inside_the_uncertainty() -> None:
    for sign in (-1, 1):
        y = noisy(DECAY * (1 + sign * 2e-3 * T / 24), 1e-4, 1)
        mode = identify_record(T, y, IdentifyOptions(kind="linear", gain_drift_rel=2e-3)).modes[0]
        error = mode.damping_ratio - 0.005
        assert 0.5 < abs(error) / mode.sigma_damping_ratio < 1.6
        assert abs(error) > 5 * mode.sigma_noise_damping_ratio


def test_quantised_values_without_noise_are_judged_by_their_quantum() -> None:
    y = 1e-3 * np.round(DECAY / 1e-3)
    result = identify_record(T, y, LINEAR)
    assert result.noise_rms is not None
    assert result.noise_rms >= 1e-3 / math.sqrt(12)
    mode = result.modes[0]
    assert abs(mode.frequency_hz - 0.508) < 3 * mode.sigma_frequency_hz
    assert abs(mode.damping_ratio - 0.005) < 3 * mode.sigma_damping_ratio


def test_a_free_decay_of_any_phase_is_good() -> None:
    for seed in range(12):
        phase = float(np.random.default_rng(seed).uniform(0, 6.28))
        result = identify_record(T, noisy(damped(T, 0.508, 0.003, 0.1, phase), 5e-4, seed), LINEAR)
        assert result.verdict == "good", result.reasons
