"""Sampled blocks against the simulation of python-control and closed forms.

Loops against textbook figures.
"""

from __future__ import annotations

import math

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.drives.servo import loops
from rig.drives.servo.block import Block, discretise
from rig.drives.servo.errors import BeyondNyquist, Improper, ServoError


def lag(time_s: float) -> control.TransferFunction:
    return control.tf([1.0], [time_s, 1.0])


@pytest.mark.parametrize("method", ["bilinear", "zoh"])
def test_a_block_steps_as_python_control_simulates(method):
    sampled = discretise(control.tf([1.0, 50.0], [1.0, 30.0, 4e4]), 1e-3, method=method)
    inputs = np.random.default_rng(1).normal(size=400)
    block = Block(sampled)
    simulated = control.forced_response(sampled, inputs=inputs).outputs
    assert [block.step(u) for u in inputs.tolist()] == pytest.approx(simulated, abs=1e-12)


def test_a_block_begins_anew_after_a_reset():
    block = Block(discretise(lag(0.01), 1e-3))
    first = [block.step(1.0) for _ in range(5)]
    block.reset()
    assert [block.step(1.0) for _ in range(5)] == first


@given(st.floats(1e-3, 1.0), st.integers(1, 50))
def test_a_held_input_is_followed_exactly_by_a_lag_sampled_with_zero_order_hold(time_s, n):
    block = Block(discretise(lag(time_s), 1e-3, method="zoh"))
    values = [block.step(1.0) for _ in range(n + 1)]
    assert values[n] == pytest.approx(1.0 - math.exp(-n * 1e-3 / time_s), abs=1e-12)


@given(st.floats(1.0, 3000.0))
def test_a_bilinear_block_is_exact_at_its_prewarp_frequency(omega):
    filtered = lag(0.004)
    sampled = discretise(filtered, 1e-3, prewarp_rad_s=omega)
    assert sampled(np.exp(1j * omega * 1e-3)) == pytest.approx(filtered(1j * omega), rel=1e-9)


def test_a_prewarp_frequency_beyond_nyquist_is_refused():
    with pytest.raises(
        BeyondNyquist,
        match=r"prewarp_rad_s = 4000 rad/s with a sample time of 0.001 s; must be < 3141.59",
    ):
        discretise(lag(0.01), 1e-3, prewarp_rad_s=4000.0)


def test_more_zeros_than_poles_are_refused():
    with pytest.raises(Improper, match="a block with 1 zeros and 0 poles"):
        discretise(control.tf([1.0, 0.0], [1.0]), 1e-3)


@pytest.mark.parametrize("period_s", [0.0, -1.0, math.nan, 100.0])
def test_a_sample_time_that_no_drive_has_is_refused(period_s):
    with pytest.raises(
        ServoError, match=r"period_s = .*; must be 1e-07 to 10: give the sample time of the drive"
    ):
        discretise(lag(0.01), period_s)


def test_a_continuous_system_is_no_block():
    with pytest.raises(
        ServoError, match="must have one output and be sampled: call discretise first"
    ):
        Block(control.ss(lag(0.01)))


def test_modes_are_one_of_each_pair_slowest_first_and_an_unstable_one_has_negative_damping():
    poles = np.array([-3.0 + 4.0j, -3.0 - 4.0j, -1.0, 0.0, 2.0])
    assert loops.pole_pairs(poles) == (
        (0.0, 1.0),
        (1.0, 1.0),
        (2.0, -1.0),
        pytest.approx((5.0, 0.6)),
    )
    assert loops.oscillatory_pairs(poles) == (pytest.approx((5.0, 0.6)),)


def test_sampled_poles_are_given_as_their_continuous_equivalents():
    system = control.ss(control.tf([1.0], [1.0, 20.0, 1e4]))
    sampled = discretise(system, 1e-3, method="zoh")
    assert np.sort_complex(loops.poles(sampled)) == pytest.approx(
        np.sort_complex(system.poles()), rel=1e-9
    )


def test_margins_of_an_integrator_with_a_lag_are_the_textbook_s():
    """L = 1 / (s (1 + s)).

    Crossover sqrt((sqrt 5 - 1) / 2), phase margin 90 deg - atan of it.
    """
    crossover = math.sqrt((math.sqrt(5.0) - 1.0) / 2.0)
    found = loops.margins(control.tf([1.0], [1.0, 1.0, 0.0]))
    assert found[:4] == pytest.approx(
        (math.inf, 0.0, 90.0 - math.degrees(math.atan(crossover)), crossover), rel=1e-6
    )


