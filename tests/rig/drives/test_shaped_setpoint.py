"""Shaped setpoints against independent computations.

An oscillator integrated by the test, the exact shaped trajectory, and printed figures.
"""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from planners.errors import PlanError
from planners.laws import LAWS
from planners.shapers import SHAPERS, Shaper, residual, transform
from planners.shapers.plan_shaped import shape
from rig.drives.servo.errors import BeyondNyquist, ServoError
from rig.drives.servo.loops import PolePair, oscillatory_pairs
from rig.drives.servo.setpoint import MotorSetpoint
from rig.drives.servo.shaped_setpoint import (
    ShapedSetpoint,
    analyse_shaper,
    design_shaper,
    eigenvalue_1_s,
    place_on_samples,
)
from rig.drives.servo.two_mass import TwoMass

DATA = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_shaping.toml").read_text())
POSITIVE = ("zv", "zvd", "zvdd", "zvddd", "ei", "ei_two_hump", "ei_three_hump")
EXACT = ("zv", "zvd", "zvdd", "zvddd", "mzv", "ei_two_hump", "um_zv")  # V = 0 at the mode
names = st.sampled_from(sorted(SHAPERS))
modes = st.builds(PolePair, st.floats(0.5, 500.0), st.floats(0.0, 0.24))
turns = st.floats(0.003, 1.0)  # of the mode a sample [rad]


def swing_after(setpoints_rad, mode, period_s):
    """Compute the amplitude of w^2 / (s^2 + 2 zeta w s + w^2) about its held input.

    Exact, from the matrix exponential.
    """
    w, d = mode
    whole = expm(
        np.array([[0.0, 1.0, 0.0], [-w * w, -2 * d * w, w * w], [0.0, 0.0, 0.0]]) * period_s
    )
    x = np.zeros(2)
    for u in setpoints_rad:
        x = whole[:2, :2] @ x + whole[:2, 2] * u
    off = x[0] - setpoints_rad[-1]
    return abs(complex(off * w, (x[1] + d * w * off) / math.sqrt(1 - d * d))) / w


def step_through(shaper, period_s):
    """Shape a unit step, until the last impulse has passed."""
    shaped = ShapedSetpoint(shaper, period_s)
    return [
        shaped.step(MotorSetpoint(1.0)).angle_rad
        for _ in range(round(shaper.times_s[-1] / period_s) + 1)
    ]


def in_proportion(shaper, period_s):
    """Split each impulse in proportion to the distances of its two samples.

    The simple method that place_on_samples replaces.
    """
    samples = shaper.times_s / period_s
    before = np.floor(samples)
    late = samples - before
    times = np.concatenate([before, before + 1]) * period_s
    return Shaper(np.concatenate([shaper.amplitudes * (1 - late), shaper.amplitudes * late]), times)


# impulses on samples


@settings(max_examples=150)
@given(names, modes, turns)
def test_impulses_on_samples_sum_to_1_keep_their_signs_and_leave_no_more_of_the_mode(
    name, mode, turn
):
    rate = eigenvalue_1_s(mode)
    period_s = turn / abs(rate)
    exact, sampled = SHAPERS[name](rate), design_shaper(name, [mode], period_s)
    assert math.isclose(sampled.amplitudes.sum(), 1.0, rel_tol=1e-12)
    assert len(exact.times_s) <= len(sampled.times_s) <= 2 * len(exact.times_s)
    assert exact.times_s[-1] <= sampled.times_s[-1] + 1e-9 * period_s
    assert sampled.times_s[-1] <= exact.times_s[-1] + period_s * (1 + 1e-9)
    np.testing.assert_allclose(
        sampled.times_s / period_s, np.rint(sampled.times_s / period_s), atol=1e-9
    )
    grown = abs(transform(sampled, rate)) - abs(transform(exact, rate)) * (1 + turn**2 / 4)
    assert grown < 1e-9
    if name in EXACT:
        assert residual(sampled, rate) < 1e-11
    if name in POSITIVE:
        assert np.all(sampled.amplitudes > 0)


