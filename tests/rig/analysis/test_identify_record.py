"""The identification of single modes against integrated and closed truths."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest

from rig.analysis.identify.errors import AnalysisError
from rig.analysis.identify.identification import Identification, Mode
from rig.analysis.identify.identify import identify_record
from rig.analysis.identify.identify_options import IdentifyOptions
from tests.rig.analysis.decays import damped, noisy, pendulum

Array = npt.NDArray[np.float64]

T = np.arange(0, 24, 0.02)
LINEAR = IdentifyOptions(kind="linear")


def codes(result: Identification) -> set[str]:
    return {reason.code for reason in result.reasons}


def noted(result: Identification) -> set[str]:
    return {note.code for note in result.notes}


def only(result: Identification) -> Mode:
    assert len(result.modes) == 1
    return result.modes[0]


def is_right(mode: Mode, frequency_hz: float, damping_ratio: float, sigmas: float = 4) -> bool:
    return (
        abs(mode.frequency_hz - frequency_hz) < sigmas * mode.sigma_frequency_hz
        and abs(mode.damping_ratio - damping_ratio) < sigmas * mode.sigma_damping_ratio
    )


def bounds(t: Array, p: Sequence[float], noise: float) -> Array:
    """Cramer-Rao bounds of frequency [Hz] and damping ratio of a linear mode with an offset."""

    def model(q: Array) -> Array:
        return damped(t, q[0], q[1], q[2], q[3]) + q[4]

    at = np.array([*p, 0.0])
    h = 1e-6
    J = np.stack([(model(at + h * e) - model(at - h * e)) / (2 * h) for e in np.eye(5)], axis=-1)
    return np.asarray(noise * np.sqrt(np.diag(np.linalg.inv(J.T @ J))))[:2]


def test_a_linear_decay_is_found_at_the_bound_and_its_uncertainty_covers_the_truth() -> None:
    truth, noise = (0.508, 0.004, 0.1, 0.3), 5e-4
    bound = bounds(T, truth, noise)
    errors, covered = [], []
    for seed in range(40):
        mode = only(identify_record(T, noisy(damped(T, *truth), noise, seed), LINEAR))
        errors.append([mode.frequency_hz - truth[0], mode.damping_ratio - truth[1]])
        covered.append(is_right(mode, truth[0], truth[1], sigmas=2.5))
        assert mode.sigma_noise_frequency_hz == pytest.approx(bound[0], rel=0.3)
        assert mode.sigma_noise_damping_ratio == pytest.approx(bound[1], rel=0.3)
    rmse = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.all(rmse < 1.4 * bound)
    assert np.mean(covered) > 0.85


@pytest.mark.parametrize(
    ("amplitude", "damping_ratio", "duration_s"),
    [(0.02, 2e-4, 24), (0.1, 0.002, 24), (0.1, 0.05, 24), (0.1, 0.2, 12), (0.1, 0.002, 3.5)],
)
def test_a_pendulum_is_found_with_its_length(
    amplitude: float, damping_ratio: float, duration_s: float
) -> None:
    t = T[duration_s > T]
    result = identify_record(t, noisy(pendulum(t, amplitude, 0.5, damping_ratio), 2e-4, 3))
    assert result.verdict == "good"
    assert result.kind == "pendulum"
    assert is_right(only(result), 0.5, damping_ratio)
    assert result.small_amplitude_frequency_hz == result.modes[0].frequency_hz
    assert result.cable_length_m is not None
    assert result.sigma_cable_length_m is not None
    error_m = abs(result.cable_length_m - 9.81 / math.pi**2)
    assert error_m < result.sigma_cable_length_m  # gravity's share, its value being exact here
    assert result.sigma_cable_length_m > 0.9e-3


@pytest.mark.parametrize(("amplitude", "duration_s"), [(0.7, 16.0), (2.0, 10.0)])
def test_a_large_swing_gives_the_frequency_of_the_small_one(
    amplitude: float, duration_s: float
) -> None:
    t = T[duration_s > T]
    mode = only(identify_record(t, noisy(pendulum(t, amplitude, 0.5, 0.01), 5e-4, 2)))
    assert is_right(mode, 0.5, 0.01)
    assert mode.frequency_hz == pytest.approx(0.5, rel=2e-4)
    assert mode.amplitude == pytest.approx(amplitude, rel=1e-3)


def test_dry_friction_of_a_large_swing_gives_a_damping_ratio_that_rises_as_it_fades() -> None:
    t = np.arange(0, 6, 0.002)
    y = pendulum(t, 1.6, 1.745, 0.012, friction=0.01)
    y = 1.6e-3 * np.round(noisy(y, 1e-3, 1) / 1.6e-3)
    result = identify_record(t, np.degrees(y), IdentifyOptions(unit="deg"))
    assert result.unit == "rad"
    assert "coulomb" in result.terms
    assert only(result).frequency_hz == pytest.approx(1.745, abs=0.002)
    damping = [row.damping_ratio for row in result.damping_over_amplitude]
    assert damping[-1] > 1.1 * damping[0]


@pytest.mark.parametrize("drag", [0.01, 0.1])
def test_damping_is_that_of_the_amplitude_it_names(drag: float) -> None:
    result = identify_record(T, noisy(pendulum(T, 0.1, 0.5, 5e-4, drag=drag), 5e-4, 4))
    mode = only(result)
    assert 0.02 < mode.at_amplitude < 0.1
    truth = 5e-4 + 4 * drag * mode.at_amplitude / (3 * math.pi)
    assert is_right(mode, 0.5, truth)
    assert ("quadratic" in result.terms) == (drag > 0.05)


def test_friction_is_found_and_stops_the_swing() -> None:
    t = np.arange(0, 60, 0.02)
    result = identify_record(t, noisy(pendulum(t, 0.1, 0.5, 1e-3, friction=4e-4), 2e-4, 5))
    assert result.terms == ("coulomb",)
    mode = only(result)
    assert is_right(mode, 0.5, 1e-3 + 2 * 4e-4 / (math.pi * mode.at_amplitude))


def test_the_average_of_frames_takes_nothing_from_the_amplitude() -> None:
    t = np.arange(0, 12, 0.02)
    frames = noisy(damped(t, 1.5, 0.002, 0.05), 1e-5, 1)
    averaged = np.convolve(frames, np.ones(15) / 15, "valid")
    options = IdentifyOptions(kind="linear", average_frames=15, frame_period_s=0.02)
    result = identify_record(t[7:-7], averaged, options)
    mode = only(result)
    expected = 0.05 * math.exp(-0.002 * 3 * math.pi * t[7])
    assert mode.amplitude == pytest.approx(expected, rel=5e-4)
    assert is_right(mode, 1.5, 0.002)
    assert result.verdict == "good"


def test_a_drift_of_the_offset_is_a_term_of_its_own() -> None:
    y = noisy(damped(T, 0.508, 1e-3, 0.1), 5e-4, 1)
    plain = identify_record(T, y, LINEAR)
    drifting = identify_record(T, y + 5e-3 * T / 24, LINEAR)
    assert plain.terms == ()
    assert drifting.terms == ("trend",)
    assert is_right(only(drifting), 0.508, 1e-3)
    assert drifting.verdict == "good"


def test_spikes_are_left_out() -> None:
    rng = np.random.default_rng(2)
    y = noisy(damped(T, 0.508, 1e-3, 0.1), 5e-4, 1)
    hit = rng.choice(T.size, 12, replace=False)
    clean = only(identify_record(T, y, LINEAR))
    y[hit] += 0.05
    result = identify_record(T, y, LINEAR)
    assert "spikes" in noted(result)
    assert result.verdict == "good"
    assert only(result).sigma_noise_frequency_hz < 1.1 * clean.sigma_noise_frequency_hz
    assert is_right(only(result), 0.508, 1e-3)


def test_lead_in_by_hand_and_what_follows_a_push_are_left_out() -> None:
    t = np.arange(0, 40, 0.02)
    hand = 0.06 * np.sin(0.9 * t) * np.sin(0.31 * t)
    decay = damped(np.maximum(t - 8, 0), 0.508, 0.01, 0.1, 0.0)
    pushed = np.where(t < 30, 0.0, 0.09 * np.sin(2 * math.pi * 0.508 * (t - 30)))
    result = identify_record(t, noisy(np.where(t < 8, hand, decay) + pushed, 3e-4, 1), LINEAR)
    assert result.window_s is not None
    assert result.window_s[0] == pytest.approx(8, abs=0.3)
    assert result.window_s[1] < 31
    assert noted(result) >= {"lead_in", "tail"}
    assert is_right(only(result), 0.508, 0.01)


def test_from_and_to_choose_the_part() -> None:
    y = noisy(damped(T, 0.508, 1e-3, 0.1), 5e-4, 1)
    options = IdentifyOptions(kind="linear", from_s=5.0, to_s=15.0)
    result = identify_record(T, y, options)
    assert result.window_s == (pytest.approx(5.0), pytest.approx(15.0))


def test_a_long_record_is_thinned_without_loss() -> None:
    t = np.arange(60_000) / 1000
    noise = 5e-3
    truth = (0.7, 0.002, 0.1, 0.3)
    mode = only(identify_record(t, noisy(damped(t, *truth), noise, 1), LINEAR))
    bound = bounds(t, truth, noise)
    assert mode.sigma_noise_frequency_hz < 1.15 * bound[0]
    assert abs(mode.frequency_hz - 0.7) < 4 * bound[0]
    assert mode.amplitude == pytest.approx(0.1, rel=5e-3)


def test_a_mode_of_hundreds_of_hertz_has_no_ceiling_and_ends_where_it_has_faded() -> None:
    t = np.arange(40_000) / 10_000
    y = noisy(damped(t, 320.0, 0.004, 1.0), 5e-3, 1)
    result = identify_record(t, y, IdentifyOptions(unit="g"))
    assert result.kind == "linear"
    assert result.window_s is not None
    assert result.window_s[1] < 2.0
    assert is_right(only(result), 320.0, 0.004)


def test_few_samples_in_a_period_are_enough() -> None:
    t = np.arange(0, 24, 0.6)
    assert is_right(
        only(identify_record(t, noisy(damped(t, 0.508, 0.005, 0.1), 5e-4, 1), LINEAR)), 0.508, 0.005
    )


def test_a_computed_record_without_noise_is_good() -> None:
    result = identify_record(T, damped(T, 0.508, 0.005, 0.1), LINEAR)
    assert result.verdict == "good"
    assert only(result).frequency_hz == pytest.approx(0.508, rel=1e-9)


def test_the_second_opinion_agrees_and_is_independent() -> None:
    result = identify_record(T, noisy(pendulum(T, 0.1, 0.5, 0.005), 5e-4, 1))
    opinion = result.second_opinion
    assert opinion is not None
    assert opinion.frequency_hz == pytest.approx(0.5, abs=2e-4)
    assert opinion.damping_ratio == pytest.approx(0.005, rel=0.1)
    assert opinion.frequency_difference_hz == opinion.frequency_hz - result.modes[0].frequency_hz
    assert opinion.decrement_damping_ratio == pytest.approx(0.005, rel=0.1)
    assert opinion.decrement_periods >= 8
    assert abs(opinion.hann_peak_hz - 0.5) <= opinion.fft_bin_hz
    assert abs(opinion.hamming_peak_hz - 0.5) <= opinion.fft_bin_hz


def test_the_traces_hold_the_fit_and_what_it_left() -> None:
    traces = identify_record(T, noisy(damped(T, 0.508, 0.005, 0.1), 5e-4, 1), LINEAR).traces
    np.testing.assert_allclose(traces.fitted + traces.residual, traces.values)
    assert np.std(traces.residual) == pytest.approx(5e-4, rel=0.1)
    assert traces.spectrum_hz.shape == traces.residual_amplitude.shape
    near = np.abs(traces.stabilisation_hz - 0.508) < 0.005
    assert len(set(traces.stabilisation_order[near])) >= 8


@pytest.mark.parametrize(
    "bad", [{"kind": "spring"}, {"modes": 5}, {"modes": 0}, {"average_frames": 0}]
)
def test_options_out_of_bounds_raise(bad: dict[str, object]) -> None:
    with pytest.raises(AnalysisError, match="must be"):
        IdentifyOptions(**bad)  # type: ignore[arg-type]