def test_a_third_lag_bounds_the_gain():
    """L = k / (1 + s)^3 reaches -180 deg at sqrt 3, where |L| = k / 8."""
    system, omega = control.tf([2.0], [1.0, 3.0, 3.0, 1.0]), np.geomspace(0.1, 10.0, 20_001)
    found = loops.margins(system)
    assert (found.upper_gain_margin, found.lower_gain_margin) == pytest.approx((4.0, 0.0), rel=1e-6)
    assert found.peak_sensitivity == pytest.approx(
        np.max(1.0 / np.abs(1.0 + system(1j * omega))), rel=1e-6
    )


def test_a_loop_that_needs_gain_to_be_stable_has_a_lower_gain_margin():
    """L = k (s + 1)^2 / s^3 closes to s^3 + k s^2 + 2 k s + k, stable for k > 1 / 2 (Routh)."""
    found = loops.margins(control.tf([2.0, 4.0, 2.0], [1.0, 0.0, 0.0, 0.0]))
    assert (found.upper_gain_margin, found.lower_gain_margin) == pytest.approx(
        (math.inf, 0.25), rel=1e-6
    )


@pytest.mark.parametrize("pole", [1.0, 0.5, 0.0, -0.6])
def test_a_sampled_lag_at_its_gain_margin_has_a_pole_at_the_nyquist_frequency(pole):
    """k / (z - p) closes at z = p - k, which is -1 at k = 1 + p."""
    found = loops.margins(control.tf([0.1], [1.0, -pole], 1e-3))
    assert found.upper_gain_margin == pytest.approx((1.0 + pole) / 0.1, rel=1e-9)
    near = np.exp(1j * np.linspace(1e-3, math.pi, 20_001))
    assert found.peak_sensitivity == pytest.approx(
        np.max(1.0 / np.abs(1.0 + 0.1 / (near - pole))), rel=1e-6
    )


def test_a_sampled_loop_with_a_pole_at_the_nyquist_frequency_is_refused():
    with pytest.raises(ServoError, match="a pole at z = -1; must have none"):
        loops.margins(control.tf([0.1], [1.0, 1.0], 1e-3))


def test_a_static_loop_has_the_sensitivity_of_its_gain():
    assert loops.margins(control.tf([3.0], [1.0])).peak_sensitivity == pytest.approx(0.25)
    assert loops.margins(control.ss([], [], [], [[-0.5]], 1e-3)).upper_gain_margin == pytest.approx(
        2.0
    )


def test_an_unstable_loop_is_reported():
    opened = control.tf([25.0], [1.0, -2.0, 0.0])
    assert not loops.analyse_loop(opened, control.feedback(opened)).stable
    assert loops.analyse_loop(
        control.tf([25.0], [1.0, 2.0, 0.0]), control.feedback(control.tf([25.0], [1.0, 2.0, 0.0]))
    ).stable


def test_the_analysis_of_a_loop_is_that_of_its_closed_form():
    """k / (s (s + 2)) closed: s^2 + 2 s + k."""
    opened = control.tf([25.0], [1.0, 2.0, 0.0])
    found = loops.analyse_loop(opened, control.feedback(opened))
    assert found.pole_pairs == (pytest.approx((5.0, 0.2)),)
    assert found.zeros_1_s.size == 0
    assert found.eigenvector_condition > 1.0


def test_orthogonal_eigenvectors_have_condition_one_and_equal_ones_none():
    apart = control.ss(np.diag([-1.0, -2.0, -3.0]), np.ones((3, 1)), np.ones((1, 3)), 0.0)
    jordan = control.ss(np.array([[-1.0, 1.0], [0.0, -1.0]]), np.ones((2, 1)), np.ones((1, 2)), 0.0)
    assert loops.eigenvector_condition(apart) == pytest.approx(1.0)
    assert loops.eigenvector_condition(jordan) > 1e7


def test_the_condition_of_eigenvectors_does_not_depend_on_the_units_of_the_states():
    a, units = np.array([[0.0, 1.0], [-1e4, -20.0]]), np.diag([1.0, 1e5])
    scaled = units @ a @ np.linalg.inv(units)
    systems = [control.ss(m, np.ones((2, 1)), np.ones((1, 2)), 0.0) for m in (a, scaled)]
    assert loops.eigenvector_condition(systems[0]) == pytest.approx(
        loops.eigenvector_condition(systems[1]), rel=0.3
    )  # scaled by powers of two
    assert loops.eigenvector_condition(systems[0]) < 2.0