@pytest.mark.parametrize("name", ["zv", "zvd", "zvdd"])
@pytest.mark.parametrize("turn", [0.02, 0.1, 0.3])
def test_a_split_in_proportion_leaves_up_to_an_eighth_of_the_turn_squared_and_ours_nothing(
    name, turn
):
    mode = PolePair(1.0, 0.05)
    exact, worst, ours = SHAPERS[name](eigenvalue_1_s(mode)), 0.0, 0.0
    for part in np.linspace(0.98, 1.02, 41):  # impulses fall elsewhere between the samples
        rate, period_s = eigenvalue_1_s(mode), turn * part
        worst = max(worst, float(residual(in_proportion(exact, period_s), rate)))
        ours = max(ours, float(residual(place_on_samples(exact, mode, period_s), rate)))
    assert 0.2 * turn**2 / 8 < worst < 1.1 * turn**2 / 8
    assert ours < 1e-14


@pytest.mark.parametrize("name", ["zv", "zvd", "zvdd"])
def test_off_the_mode_the_sampled_shaper_forgives_as_much(name):
    mode = PolePair(1.0, 0.05)
    exact, sampled = (
        analyse_shaper(SHAPERS[name](eigenvalue_1_s(mode)), mode),
        analyse_shaper(design_shaper(name, [mode], 0.1), mode),
    )
    assert sampled.residual < 1e-14
    assert sampled.insensitivity == pytest.approx(exact.insensitivity, rel=4e-3)
    assert 0.0 <= sampled.duration_s - exact.duration_s < 0.1


def test_an_impulse_that_falls_on_a_sample_stays_whole():
    sampled = design_shaper(
        "zvd", [PolePair(2.0 * math.pi, 0.0)], 0.125
    )  # half a period is four samples
    np.testing.assert_allclose(sampled.amplitudes, [0.25, 0.5, 0.25], rtol=1e-12)
    np.testing.assert_allclose(sampled.times_s, [0.0, 0.5, 1.0], rtol=1e-12)


# the delay line


@settings(max_examples=40)
@given(names, modes, turns)
def test_a_shaped_step_leaves_an_oscillator_of_the_mode_what_the_facts_say(name, mode, turn):
    period_s = turn / mode.frequency_rad_s
    sampled = design_shaper(name, [mode], period_s)
    left = swing_after(step_through(sampled, period_s), mode, period_s)
    bare = swing_after([1.0], mode, period_s)  # both a sample after the last impulse
    assert left / bare == pytest.approx(analyse_shaper(sampled, mode).residual, rel=1e-9, abs=1e-11)


@pytest.mark.parametrize("name", ["zv", "zvd", "zvdd"])
def test_a_shaped_step_leaves_the_figures_of_the_table_on_a_joint_that_is_another(name):
    known = next(
        row for row in DATA["robustness"] if row["shaper"] == name and row["damping"] == 0.05
    )
    period_s = 0.01
    setpoints = step_through(design_shaper(name, [PolePair(1.0, 0.05)], period_s), period_s)
    for (f, d), percent in zip(DATA["cases"], known["same_instant_pct"], strict=True):
        true = PolePair(f, 0.05 * d)
        share = swing_after(setpoints, true, period_s) / swing_after(
            [1.0] * len(setpoints), true, period_s
        )
        assert 100 * share == pytest.approx(
            percent, rel=2e-3
        )  # 10 ms samples; to all digits in the command's test


