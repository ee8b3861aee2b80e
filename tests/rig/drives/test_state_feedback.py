"""Gains against the reference data, other routines and the polynomials to be assigned."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm, solve_continuous_are, solve_continuous_lyapunov
from scipy.signal import place_poles

from rig.drives.servo import riccati
from rig.drives.servo.controllability import (
    check_controllable,
    check_observable,
    mode_controllability,
)
from rig.drives.servo.errors import (
    BeyondNyquist,
    NotControllable,
    NotObservable,
    PolesNotAssignable,
    ServoError,
)
from rig.drives.servo.state_feedback import (
    Feedback,
    assign,
    augmented,
    augmented_units,
    lq,
    sampled_joint,
)
from rig.drives.servo.two_mass import TwoMass

DATA = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_state_space.toml").read_text())
JOINTS = {name: TwoMass(**keys) for name, keys in DATA["joints"].items()}
LISTED = JOINTS["listed"]
POLES = np.array(DATA["assigned"]["poles_re"]) + 1j * np.array(DATA["assigned"]["poles_im"])
WEIGHTS = DATA["lq"]["weights"]
SOFT = TwoMass(motor_inertia_kg_m2=1.5e-4, load_inertia_kg_m2=2.7e-4, stiffness_n_m_rad=1e-12)
pairs = st.tuples(st.floats(-2.0, -0.2), st.floats(0.05, 2.0))  # of a pole over the antiresonance


def closed(joint, feedback):
    f, g = augmented(joint)
    return f + np.outer(g, feedback.row)


def test_the_reference_s_poles_need_the_reference_s_gains():
    np.testing.assert_allclose(assign(LISTED, POLES).row, DATA["assigned"]["gains"], rtol=1e-7)


def test_the_reference_s_weights_give_the_reference_s_gains_and_poles():
    feedback = lq(LISTED, WEIGHTS, DATA["lq"]["torque_weight"])
    np.testing.assert_allclose(feedback.row, DATA["lq"]["gains"], rtol=1e-7)
    wanted = np.array(DATA["lq"]["poles_re"]) + 1j * np.array(DATA["lq"]["poles_im"])
    np.testing.assert_allclose(
        np.sort_complex(feedback.poles_1_s(LISTED)), np.sort_complex(wanted), rtol=1e-7
    )


@pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS)
def test_one_input_leaves_one_answer_whichever_routine_looks_for_it(joint):
    f, g = augmented(joint)
    np.testing.assert_allclose(
        assign(joint, POLES).row, -place_poles(f, g[:, None], POLES).gain_matrix[0], rtol=1e-8
    )


def test_repeated_poles_are_assigned_though_the_robust_routine_refuses_them():
    f, g = augmented(LISTED)
    with pytest.raises(ValueError, match="repeated"):
        place_poles(f, g[:, None], np.full(5, -80.0))
    feedback = assign(LISTED, [-80.0] * 5)
    np.testing.assert_allclose(
        np.poly(closed(LISTED, feedback)), np.poly(np.full(5, -80.0)), rtol=1e-9
    )
    assert (
        feedback.analyse(LISTED).eigenvector_condition > 1e6
    )  # alike as the eigenvectors are, the poles are a matter of rounding


@settings(max_examples=60)
@given(
    st.floats(5.0, 2e3),
    st.floats(0.05, 20.0),
    st.just(0.0) | st.floats(1e-3, 0.3),
    pairs,
    pairs,
    st.floats(-2.0, -0.1),
)
def test_any_joint_takes_any_stable_poles(antiresonance, ratio, damping, one, two, real):
    joint = TwoMass.normalised(antiresonance, ratio, damping, 1e-3)
    wanted = antiresonance * np.array(
        [complex(*one), complex(*one).conjugate(), complex(*two), complex(*two).conjugate(), real]
    )
    f, g = augmented(joint)
    scale = antiresonance ** np.arange(6)
    found = np.poly(f + np.outer(g, assign(joint, wanted).row)) / scale
    np.testing.assert_allclose(
        found,
        np.poly(wanted).real / scale,
        rtol=1e-7,
        atol=1e-7 * np.abs(np.poly(wanted) / scale).max(),
    )


def test_lq_gains_solve_the_riccati_equation_and_have_the_sign_lqr_leaves_out():
    f, g = augmented(LISTED)
    p = solve_continuous_are(f, g[:, None], np.diag(WEIGHTS), 1.0)
    np.testing.assert_allclose(lq(LISTED, WEIGHTS).row, -(g @ p), rtol=1e-9)
    np.testing.assert_allclose(
        lq(LISTED, WEIGHTS).row, -control.lqr(f, g[:, None], np.diag(WEIGHTS), 1.0)[0][0], rtol=1e-9
    )
    assert (
        np.max(np.linalg.eigvals(f - np.outer(g, lq(LISTED, WEIGHTS).row)).real) > 0.0
    )  # as the slide prints it


@pytest.mark.parametrize("place", range(5))
@pytest.mark.parametrize("share", [0.97, 1.03])
def test_any_other_gain_costs_more(place, share):
    best = lq(LISTED, WEIGHTS).row

    def cost(row):
        f, g = augmented(LISTED)
        a = f + np.outer(g, row)
        assert np.max(np.linalg.eigvals(a).real) < 0.0
        return np.diag(solve_continuous_lyapunov(a.T, -(np.diag(WEIGHTS) + np.outer(row, row))))

    other = best.copy()
    other[place] *= share
    assert np.all(cost(other) > cost(best))


@settings(max_examples=30)
@given(st.lists(st.floats(1e-3, 1e4), min_size=5, max_size=5))
def test_lq_keeps_the_loop_a_unit_away_from_minus_one(weights):
    f, g = augmented(LISTED)
    row = lq(LISTED, weights).row
    w = np.geomspace(0.1, 1e5, 400)
    loop = np.array([-row @ np.linalg.solve(1j * wi * np.eye(5) - f, g) for wi in w])
    assert np.min(np.abs(1.0 + loop)) > 1.0 - 1e-6


@pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS)
def test_lq_has_sixty_degrees_and_takes_half_its_gain(joint):
    margins = lq(joint, WEIGHTS).analyse(joint).margins
    assert margins.phase_margin_deg >= 60.0
    assert margins.lower_gain_margin < 0.5
    assert margins.upper_gain_margin == math.inf
    assert margins.peak_sensitivity == pytest.approx(1.0, abs=1e-6)
    for share in (0.5, 1.0, 100.0):
        f, g = augmented(joint)
        assert np.max(np.linalg.eigvals(f + share * np.outer(g, lq(joint, WEIGHTS).row)).real) < 0.0


@pytest.mark.parametrize("unit", [1e-5, 1e-2, 1e5])
def test_lq_gains_go_with_the_unit_of_torque(unit):
    keys = {
        key: value * (1.0 if key == "gear_ratio" else unit)
        for key, value in DATA["joints"]["listed"].items()
    }
    scaled = lq(TwoMass(**keys), WEIGHTS, 1.0 / unit**2)
    np.testing.assert_allclose(scaled.row, lq(LISTED, WEIGHTS).row * unit, rtol=1e-9)


@settings(max_examples=100, deadline=None)
@given(
    st.floats(-5.0, 1.0),
    st.floats(-2.0, 2.0),
    st.floats(0.5, 3.5),
    st.just(0.0) | st.floats(1e-4, 0.3),
    st.lists(st.just(0.0) | st.floats(-8.0, 8.0).map(lambda x: 10.0**x), min_size=4, max_size=4),
    st.floats(-8.0, 8.0),
    st.floats(-6.0, 6.0),
)
def test_any_joint_and_weights_have_gains_that_settle_or_a_word_why_not(
    inertia, ratio, antiresonance, damping, weights, integral, torque
):
    joint = TwoMass.normalised(10.0**antiresonance, 10.0**ratio, damping, 10.0**inertia)
    try:
        feedback = lq(joint, [*weights, 10.0**integral], 10.0**torque)
    except ServoError as refusal:
        if "weights = [" not in str(refusal):
            raise
    else:
        assert (
            np.max(np.linalg.eigvals(augmented_units(joint).matrix(closed(joint, feedback))).real)
            < 0.0
        )


def test_the_analysis_has_poles_zeros_and_the_condition_number_of_the_eigenvectors():
    facts = assign(LISTED, POLES).analyse(LISTED)
    np.testing.assert_allclose(np.sort_complex(facts.poles_1_s), np.sort_complex(POLES), rtol=1e-9)
    found = np.sort_complex(facts.zeros_1_s)
    np.testing.assert_allclose(found.real, DATA["structure"]["zeros_to_motor_re"], rtol=1e-7)
    np.testing.assert_allclose(
        np.abs(found.imag), np.abs(DATA["structure"]["zeros_to_motor_im"]), rtol=1e-6
    )
    assert facts.eigenvector_condition > lq(LISTED, WEIGHTS).analyse(LISTED).eigenvector_condition


def test_sampled_gains_put_every_pole_where_the_continuous_one_goes():
    feedback, period = lq(LISTED, WEIGHTS), 1e-3
    whole = expm(
        np.block([[LISTED.state_matrix, LISTED.input_matrix], [np.zeros((2, 6))]]) * period
    )
    f = np.eye(5)
    f[:4, :4], f[4, 0] = whole[:4, :4], -period
    found = np.linalg.eigvals(
        f + np.outer(np.append(whole[:4, 4], 0.0), feedback.sampled(LISTED, period).row)
    )
    np.testing.assert_allclose(
        np.sort_complex(np.log(found) / period),
        np.sort_complex(feedback.poles_1_s(LISTED)),
        rtol=1e-7,
    )


def test_sampled_gains_tend_to_the_continuous_ones_with_the_period():
    feedback = lq(LISTED, WEIGHTS)
    off = [
        np.max(np.abs(feedback.sampled(LISTED, period).row / feedback.row - 1.0))
        for period in (1e-4, 1e-5)
    ]
    assert off[1] < 2e-3
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.05)


def test_raw_ranks_mislead_and_the_scaled_test_does_not():
    a, b = LISTED.state_matrix, LISTED.input_matrix[:, 0]
    krylov = np.column_stack([np.linalg.matrix_power(a, i) @ b for i in range(4)])
    assert np.linalg.cond(krylov) == pytest.approx(
        DATA["structure"]["cond_reachability_matrix"], rel=1e-4
    )
    assert mode_controllability(a, b)[0].measure > 0.1
    assert mode_controllability(a.T, np.eye(4)[0])[0].measure > 0.1


def test_units_of_the_states_do_not_change_their_controllability():
    a, b = LISTED.state_matrix, LISTED.input_matrix[:, 0]
    units = np.array([1e3, 1e-3, 10.0, 1e6])
    other = mode_controllability(a * units / units[:, None], b / units)[0].measure
    assert 0.3 < other / mode_controllability(a, b)[0].measure < 3.0


@pytest.mark.parametrize("design", [lambda: assign(SOFT, POLES), lambda: lq(SOFT, WEIGHTS)])
def test_a_load_behind_no_stiffness_is_not_controllable(design):
    with pytest.raises(NotControllable, match=r"mode at .* 1/s .* measure = .* must be > 1e-08"):
        design()


def test_an_uncontrollable_mode_is_named():
    a = np.diag([-1.0, -20.0, -300.0])
    with pytest.raises(NotControllable, match="mode at -20 1/s"):
        check_controllable(a, np.array([1.0, 0.0, 1.0]))
    with pytest.raises(NotObservable, match="mode at -300 1/s"):
        check_observable(a, np.array([1.0, 1.0, 0.0]))
    check_controllable(a, np.ones(3))
    check_observable(a, np.ones(3))


def test_two_equal_modes_are_one_too_many_for_one_input():
    with pytest.raises(NotControllable, match="mode at -5 1/s"):
        check_controllable(np.diag([-5.0, -5.0]), np.ones(2))


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (np.eye(2), np.ones(3)),
        (np.ones((2, 3)), np.ones(2)),
        (np.eye(2), [1.0, math.nan]),
        (np.zeros((0, 0)), []),
    ],
)
def test_matrices_that_do_not_fit_are_refused(a, b):
    with pytest.raises(ServoError, match="must be"):
        check_controllable(a, b)


@pytest.mark.parametrize(
    ("poles", "match"),
    [
        ([-60 + 60j, -60 - 59j, -105, -105, -40], "without its conjugate"),
        ([-60 + 60j, -60 + 60j, -60 - 60j, -105, -40], "without its conjugate"),
        ([-60, -105, -40], r"must be \(5,\)"),
        ([-60, -105, -40, 0.0, -30], "real part <"),
        ([-60, -105, -40, 5 + 1j, 5 - 1j], "real part <"),
        ([-60, -105, -40, math.nan, -3], "real part <"),
        ([-60, -105, -40, -30, -4000], "reduce the sample time"),
    ],
)
def test_poles_that_cannot_be_assigned_are_refused(poles, match):
    with pytest.raises(PolesNotAssignable, match=match):
        assign(LISTED, poles, period_s=1e-3)


def test_poles_too_fast_for_a_sample_time_are_refused_once_it_is_given():
    feedback = assign(LISTED, [-60, -105, -40, -30, -4000])
    with pytest.raises(
        PolesNotAssignable, match=r"-4000.* 0\.001 s; its absolute value must be < 3141\.59"
    ):
        feedback.sampled(LISTED, 1e-3)
    feedback.sampled(LISTED, 5e-4)


def test_a_joint_faster_than_the_sampling_is_refused():
    with pytest.raises(
        BeyondNyquist, match=r"resonance of the joint = 177\.99 rad/s .* must be < 157"
    ):
        assign(LISTED, [-30, -31, -32, -33, -34]).sampled(LISTED, 0.02)


@pytest.mark.parametrize(
    "weights", [[1, 1, 1, 1], [1, 1, 1, 1, 0], [1, -1, 1, 1, 1], [1, 1, math.inf, 1, 1]]
)
def test_weights_that_leave_the_integral_undamped_are_refused(weights):
    with pytest.raises(ServoError, match="weights"):
        lq(LISTED, weights)


@pytest.mark.parametrize(
    ("weights", "match"),
    [
        (
            [0.0, 0.0, 0.0, 0.0, 1e-300],
            r"1e-300\], torque_weight = 1.* rounding decides.*bring the weights closer together",
        ),
        ([1e308] * 5, "no gains within floating point: bring the weights closer together"),
    ],
)
def test_weights_too_far_apart_for_floating_point_are_refused(weights, match):
    with pytest.raises(ServoError, match=match):
        lq(LISTED, weights)


def test_gains_that_leave_an_unstable_pole_are_refused_even_if_both_computations_agree(
    monkeypatch,
):
    monkeypatch.setattr(riccati, "AGREEMENT_REL", 1e300)
    with pytest.raises(ServoError, match=r"real part >= 0 \(here \d"):
        lq(LISTED, [0.0, 0.0, 0.0, 0.0, 1e-300])


def test_a_damper_too_strong_for_floating_point_is_refused():
    stiff = TwoMass(
        motor_inertia_kg_m2=1e-12,
        load_inertia_kg_m2=7e-12,
        stiffness_n_m_rad=1.0,
        elastic_damping_n_m_s_rad=9e11,
    )
    with pytest.raises(
        ServoError, match=r"period_s = 9\.7 .* a pole at -1\.03e\+24 .* lower the damping"
    ):
        sampled_joint(stiff, 9.7)


@pytest.mark.parametrize("weight", [0.0, -1.0, math.nan])
def test_a_torque_weight_of_zero_is_refused(weight):
    with pytest.raises(ServoError, match="torque_weight"):
        lq(LISTED, WEIGHTS, weight)


@pytest.mark.parametrize(
    "gains",
    [((1.0, 2.0, 3.0), 1.0), ((1.0, 2.0, 3.0, math.inf), 1.0), ((1.0, 2.0, 3.0, 4.0), math.nan)],
)
def test_gains_that_are_not_five_numbers_are_refused(gains):
    with pytest.raises(ServoError, match="gains"):
        Feedback(*gains)
