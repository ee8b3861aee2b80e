"""Observers against the reference's figures, their dual, the discrete Kalman filter and a joint that moves."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_are, solve_continuous_lyapunov, solve_discrete_are, solve_discrete_lyapunov

from rig.servo.errors import NotObservable, PolesOutOfReach, ServoError
from rig.servo.estimator import ENCODER, Estimator, Noise, assign, kalman
from rig.servo.two_mass import TwoMass

DATA = tomllib.loads((Path(__file__).parent / "data" / "servo_state_space.toml").read_text())
JOINTS = {name: TwoMass(**keys) for name, keys in DATA["joints"].items()}
LISTED = JOINTS["listed"]
POLES = np.array(DATA["kalman"]["poles_re"]) + 1j * np.array(DATA["kalman"]["poles_im"])
PERIOD_S = 1e-3


def propagated(joint, period_s):
    """exp(A T), the effect of a held motor torque, and the covariance white torques add in T (Van Loan 1978)."""
    a, b = joint.state_matrix, joint.input_matrix
    whole = expm(np.block([[a, b], [np.zeros((2, 6))]]) * period_s)
    spread = expm(np.block([[-a, b @ Noise().torques @ b.T], [np.zeros((4, 4)), a.T]]) * period_s)
    return whole[:4, :4], whole[:4, 4], whole[:4, :4] @ spread[:4, 4:]


def spread_of(joint, gains, period_s=PERIOD_S):
    """Standard deviation (4,) of the estimate after its correction, from the Lyapunov equation of its error."""
    a, _, added = propagated(joint, period_s)
    keep, angle = np.eye(4) - np.outer(gains, ENCODER), Noise().angle_rad2
    prior = solve_discrete_lyapunov(a @ keep, added + angle * np.outer(a @ gains, a @ gains))
    return np.sqrt(np.diag(keep @ prior @ keep.T + angle * np.outer(gains, gains)))


def test_the_reference_s_noise_gives_the_reference_s_gains_and_poles():
    estimator = kalman(LISTED)
    np.testing.assert_allclose(estimator.gains, DATA["kalman"]["gains"], rtol=1e-7)
    np.testing.assert_allclose(np.sort_complex(estimator.poles_1_s(LISTED)), np.sort_complex(POLES), rtol=1e-7)


def test_its_poles_assigned_give_the_kalman_filter_back():
    np.testing.assert_allclose(assign(LISTED, POLES).gains, DATA["kalman"]["gains"], rtol=1e-6)


@pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS)
def test_the_kalman_filter_is_the_dual_of_a_regulator(joint):
    noise = Noise(motor_torque_n2_m2_s=1e-5, load_torque_n2_m2_s=3e-6, encoder_counts_per_rev=2000)
    b, density = joint.input_matrix, (2 * math.pi / 2000) ** 2 / 12 * noise.encoder_period_s
    p = solve_continuous_are(joint.state_matrix.T, ENCODER[:, None], b @ np.diag([1e-5, 3e-6]) @ b.T, density)
    np.testing.assert_allclose(kalman(joint, noise).gains, p[:, 0] / density, rtol=1e-7)


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("share", [0.97, 1.03])
def test_any_other_gain_estimates_worse(place, share):
    noise, b = Noise(), LISTED.input_matrix

    def variance(gains):
        a = LISTED.state_matrix - np.outer(gains, ENCODER)
        density = noise.angle_rad2 * noise.encoder_period_s
        return np.diag(solve_continuous_lyapunov(a, -(b @ noise.torques @ b.T + density * np.outer(gains, gains))))

    best = np.array(kalman(LISTED).gains)
    other = best.copy()
    other[place] *= share
    assert np.all(variance(other) > variance(best))


@pytest.mark.parametrize("period_s", [1e-4, 1e-3, 2e-3])
def test_sampled_its_error_dies_out_with_the_same_poles(period_s):
    a, _, _ = propagated(LISTED, period_s)
    left = a @ (np.eye(4) - np.outer(assign(LISTED, POLES).sampled(LISTED, period_s), ENCODER))
    found = np.log(np.linalg.eigvals(left).astype(complex)) / period_s
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(POLES), rtol=1e-6)


@pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS)
def test_sampled_at_the_encoder_s_period_it_is_as_good_as_the_discrete_kalman_filter(joint):
    a, _, added = propagated(joint, PERIOD_S)
    prior = solve_discrete_are(a.T, ENCODER[:, None], added, Noise().angle_rad2)
    best = prior[:, 0] / (prior[0, 0] + Noise().angle_rad2)
    ours = spread_of(joint, kalman(joint).sampled(joint, PERIOD_S))
    assert np.all(ours >= spread_of(joint, best) * (1 - 1e-9))
    np.testing.assert_allclose(ours, spread_of(joint, best), rtol=1e-6)


def test_sampled_gains_tend_to_the_continuous_ones_with_the_period():
    off = [np.max(np.abs(assign(LISTED, POLES).sampled(LISTED, t) / t / DATA["kalman"]["gains"] - 1.0)) for t in (1e-5, 1e-6)]
    assert off[1] < 2e-3
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.1)


def test_the_continuous_gains_times_the_period_diverge_at_one_kilohertz():
    a, _, _ = propagated(LISTED, PERIOD_S)
    left = a @ (np.eye(4) - PERIOD_S * np.outer(kalman(LISTED).gains, ENCODER))
    assert np.max(np.abs(np.linalg.eigvals(left))) > 1.5


def test_the_continuous_observer_with_its_angle_held_lags_a_joint_that_turns():
    whole = np.zeros((6, 6))
    whole[:4, :4] = LISTED.state_matrix - np.outer(kalman(LISTED).gains, ENCODER)
    whole[:4, 4], whole[:4, 5] = LISTED.input_matrix[:, 0], kalman(LISTED).gains
    held, (a, b, _) = expm(whole * PERIOD_S), propagated(LISTED, PERIOD_S)
    truth = guess = np.array([0.0, 200.0, 0.0, 200.0])
    torque = 200.0 * DATA["joints"]["listed"]["motor_friction_n_m_s_rad"]
    for _ in range(400):
        truth, guess = a @ truth + b * torque, held[:4] @ [*guess, torque, truth[0]]
    assert guess[0] - truth[0] == pytest.approx(-0.13, abs=0.01)
    assert np.dot(DATA["lq"]["gains"][:4], guess - truth) > 3.0  # N m


def test_a_joint_that_turns_is_estimated_without_lag():
    gains, (a, b, _) = kalman(LISTED).sampled(LISTED, PERIOD_S), propagated(LISTED, PERIOD_S)
    truth, guess = np.array([0.3, 0.0, -0.2, 5.0]), np.zeros(4)
    for k in range(1500):
        estimate = guess + gains * (truth[0] - guess[0])
        torque = 0.3 + 0.5 * math.sin(0.05 * k)
        error = estimate - truth
        truth, guess = a @ truth + b * torque, a @ estimate + b * torque
    assert abs(truth[1]) > 50.0
    np.testing.assert_allclose(error, 0.0, atol=1e-9)


def test_a_mode_the_encoder_does_not_see_is_refused():
    soft = TwoMass(motor_inertia_kg_m2=1.5e-4, load_inertia_kg_m2=2.7e-4, stiffness_n_m_rad=1e-12)
    for design in (kalman, lambda joint: assign(joint, POLES)):
        with pytest.raises(NotObservable, match=r"measure = .* must be > 1e-08"):
            design(soft)


def test_noise_on_the_motor_alone_is_enough():
    estimator = kalman(LISTED, Noise(load_torque_n2_m2_s=0.0))
    assert np.max(estimator.poles_1_s(LISTED).real) < 0.0


@pytest.mark.parametrize(
    ("poles", "match"),
    [
        ([-100, -200, -300], r"\(4,\)"),
        ([-100, -200, -300 + 1j, -300 + 1j], "conjugate"),
        ([-100, -200, -300, 1.0], "real part <"),
        ([-100, -200, -300, -3200], "sample faster"),
    ],
)
def test_poles_out_of_reach_are_refused(poles, match):
    with pytest.raises(PolesOutOfReach, match=match):
        assign(LISTED, poles, PERIOD_S)


def test_a_filter_too_fast_for_the_sample_time_is_refused():
    with pytest.raises(PolesOutOfReach, match=r"sample time of 0\.005 s"):
        kalman(LISTED).sampled(LISTED, 5e-3)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("motor_torque_n2_m2_s", 0.0),
        ("load_torque_n2_m2_s", -1e-6),
        ("encoder_counts_per_rev", 0),
        ("encoder_period_s", 0.0),
        ("motor_torque_n2_m2_s", math.nan),
    ],
)
def test_noise_that_cannot_be_is_refused(key, value):
    with pytest.raises(ServoError, match="must be"):
        Noise(**{key: value})


@pytest.mark.parametrize("gains", [(1.0, 2.0, 3.0), (1.0, 2.0, 3.0, math.nan)])
def test_gains_that_are_not_four_numbers_are_refused(gains):
    with pytest.raises(ServoError, match="must be four"):
        Estimator(gains)