@pytest.mark.parametrize("name", ["zv", "ei", "um_zv"])
def test_what_comes_out_is_the_exact_shaped_trajectory_sampled(name):
    mode, period_s = PolePair(12.0, 0.03), 0.004
    sampled = design_shaper(name, [mode], period_s)
    law = LAWS["quintic"](0.6).scaled(70.0)
    whole = shape(law, sampled)
    t = period_s * np.arange(int(whole.duration_s / period_s) + 5)
    shaped = ShapedSetpoint(sampled, period_s)
    out = np.array(
        [shaped.step(MotorSetpoint(*(float(law.at(x, k)) for k in range(3)))) for x in t]
    )
    for order, scale in enumerate((70.0, 70.0 / 0.6, 70.0 / 0.36)):
        np.testing.assert_allclose(out[:, order], whole.at(t, order), atol=1e-11 * scale)
    ideal = shape(
        law, SHAPERS[name](eigenvalue_1_s(mode))
    )  # impulses between the samples: a little elsewhere, no more
    assert np.abs(out[:, 0] - ideal.at(t)).max() < 70.0 * (mode.frequency_rad_s * period_s) ** 2


def test_a_long_delay_comes_back_after_its_time_and_not_before():
    shaped = ShapedSetpoint(Shaper(np.array([0.25, 0.75]), np.array([0.0, 2.0])), 0.001)
    out = [shaped.step(MotorSetpoint(float(k == 3), k == 4, k == 5)) for k in range(4100)]
    assert {k: o for k, o in enumerate(out) if any(o)} == {
        3: (0.25, 0, 0), 4: (0, 0.25, 0), 5: (0, 0, 0.25),
        2003: (0.75, 0, 0), 2004: (0, 0.75, 0), 2005: (0, 0, 0.75),
    }  # fmt: skip


def test_reset_clears_the_past_setpoints():
    sampled = design_shaper("zvd", [PolePair(20.0, 0.05)], 0.01)
    shaped = ShapedSetpoint(sampled, 0.01)
    first = [shaped.step(MotorSetpoint(1.0, 2.0, 3.0)) for _ in range(7)]
    shaped.reset()
    assert [shaped.step(MotorSetpoint(1.0, 2.0, 3.0)) for _ in range(7)] == first
    assert first[-1].angle_rad < 1.0


def test_a_standing_setpoint_comes_through_whole():
    shaped = ShapedSetpoint(design_shaper("mzv", [PolePair(20.0, 0.05)], 0.01), 0.01)
    assert [shaped.step(MotorSetpoint(3.0)) for _ in range(60)][-1] == pytest.approx(
        (3.0, 0.0, 0.0), rel=1e-12
    )


# several modes


def test_two_modes_make_the_source_s_cascade_and_its_residuals():
    known = DATA["two_modes"]
    both = [PolePair(2 * math.pi * f, 0.0) for f in known["frequencies_hz"]]
    fine = design_shaper("zv", both, 1e-5)
    assert fine.times_s[-1] == pytest.approx(known["zv_times_s"][-1], abs=2.1e-5)
    at = np.searchsorted(known["zv_times_s"], fine.times_s + 5e-5) - 1
    sums = [fine.amplitudes[at == k].sum() for k in range(4)]
    np.testing.assert_allclose(sums, known["zv_amplitudes"], rtol=1e-6)
    assert design_shaper("zvd", both, 1e-5).times_s[-1] == pytest.approx(
        known["zvd_duration_s"], abs=2.1e-5
    )
    for k, figures in enumerate((known["zv_first_off_10_pct"], known["zv_second_off_10_pct"])):
        left = 100 * residual(fine, np.array([1.1j, 0.9j]) * both[k].frequency_rad_s)
        np.testing.assert_allclose(left, figures, rtol=1e-4)


def test_every_mode_of_a_cascade_is_left_at_rest_on_coarse_samples_too():
    both, period_s = [PolePair(30.0, 0.02), PolePair(110.0, 0.1)], 0.006
    setpoints = step_through(design_shaper("zvd", both, period_s), period_s)
    assert all(swing_after(setpoints, mode, period_s) < 1e-13 for mode in both)


