"""Feed-forward pair C1, C2 against a loop assembled block by block.

Its sampled form against scipy.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lsim

from rig.drives.servo.errors import Improper, ServoError
from rig.drives.servo.estimator import kalman
from rig.drives.servo.feed_forward import (
    LoadFilter,
    characteristic,
    dynamic_feed_forward,
    feed_forward_block,
    feed_forward_pair,
    min_relative_degree,
    nominal_system,
)
from rig.drives.servo.lqg import compensator
from rig.drives.servo.state_feedback import lq
from rig.drives.servo.two_mass import TwoMass

DATA = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_state_space.toml").read_text())
JOINTS = {name: TwoMass(**keys) for name, keys in DATA["joints"].items()}
JOINTS["undamped"] = replace(JOINTS["fitted"], elastic_damping_n_m_s_rad=0.0)
LISTED = JOINTS["listed"]
FREQUENCIES = np.geomspace(0.1, 1e3, 81)  # [rad/s]
joints = pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS)


def f0(joint):
    return LoadFilter.binomial(min_relative_degree(joint))


def response(joint, feedback, load_filter):
    """Compute the load angle over the setpoint (N,) of the whole loop.

    Solved at each frequency from the responses of the blocks.
    """
    c1, c2 = feed_forward_pair(joint, feedback, load_filter)
    drive = compensator(joint, feedback, kalman(joint))
    rows = []
    for s in 1j * FREQUENCIES:
        reference, back, forward = drive(s)[0]
        motor, load = joint.plant(s)[[0, 2], 0]
        torque = (reference * c1(s) + forward * c2(s)) / (1.0 - back * motor)
        rows.append(load * torque)
    return np.array(rows)


@joints
def test_the_load_follows_the_filter_whatever_observer_and_integral_do(joint):
    feedback = lq(joint, DATA["lq"]["weights"])
    wanted = 1.0 / (1.0 + 1j * FREQUENCIES / 150.0) ** min_relative_degree(joint)
    np.testing.assert_allclose(response(joint, feedback, f0(joint)), wanted, rtol=1e-12)


@joints
def test_interconnected_by_name_the_loop_is_the_filter_too(joint):
    feedback = lq(joint, DATA["lq"]["weights"])
    c1, c2 = feed_forward_pair(joint, feedback, f0(joint))
    loop = control.interconnect(
        [
            control.ss(c1, inputs=["setpoint"], outputs=["reference"], name="C1"),
            control.ss(c2, inputs=["setpoint"], outputs=["forward_torque"], name="C2"),
            compensator(joint, feedback, kalman(joint)),
            joint.plant,
        ],
        inplist=["setpoint"],
        outlist=["load_angle"],
        check_unused=False,
    )
    wanted = 1.0 / (1.0 + 1j * FREQUENCIES / 150.0) ** min_relative_degree(joint)
    np.testing.assert_allclose(np.squeeze(loop(1j * FREQUENCIES)), wanted, rtol=1e-12)


def test_any_filter_of_enough_poles_will_do():
    load_filter = LoadFilter((2e4, 4e6), (1.0, 290.0, 4.1e4, 3e6, 4e6))
    s = 1j * FREQUENCIES
    wanted = np.polyval(load_filter.numerator, s) / np.polyval(load_filter.denominator, s)
    np.testing.assert_allclose(
        response(LISTED, lq(LISTED, DATA["lq"]["weights"]), load_filter), wanted, rtol=1e-12
    )


@joints
def test_the_closed_loop_s_polynomial_is_that_of_its_state_matrix(joint):
    feedback = lq(joint, DATA["lq"]["weights"])
    ours = characteristic(joint, feedback)
    inertias = joint.motor_inertia_kg_m2 * joint.reflected_inertia_kg_m2
    a = joint.state_matrix + np.outer(joint.input_matrix[:, 0], feedback.gains)
    np.testing.assert_allclose(ours / inertias, np.poly(a), rtol=1e-9)


@joints
def test_the_pair_is_the_nominal_torque_less_what_feedback_makes_of_the_nominal_states(joint):
    feedback = lq(joint, DATA["lq"]["weights"])
    c1, c2 = feed_forward_pair(joint, feedback, f0(joint))
    s = 1j * FREQUENCIES
    nominal = nominal_system(joint, f0(joint))(s)[:, 0, :]
    np.testing.assert_allclose(nominal[0], c1(s), rtol=1e-9)
    np.testing.assert_allclose(
        nominal[4] - np.asarray(feedback.gains) @ nominal[:4], c2(s), rtol=1e-8
    )


@joints
def test_the_nominal_states_are_those_of_the_joint_under_the_nominal_torque(joint):
    for s in 1j * FREQUENCIES:
        nominal = nominal_system(joint, f0(joint))(s)[:, 0]
        np.testing.assert_allclose(joint.plant(s)[:, 0] * nominal[4], nominal[:4], rtol=1e-9)


def test_the_zero_that_is_cancelled_is_stable_in_every_joint():
    for joint in JOINTS.values():
        assert all(root < 0.0 for root in np.roots(joint.load_numerator))
    with pytest.raises(ServoError, match=r"elastic_damping_n_m_s_rad = -0\.001; must be"):
        replace(LISTED, elastic_damping_n_m_s_rad=-1e-3)
    assert np.roots(LISTED.load_numerator) == pytest.approx(
        [DATA["structure"]["zero_to_load"]], rel=1e-7
    )


@pytest.mark.parametrize(
    ("name", "degree", "least"), [("listed", 2, 3), ("fitted", 0, 3), ("undamped", 3, 4)]
)
def test_a_filter_with_too_few_poles_is_refused(name, degree, least):
    joint = JOINTS[name]
    for build in (
        nominal_system,
        lambda j, f: feed_forward_pair(j, lq(j, DATA["lq"]["weights"]), f),
        lambda j, f: dynamic_feed_forward(j, 1e-3, f),
    ):
        with pytest.raises(
            Improper,
            match=rf"relative degree of {degree}; must be >= {least} .*binomial\({least}\)",
        ):
            build(joint, LoadFilter.binomial(degree))


@joints
def test_the_sampled_block_gives_the_nominal_states_for_held_setpoints(joint):
    period = 1e-3
    ahead, state = dynamic_feed_forward(joint, period, f0(joint)), None
    fine = np.arange(0, 0.2, period / 20)
    steps = np.floor(fine / period + 1e-6)
    system = nominal_system(joint, f0(joint))
    setpoint = np.sin(steps * 0.03)
    _, wanted, _ = lsim((system.A, system.B, system.C, system.D), setpoint, fine, interp=False)
    state, size = np.zeros(len(ahead.a)), np.abs(wanted).max(axis=0)
    for k in range(200):
        u = np.array([math.sin(k * 0.03), 0.0, 0.0])
        nominal = ahead.c @ state + ahead.d @ u
        np.testing.assert_allclose(nominal[:4], wanted[20 * k, :4], atol=1e-9 * size[:4].max())
        assert nominal[5] == pytest.approx(nominal[0], rel=1e-12)
        state = ahead.a @ state + ahead.b @ u


def test_the_sampled_torque_is_its_mean_until_the_next_sample():
    period, rate = 1e-3, 300.0
    ahead, system = (
        dynamic_feed_forward(LISTED, period, f0(LISTED)),
        nominal_system(LISTED, f0(LISTED)),
    )
    u = np.array([0.2, 3.0, -40.0])
    fine = np.linspace(0.0, period, 2001)
    setpoint = u[0] + u[1] * fine + u[2] * fine**2 / 2.0
    start = np.array(
        np.linalg.solve(rate * np.eye(4) - system.A, system.B[:, 0])
    )  # any state will do
    _, y, _ = lsim((system.A, system.B, system.C, system.D), setpoint, fine, X0=start)
    mean = np.trapezoid(y[:, 4], fine) / period
    assert (ahead.c @ start + ahead.d @ u)[4] == pytest.approx(mean, rel=1e-6)


def test_the_rigid_feed_forward_compensates_inertia_and_friction():
    joint, u = JOINTS["fitted"], np.array([2.0, 30.0, -500.0])
    nominal = feed_forward_block("rigid", joint, 1e-3).d @ u
    inertia, friction = 1.5e-4 + 2.8736758e-4, 0.0034839632 + 4.9173636e-4
    np.testing.assert_allclose(
        nominal, [2.0, 30.0, 2.0, 30.0, friction * 30.0 - inertia * 500.0, 2.0], rtol=1e-12
    )


def test_without_feed_forward_only_the_integral_receives_the_setpoint():
    assert feed_forward_block("none", LISTED, 1e-3).d @ [2.0, 30.0, -500.0] == pytest.approx(
        [0.0, 0.0, 0.0, 0.0, 0.0, 2.0]
    )


def test_an_unknown_feed_forward_is_named_with_the_nearest():
    with pytest.raises(
        ServoError,
        match=r"feed_forward = 'rigit'; did you mean 'rigid'\? must be one of dynamic, none, rigid",
    ):
        feed_forward_block("rigit", LISTED, 1e-3)


@settings(max_examples=40)
@given(st.integers(0, 12), st.floats(1e-2, 1e4))
def test_a_binomial_filter_is_one_at_rest_and_falls_by_its_degree_at_its_corner(degree, corner):
    load_filter = LoadFilter.binomial(degree, corner)
    at = np.polyval(load_filter.numerator, 1j * corner) / np.polyval(
        load_filter.denominator, 1j * corner
    )
    assert abs(at) == pytest.approx(2.0 ** (-degree / 2), rel=1e-6)
    assert load_filter.relative_degree == degree


@pytest.mark.parametrize(
    ("numerator", "denominator", "match"),
    [
        ((1.0,), (1.0, -2.0, 1.0), "real part"),
        ((1.0,), (1.0, 0.0, 1.0), "real part"),
        ((2.0,), (1.0, 1.0), "F0 = 2 at rest"),
        ((1.0, 1.0, 1.0), (1.0, 1.0), "add poles"),
        ((), (1.0, 1.0), "finite"),
        ((1.0,), (0.0, 1.0), "first denominator coefficient not 0"),
        ((1.0,), (math.nan, 1.0), "finite"),
    ],
)
def test_filters_that_would_not_reach_the_goal_are_refused(numerator, denominator, match):
    with pytest.raises(ServoError, match=match):
        LoadFilter(numerator, denominator)


@pytest.mark.parametrize(
    ("degree", "corner"), [(-1, 150.0), (13, 150.0), (3, 0.0), (3, -5.0), (3, math.nan)]
)
def test_binomials_out_of_bounds_are_refused(degree, corner):
    with pytest.raises(ServoError, match="must be"):
        LoadFilter.binomial(degree, corner)
