"""Several modes in one record."""

from __future__ import annotations

import numpy as np
import pytest

from rig.analysis.identify.identify import identify_record
from rig.analysis.identify.identify_options import IdentifyOptions
from rig.analysis.identify.matrix_pencil import pencil, poles
from rig.analysis.identify.sampled import sampled
from tests.rig.analysis.decays import damped, noisy

T = np.arange(0, 24, 0.02)
LINEAR = IdentifyOptions(kind="linear")
FIRST, SECOND = (0.61, 0.004, 0.05, 0.3), (1.47, 0.006, 0.03, 1.1)
BOUND_HZ = (1.13e-5, 3.09e-5)  # of 0.5 mrad of noise, reference of the issue
BOUND_DAMPING = (0.0046 * 0.004, 0.0035 * 0.006)


def test_two_modes_are_found_at_the_bound() -> None:
    errors = []
    for seed in range(25):
        y = noisy(damped(T, *FIRST) + damped(T, *SECOND), 5e-4, seed)
        result = identify_record(T, y, LINEAR)
        assert len(result.modes) == 2
        low, high = sorted(result.modes, key=lambda mode: mode.frequency_hz)
        errors.append(
            [
                (low.frequency_hz - 0.61) / low.sigma_noise_frequency_hz,
                (high.frequency_hz - 1.47) / high.sigma_noise_frequency_hz,
                (low.damping_ratio - 0.004) / low.sigma_noise_damping_ratio,
                (high.damping_ratio - 0.006) / high.sigma_noise_damping_ratio,
            ]
        )
        assert low.sigma_noise_damping_ratio < 6 * BOUND_DAMPING[0]
    assert np.all(np.sqrt(np.mean(np.square(errors), axis=0)) < 1.5)


def test_a_beat_of_two_modes_is_resolved_when_the_record_is_long_enough() -> None:
    t = np.arange(0, 120, 0.02)
    y = damped(t, 0.5, 1e-3, 0.1) + damped(t, 0.51, 1e-3, 0.03, 1.0)
    result = identify_record(t, noisy(y, 5e-4, 1), LINEAR)
    assert result.verdict == "good"
    strong, weak = result.modes
    assert abs(strong.frequency_hz - 0.5) < 4 * strong.sigma_frequency_hz < 1e-3
    assert abs(weak.frequency_hz - 0.51) < 4 * weak.sigma_frequency_hz < 2e-3


@pytest.mark.parametrize("share", [0.05, 0.3, 1.0])
def test_a_beat_that_the_record_does_not_show_whole_is_never_good(share: float) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        y = damped(T, 0.508, 2e-4, 0.1, rng.uniform(0, 6)) + damped(
            T, 0.518, 2e-4, 0.1 * share, rng.uniform(0, 6)
        )
        result = identify_record(T, noisy(y, 5e-4, seed), LINEAR)
        assert result.verdict != "good"


def test_one_mode_asked_for_leaves_the_second_in_the_residual_and_says_so() -> None:
    y = noisy(damped(T, *FIRST) + 0.3 * damped(T, *SECOND), 5e-4, 1)
    result = identify_record(T, y, IdentifyOptions(kind="linear", modes=1))
    assert len(result.modes) == 1
    assert {"residual", "second_peak"} <= {reason.code for reason in result.reasons}
    assert abs(result.modes[0].frequency_hz - 0.61) < 3 * result.modes[0].sigma_frequency_hz


def test_three_modes_are_ordered_by_their_energy() -> None:
    y = damped(T, 0.61, 4e-3, 0.05) + damped(T, 1.47, 3e-3, 0.03) + damped(T, 3.3, 2e-3, 0.01)
    result = identify_record(T, noisy(y, 2e-4, 1), LINEAR)
    assert [round(mode.frequency_hz, 2) for mode in result.modes] == [0.61, 1.47, 3.3]


def test_white_noise_adds_no_mode() -> None:
    for seed in range(15):
        y = noisy(damped(T, 0.508, 1e-3, 0.05), 2e-3, seed)
        result = identify_record(T, y, LINEAR)
        assert len(result.modes) == 1
        assert result.terms == ()


def test_the_matrix_pencil_gives_amplitude_and_phase_of_each_pole() -> None:
    y = damped(T, *FIRST) + damped(T, *SECOND) + 0.01
    found = poles(pencil(sampled(T, y, 1, 0.0), 24.0, 1.47), 5)
    assert [round(pole.frequency_hz, 3) for pole in found] == [0.61, 1.47]
    assert found[0].damping_ratio == pytest.approx(0.004, rel=0.05)
    assert found[0].amplitude == pytest.approx(0.05, rel=0.02)
    assert found[0].phase_rad == pytest.approx(0.3, abs=0.1)
