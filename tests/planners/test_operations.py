"""Operations on motions: identities, inverses and the chain rule."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.errors import PlanError
from planners.laws import LAWS
from planners.laws.catalogue import coefficients, minimum_time_s
from planners.laws.elliptic import elliptic
from planners.laws.harmonic import harmonic
from planners.laws.polynomial import between, quintic
from planners.laws.rect_cascade import RectCascade
from planners.splines.cubic import clamped
from planners.trajectories.operations import (
    composed,
    normalised,
    reversed_in_time,
    stretched,
    translated,
    within_limits,
)
from planners.trajectories.pieces import ExpPolynomial, ModalTerm, Smooth, polynomial
from planners.trajectories.trajectory import Trajectory

DAMPED = Trajectory(
    (
        ExpPolynomial(
            1.7,
            (0.3, -0.2, 0.05),
            (ModalTerm(-0.4 + 9.0j, (0.2 - 0.1j, 0.05j)), ModalTerm(1.3 + 0j, (0.02 + 0j,))),
        ),
    )
)
CHAIN = RectCascade(0.8, (1.0, 0.5, 0.2)).trajectory().shifted(-0.3)
MOTIONS = {
    "damped": DAMPED,
    "chain": CHAIN,
    "smooth": elliptic(1.4).scaled(-2.0),
    "harmonic": harmonic(2.0),
}
every_motion = pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
every_law = pytest.mark.parametrize("name", LAWS)
POWER = Trajectory((polynomial(2.0, (0.0, 0.3, 0.1, 0.05)),))  # a time scaling


def inside(motion, n=25):
    """Compute times that are not at a joint."""
    t = np.linspace(0.0, motion.duration_s, n)
    return t[np.abs(t[:, None] - motion.breaks_s).min(axis=1) > 1e-6]


@every_motion
@pytest.mark.parametrize("order", range(5))
def test_the_three_reflections_have_the_stated_derivatives(motion, order):
    t, end = inside(motion), motion.duration_s
    back = reversed_in_time(motion)
    truth = (-1.0) ** order * motion.at(end - t, order)
    scale = np.abs(truth).max() + 1.0
    np.testing.assert_allclose(back.at(t, order), truth, atol=1e-11 * scale)
    np.testing.assert_allclose(back.scaled(-1.0).at(t, order), -truth, atol=1e-11 * scale)
    np.testing.assert_allclose(
        motion.scaled(-1.0).at(t, order), -motion.at(t, order), atol=1e-12 * scale
    )


@every_motion
def test_two_reversals_give_the_motion_itself(motion):
    t = inside(motion)
    np.testing.assert_allclose(
        reversed_in_time(reversed_in_time(motion)).at(t), motion.at(t), atol=1e-12
    )


@every_motion
def test_reflections_keep_peaks_and_mean_squares(motion):
    back = reversed_in_time(motion)
    for order in range(4):
        assert back.rms(order) == pytest.approx(motion.rms(order), rel=1e-10)
        assert back.peak(order).value == pytest.approx(motion.peak(order).value, rel=1e-10)


@every_law
def test_a_law_reversed_in_time_and_sign_is_itself_shifted_by_one(name):
    law = LAWS[name](1.0)
    t = np.linspace(0.0, 1.0, 23)
    np.testing.assert_allclose(
        reversed_in_time(law).scaled(-1.0).shifted(1.0).at(t), law.at(t), atol=1e-12
    )


@every_motion
@pytest.mark.parametrize("factor", [0.1, 3.0])
def test_stretching_divides_each_derivative_by_a_power(motion, factor):
    slow, t = stretched(motion, factor), inside(motion)
    assert slow.duration_s == pytest.approx(factor * motion.duration_s)
    for order in range(4):
        np.testing.assert_allclose(
            slow.at(factor * t, order) * factor**order, motion.at(t, order), rtol=1e-10, atol=1e-10
        )
        assert slow.rms(order) == pytest.approx(motion.rms(order) / factor**order, rel=1e-10)


@every_law
def test_a_stretched_law_is_the_law_of_that_duration(name):
    t = np.linspace(0.0, 2.6, 27)
    np.testing.assert_allclose(
        stretched(LAWS[name](1.3), 2.0).at(t), LAWS[name](2.6).at(t), atol=1e-12
    )


@every_motion
def test_translation_moves_and_delays(motion):
    moved, t = translated(motion, 1.5, delay_s=0.4), inside(motion)
    np.testing.assert_allclose(moved.at(t + 0.4), motion.at(t) + 1.5, atol=1e-12)
    np.testing.assert_allclose(moved.at([0.0, 0.2, 0.4]), float(motion.at(0.0)) + 1.5, atol=1e-12)
    assert translated(motion, 1.5).duration_s == motion.duration_s


@every_law
@settings(max_examples=10)
@given(
    h=st.floats(-5, 5).filter(lambda h: abs(h) > 1e-3),
    q0=st.floats(-5, 5),
    duration_s=st.floats(0.1, 9),
)
def test_the_normal_form_of_a_scaled_law_is_the_law(name, h, q0, duration_s):
    move, t = LAWS[name](duration_s).scaled(h).shifted(q0), np.linspace(0.0, 1.0, 9)
    plain = normalised(move)
    assert plain.duration_s == pytest.approx(1.0)
    np.testing.assert_allclose(plain.at(t), LAWS[name](1.0).at(t), atol=1e-11)


@every_law
def test_within_limits_is_the_minimum_time_of_the_law(name):
    limits = {"speed_m_s": 0.5, "acceleration_m_s2": 0.6}
    fast = within_limits(LAWS[name](3.0).scaled(-0.8), **limits)
    assert fast.duration_s == pytest.approx(minimum_time_s(name, 0.8, **limits), rel=1e-12)
    assert max(fast.peak(1).value / 0.5, fast.peak(2).value / 0.6) == pytest.approx(1.0, rel=1e-12)


def test_within_limits_keeps_a_jerk_limit_of_a_smooth_law_and_leaves_rest_alone():
    fast = within_limits(quintic(1.0), jerk_m_s3=7.0)
    assert fast.peak(3).value == pytest.approx(7.0)
    assert fast.duration_s == pytest.approx((coefficients("quintic").cj / 7.0) ** (1 / 3))
    assert within_limits(Trajectory.hold(1.0, 2.0), speed_m_s=1.0).duration_s == 2.0


@pytest.mark.parametrize("name", ["quintic", "elliptic", "fifteen_segments", "modified_sine"])
@pytest.mark.parametrize("order", range(1, 5))
def test_each_derivative_of_a_composition_is_the_slope_of_the_one_before(name, order):
    sigma = POWER.scaled(1.0 / float(POWER.at(2.0)))
    move = composed(LAWS[name](1.0), sigma)
    t, h = inside(move, 41), 1e-5
    t = t[np.abs(t[:, None] - move.breaks_s).min(axis=1) > 2 * h]
    slope = (move.at(t + h, order - 1) - move.at(t - h, order - 1)) / (2 * h)
    np.testing.assert_allclose(move.at(t, order), slope, atol=2e-6 * np.abs(slope).max())


@every_motion
def test_a_composition_has_the_positions_of_the_scaled_times(motion):
    sigma = POWER.scaled(motion.duration_s / float(POWER.at(2.0)))
    move, t = composed(motion, sigma), np.linspace(0.0, 2.0, 33)
    np.testing.assert_allclose(move.at(t), motion.at(sigma.at(t)), atol=1e-12)
    assert move.extent(0) == pytest.approx(motion.extent(0), abs=1e-12)
    s1, s2, s3 = (sigma.at(inside(move), k) for k in (1, 2, 3))
    q1, q2, q3 = (motion.at(sigma.at(inside(move)), k) for k in (1, 2, 3))
    np.testing.assert_allclose(move.at(inside(move), 2), q2 * s1**2 + q1 * s2, atol=1e-9)
    np.testing.assert_allclose(
        move.at(inside(move), 3), q3 * s1**3 + 3 * q2 * s1 * s2 + q1 * s3, atol=1e-7
    )


@every_motion
def test_a_linear_time_scaling_is_a_stretch(motion):
    sigma = Trajectory((polynomial(2.0 * motion.duration_s, (0.0, 0.5)),))
    move, slow = composed(motion, sigma), stretched(motion, 2.0)
    for order in range(4):
        assert move.rms(order) == pytest.approx(slow.rms(order), rel=1e-9)
        assert move.peak(order).value == pytest.approx(slow.peak(order).value, rel=1e-9)


def test_a_time_scaling_at_rest_at_its_ends_turns_a_line_into_a_law():
    line = Trajectory((polynomial(1.0, (2.0, 3.0)),))
    sigma = LAWS["double_s"](2.5)
    move = composed(line, sigma)
    t = np.linspace(0.0, 2.5, 26)
    np.testing.assert_allclose(move.at(t), 2.0 + 3.0 * sigma.at(t), atol=1e-13)
    assert move.continuous(2)
    assert move.peak(2).value == pytest.approx(3.0 * sigma.peak(2).value)


def test_a_composition_can_be_shaped_scaled_and_composed_again():
    once = composed(quintic(1.0), LAWS["septic"](1.0))
    twice = composed(once, POWER.scaled(1.0 / float(POWER.at(2.0))))
    t = np.linspace(0.0, 2.0, 17)
    expected = quintic(1.0).at(LAWS["septic"](1.0).at(POWER.at(t) / float(POWER.at(2.0))))
    np.testing.assert_allclose(twice.at(t), expected, atol=1e-12)
    assert twice.rms(1) > 0.0


def lag(t, order):
    return 2.0 * t if order == 0 else np.full_like(t, 2.0 if order == 1 else 0.0)


BAD_TIME_SCALINGS = {
    "backwards": (
        between([0.0, -0.5], [1.0, 0.5], 1.0),
        "sigma is not increasing: lowest speed -0.5",
    ),
    "standing": (
        Trajectory(
            (
                polynomial(0.5, (0.0, 0.0, 2.0)),
                polynomial(0.5, (0.5,)),
                polynomial(0.5, (0.5, 0.0, 2.0)),
            )
        ),
        "smallest rise over a piece 0 s",
    ),
    "short": (
        quintic(1.0).scaled(0.9),
        r"sigma runs from 0\.0 to 0\.9\d* s; must run from 0 to 1\.0 s",
    ),
    "late": (quintic(1.0).shifted(0.1), r"sigma runs from 0\.1"),
    "kinked": (
        Trajectory((polynomial(0.5, (0.0, 0.5)), polynomial(0.5, (0.25, 1.5)))),
        "derivative 1 of sigma steps by 1",
    ),
    "jerked": (LAWS["triangular"](1.0), "derivative 2 of sigma steps by 8"),
}


@pytest.mark.parametrize(("sigma", "words"), BAD_TIME_SCALINGS.values(), ids=BAD_TIME_SCALINGS)
def test_an_invalid_time_scaling_is_refused(sigma, words):
    with pytest.raises(PlanError, match=words):
        composed(harmonic(1.0), sigma)


def test_a_composition_has_no_more_derivatives_than_its_smooth_time_scaling():
    move = composed(harmonic(1.0), Trajectory((Smooth(0.5, lag, 2),)))
    assert move.peak(2).value == pytest.approx(4.0 * math.pi**2 / 2)
    with pytest.raises(PlanError, match="derivative order 3 of a smooth piece; must be <= 2"):
        move.at(0.1, 3)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: stretched(harmonic(1.0), 0.0), r"factor = 0\.0; must be 1e-09 to 1e\+09"),
        (lambda: stretched(harmonic(1.0), 1e200), r"factor = 1e\+200; must be"),
        (lambda: translated(harmonic(1.0), 1e300), r"distance_m = 1e\+300; must be"),
        (lambda: translated(harmonic(1.0), delay_s=1e-300), "delay_s = 1e-300; must be"),
        (lambda: within_limits(harmonic(1.0), speed_m_s=1e-300), "speed_m_s = 1e-300; must be"),
        (lambda: stretched(harmonic(1.0), -1.0), "reverse with reversed_in_time"),
        (lambda: translated(harmonic(1.0), delay_s=-0.1), r"delay_s = -0\.1"),
        (lambda: translated(harmonic(1.0), math.inf), "distance_m = inf"),
        (lambda: normalised(Trajectory.hold(1.0, 1.0)), "must end elsewhere to be normalised"),
        (
            lambda: normalised(quintic(1.0).then(reversed_in_time(quintic(1.0)))),
            "must end elsewhere",
        ),
        (lambda: within_limits(harmonic(1.0)), "at least one must be finite"),
        (lambda: within_limits(harmonic(1.0), speed_m_s=-1.0), r"speed_m_s = -1\.0"),
        (lambda: within_limits(harmonic(1.0), jerk_m_s3=1.0), "a step in derivative 2"),
        (
            lambda: within_limits(
                Trajectory((polynomial(1.0, (0.0, 1.0)),)), acceleration_m_s2=1.0
            ),
            "a step in derivative 1",
        ),
    ],
)
def test_operations_refuse_bad_input_by_name(act, words):
    with pytest.raises(PlanError, match=words):
        act()


def test_a_long_path_with_a_long_time_scaling_has_the_derivatives_of_the_chain_rule():
    path = clamped(np.arange(50.0), np.random.default_rng(1).uniform(-1.0, 1.0, 50))
    sigma = quintic(75.0).scaled(49.0)
    move, t = composed(path, sigma), np.linspace(0.05, 74.95, 3001)
    place, speed = sigma.at(t), sigma.at(t, 1)
    bend = path.at(place, 2) * speed**2 + path.at(place, 1) * sigma.at(t, 2)
    assert np.allclose(move.at(t, 1), path.at(place, 1) * speed, rtol=0.0, atol=1e-10)
    assert np.allclose(move.at(t, 2), bend, rtol=0.0, atol=1e-9)
    assert move.peak(1).value >= np.abs(move.at(t, 1)).max() - 1e-12
    assert move.peak(1).value == pytest.approx(np.abs(move.at(t, 1)).max(), rel=1e-3)