def test_it_does_not_matter_whether_setpoints_are_held_or_joined_by_lines():
    mode, period_s = PolePair(30.0, 0.02), 0.02
    setpoints = [0.0, *step_through(design_shaper("zv", [mode], period_s), period_s)]
    quarters = np.arange(4 * len(setpoints) - 3) / 4
    joined = np.interp(quarters, np.arange(len(setpoints)), setpoints)
    assert swing_after(setpoints, mode, period_s) < 1e-14
    assert swing_after(joined, mode, period_s / 4) < 1e-14
    bare = np.interp(quarters, np.arange(len(setpoints)), [0.0] + [1.0] * (len(setpoints) - 1))
    assert swing_after(bare, mode, period_s / 4) > 0.5


def test_the_modes_of_a_joint_are_taken_as_they_come():
    joint = TwoMass(
        motor_inertia_kg_m2=1.5e-4,
        load_inertia_kg_m2=2.7,
        stiffness_n_m_rad=3.1,
        gear_ratio=100.0,
        motor_friction_n_m_s_rad=3.4e-3,
        elastic_damping_n_m_s_rad=2.2e-3,
    )
    sampled = design_shaper("zvd", oscillatory_pairs(joint.poles_1_s), 0.001)
    pair = next(p for p in joint.poles_1_s if p.imag > 0)
    assert residual(sampled, pair) < 1e-13
    assert sampled.times_s[-1] == pytest.approx(2 * math.pi / pair.imag, abs=0.001)


# refusals


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: design_shaper("zvvd", [PolePair(1.0, 0.05)], 0.01),
            PlanError,
            "shaper = 'zvvd'; did you mean 'zvd'",
        ),
        (
            lambda: design_shaper("zv", [PolePair(1.0, 1.0)], 0.01),
            ServoError,
            r"damping = 1\.0; must be 0 to 0\.99",
        ),
        (
            lambda: design_shaper("zv", [PolePair(1.0, -0.1)], 0.01),
            ServoError,
            r"damping = -0\.1; must be 0 to 0\.99",
        ),
        (
            lambda: design_shaper("zv", [PolePair(math.nan, 0.1)], 0.01),
            ServoError,
            "frequency_rad_s = nan; must be",
        ),
        (
            lambda: design_shaper("ei", [PolePair(1.0, 0.6)], 0.01),
            PlanError,
            "for shaper ei; must be <= 0.5: take zvd or mzv",
        ),
        (
            lambda: design_shaper("zv", [], 0.01),
            ServoError,
            r"modes of shaper zv = \(\); must be one or more",
        ),
        (
            lambda: design_shaper("zv", [PolePair(4000.0, 0.05)], 0.001),
            BeyondNyquist,
            "shaper's mode = 3995 rad/s .*: reduce the sample time",
        ),
        (
            lambda: design_shaper("um_zv", [PolePair(1.0, 0.0)], 2.5),
            BeyondNyquist,
            r"impulses of both signs .* must be > 0\.5: reduce the sample time",
        ),
        (
            lambda: design_shaper("zv", [PolePair(1e-3, 0.05)], 1e-4),
            ServoError,
            "samples of delay = 31455270.*; must be 0 to 1e",
        ),
        (
            lambda: design_shaper("zv", [PolePair(1.0, 0.05)], 0.0),
            ServoError,
            "period_s = 0.0; must be 1e-07 to 10",
        ),
        (
            lambda: ShapedSetpoint(SHAPERS["zv"](1j), 0.1),
            ServoError,
            r"impulse 1 is 31\.415927 samples of 0\.1 s; must be a whole number: "
            "design the shaper for this sample time",
        ),
        (lambda: ShapedSetpoint(SHAPERS["zv"](1j), -1.0), ServoError, "period_s = -1.0"),
    ],
)
def test_invalid_shaper_input_is_refused_with_its_bound_and_the_next_step(call, error, words):
    with pytest.raises(error, match=words):
        call()
