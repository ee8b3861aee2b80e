"""Observers against the reference data and independent computations.

Their dual, polynomials in fractions, a Riccati recursion in extended precision, and a joint that
moves.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import fields
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import (
    expm,
    solve_continuous_are,
    solve_continuous_lyapunov,
    solve_discrete_lyapunov,
)

from rig.drives.servo.controllability import joint_units
from rig.drives.servo.errors import BeyondNyquist, NotObservable, PolesNotAssignable, ServoError
from rig.drives.servo.estimator import (
    ENCODER,
    Estimator,
    Noise,
    SampledEstimator,
    assign,
    kalman,
    sampled_kalman,
)
from rig.drives.servo.two_mass import TwoMass

DATA = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_state_space.toml").read_text())
JOINTS = {name: TwoMass(**keys) for name, keys in DATA["joints"].items()}
LISTED = JOINTS["listed"]
UNDAMPED = TwoMass(motor_inertia_kg_m2=1.5e-4, load_inertia_kg_m2=2.7e-4, stiffness_n_m_rad=3.1)
SOFT = TwoMass(motor_inertia_kg_m2=1.5e-4, load_inertia_kg_m2=2.7e-4, stiffness_n_m_rad=1e-12)
POLES = np.array(DATA["kalman"]["poles_re"]) + 1j * np.array(DATA["kalman"]["poles_im"])
PERIOD_S = 1e-3
ENCODERS = {  # every encoder with its sample time
    "8192 counts, 1 ms": (8192, 1e-3),
    "16 bits, 1 ms": (2**16, 1e-3),
    "20 bits, 1 ms": (2**20, 1e-3),
    "40 bits, 1 ms": (2**40, 1e-3),
    "23 bits, 8 kHz": (2**23, 1.25e-4),
    "10 bits, 100 Hz": (2**10, 1e-2),
}
encoders = pytest.mark.parametrize(("counts", "period_s"), ENCODERS.values(), ids=ENCODERS)


def propagated(joint, period_s):
    """Compute exp(A T), the effect of a held motor torque, and the added covariance.

    The covariance that white torques add in T by Van Loan (1978).
    """
    a, b = joint.state_matrix, joint.input_matrix
    whole = expm(np.block([[a, b], [np.zeros((2, 6))]]) * period_s)
    spread = expm(np.block([[-a, b @ Noise().torques @ b.T], [np.zeros((4, 4)), a.T]]) * period_s)
    return whole[:4, :4], whole[:4, 4], whole[:4, :4] @ spread[:4, 4:]


def spread_of(joint, gains, period_s=PERIOD_S):
    """Compute the standard deviation (4,) of the estimate after its correction.

    From the Lyapunov equation of its error.
    """
    a, _, added = propagated(joint, period_s)
    keep, angle = np.eye(4) - np.outer(gains, ENCODER), Noise().angle_rad2
    prior = solve_discrete_lyapunov(a @ keep, added + angle * np.outer(a @ gains, a @ gains))
    return np.sqrt(np.diag(keep @ prior @ keep.T + angle * np.outer(gains, gains)))


def recursion(joint, noise, period_s, samples):
    """Compute gains and standard deviations (4,) of the Kalman filter after some samples.

    In extended precision: exp(A T) and the added covariance by their Taylor series, then the prior
    variance sample by sample.
    """
    a = joint.state_matrix.astype(np.longdouble) * np.longdouble(period_s)
    b = joint.input_matrix.astype(np.longdouble)
    ahead = term = np.eye(4, dtype=np.longdouble)
    added = growth = b @ noise.torques.astype(np.longdouble) @ b.T * np.longdouble(period_s)
    for k in range(1, 80):
        term, growth = term @ a / k, (a @ growth + growth @ a.T) / (k + 1)
        ahead, added = ahead + term, added + growth
    angle, prior = np.longdouble(noise.angle_rad2), added
    for _ in range(samples):
        posterior = prior - np.outer(prior[:, 0], prior[0]) / (prior[0, 0] + angle)
        posterior[0, 0] = prior[0, 0] * angle / (prior[0, 0] + angle)
        prior = ahead @ posterior @ ahead.T + added
    gains = prior[:, 0] / (prior[0, 0] + angle)
    return gains.astype(float), np.sqrt(np.diag(posterior)).astype(float)


def unless_refused(design, *data):
    try:
        return design(*data)
    except ServoError as refusal:
        if "Noise(" not in str(refusal):
            raise
        return None


def product(*polynomials):
    """Multiply polynomials in fractions, highest power first."""
    whole = [Fraction(1)]
    for polynomial in polynomials:
        longer = [Fraction(0)] * (len(whole) + len(polynomial) - 1)
        for i, one in enumerate(whole):
            for j, other in enumerate(polynomial):
                longer[i + j] += one * other
        whole = longer
    return whole


def total(*polynomials):
    length = max(map(len, polynomials))
    return [
        sum(c)
        for c in zip(
            *([Fraction(0)] * (length - len(p)) + list(p) for p in polynomials), strict=True
        )
    ]


def mirrored(polynomial):
    """Compute p(s) p(-s)."""
    return product(polynomial, [c * (-1) ** i for i, c in enumerate(reversed(polynomial))][::-1])


def return_differences(joint, gains, noise):
    """Compute the return difference of L, that of the optimal L, and the size of their terms.

    chi(s) chi(-s) (Jm Jlr)^2 of A - L C, and a(s) a(-s) + sum q b(s) b(-s) / r. Derived by hand
    from the two equations of motion, in fractions, even powers from the 8th to the 0th.
    """
    f = Fraction
    jm, n = f(joint.motor_inertia_kg_m2), f(joint.gear_ratio)
    jl, dl = f(joint.load_inertia_kg_m2) / n**2, f(joint.load_friction_n_m_s_rad) / n**2
    k, d, dm = (
        f(joint.stiffness_n_m_rad),
        f(joint.elastic_damping_n_m_s_rad),
        f(joint.motor_friction_n_m_s_rad),
    )
    motor, load, spring = [jm, d + dm, k], [jl, d + dl, k], [d, k]
    a = total(product(motor, load), [-c for c in product(spring, spring)])
    columns = [  # C adj(s 1 - A), times Jm Jlr
        total(product(load, motor[:2]), [-d * c for c in spring]),
        [jm * c for c in load],
        total(product(spring, load[:2]), [-d * c for c in load]),
        [jl * c for c in spring],
    ]
    chi = total(
        a, *([f(gain) * c for c in column] for gain, column in zip(gains, columns, strict=True))
    )
    density = f(noise.angle_rad2) * f(noise.encoder_period_s)
    by_motor = [f(noise.motor_torque_n2_m2_s) / density * c for c in mirrored(load)]
    by_load = [f(noise.load_torque_n2_m2_s) / density * c for c in mirrored(spring)]
    size = [abs(c) for c in chi]
    return mirrored(chi)[::2], total(mirrored(a), by_motor, by_load)[::2], product(size, size)[::2]


def test_the_reference_s_noise_gives_the_reference_s_gains_and_poles():
    estimator = kalman(LISTED)
    np.testing.assert_allclose(estimator.gains, DATA["kalman"]["gains"], rtol=1e-7)
    np.testing.assert_allclose(
        np.sort_complex(estimator.poles_1_s(LISTED)), np.sort_complex(POLES), rtol=1e-7
    )


def test_its_poles_assigned_give_the_kalman_filter_back():
    np.testing.assert_allclose(assign(LISTED, POLES).gains, DATA["kalman"]["gains"], rtol=1e-6)


@pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS)
def test_the_kalman_filter_is_the_dual_of_a_regulator(joint):
    noise = Noise(motor_torque_n2_m2_s=1e-5, load_torque_n2_m2_s=3e-6, encoder_counts_per_rev=2000)
    b, density = joint.input_matrix, (2 * math.pi / 2000) ** 2 / 12 * noise.encoder_period_s
    p = solve_continuous_are(
        joint.state_matrix.T, ENCODER[:, None], b @ np.diag([1e-5, 3e-6]) @ b.T, density
    )
    np.testing.assert_allclose(kalman(joint, noise).gains, p[:, 0] / density, rtol=1e-7)


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("share", [0.97, 1.03])
def test_any_other_gain_estimates_worse(place, share):
    noise, b = Noise(), LISTED.input_matrix

    def variance(gains):
        a = LISTED.state_matrix - np.outer(gains, ENCODER)
        density = noise.angle_rad2 * noise.encoder_period_s
        return np.diag(
            solve_continuous_lyapunov(
                a, -(b @ noise.torques @ b.T + density * np.outer(gains, gains))
            )
        )

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


@encoders
@pytest.mark.parametrize("load_torque", [2.5e-6, 0.0])
@pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS)
def test_the_continuous_kalman_filter_has_the_optimal_return_difference_whatever_the_encoder(
    joint, load_torque, counts, period_s
):
    noise = Noise(
        load_torque_n2_m2_s=load_torque, encoder_counts_per_rev=counts, encoder_period_s=period_s
    )
    estimator = kalman(joint, noise)
    off = [
        abs(ours - best) / size
        for ours, best, size in zip(*return_differences(joint, estimator.gains, noise), strict=True)
    ]
    assert max(map(float, off)) < 1e-10
    assert np.max(estimator.poles_1_s(joint).real) < 0.0


def test_a_fine_encoder_is_not_lost_in_rounding():
    noise = Noise(encoder_counts_per_rev=2**23, encoder_period_s=1.25e-4)
    scale, density = joint_units(LISTED).states, noise.angle_rad2 * noise.encoder_period_s
    a = (
        (LISTED.state_matrix - np.outer(kalman(LISTED, noise).gains, ENCODER))
        * scale
        / scale[:, None]
    )
    b, gains = LISTED.input_matrix / scale[:, None], np.array(kalman(LISTED, noise).gains) / scale
    variance = solve_continuous_lyapunov(
        a, -(b @ noise.torques @ b.T + density * np.outer(gains, gains))
    )
    assert math.sqrt(variance[0, 0]) == pytest.approx(
        7.389e-7, rel=1e-3
    )  # 0.072 rad of a Riccati equation in SI units
    assert gains[0] * density == pytest.approx(variance[0, 0], rel=1e-6)


@pytest.mark.parametrize(("period_s", "worse"), [(1e-4, 1e-12), (1e-3, 4e-7), (3e-3, 7.3e-4)])
def test_kalman_s_gains_emulated_estimate_nearly_as_well_as_the_sampled_filter(period_s, worse):
    noise = Noise(encoder_period_s=period_s)
    ours = spread_of(LISTED, kalman(LISTED, noise).sampled(LISTED, period_s), period_s)
    best = np.array(sampled_kalman(LISTED, noise, period_s).deviations)
    assert np.max(ours / best) - 1.0 < worse
    assert np.min(ours / best) - 1.0 > -1e-9


@encoders
@pytest.mark.parametrize("joint", [*JOINTS.values(), UNDAMPED], ids=[*JOINTS, "undamped"])
def test_the_sampled_filter_is_where_the_riccati_recursion_ends(joint, counts, period_s):
    noise = Noise(encoder_counts_per_rev=counts)
    gains, deviations = recursion(joint, noise, period_s, round(0.5 / period_s))
    estimator = sampled_kalman(joint, noise, period_s)
    np.testing.assert_allclose(estimator.gains, gains, rtol=1e-9)
    np.testing.assert_allclose(estimator.deviations, deviations, rtol=1e-9)


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("share", [0.97, 1.03])
def test_any_other_sampled_gain_estimates_worse(place, share):
    best = sampled_kalman(LISTED, Noise(), PERIOD_S)
    np.testing.assert_allclose(
        spread_of(LISTED, best.sampled(LISTED, PERIOD_S)), best.deviations, rtol=1e-9
    )
    other = best.sampled(LISTED, PERIOD_S)
    other[place] *= share
    assert np.all(spread_of(LISTED, other) > np.array(best.deviations))


def test_the_sampled_filter_tends_to_the_continuous_one_with_the_period():
    off = []
    for period_s in (4e-4, 2e-4, 1e-4):
        noise = Noise(encoder_period_s=period_s)
        emulated = kalman(LISTED, noise).sampled(LISTED, period_s)
        off.append(np.max(np.abs(sampled_kalman(LISTED, noise, period_s).gains / emulated - 1.0)))
    assert off[2] < 2e-6
    assert np.all(np.log2(np.array(off[:-1]) / off[1:]) > 1.8)


@pytest.mark.parametrize(("counts", "left_out"), [(8192, 0), (2**20, 0), (2**40, 1)])
def test_the_sampled_filter_gives_the_poles_of_its_error(counts, left_out):
    estimator = sampled_kalman(LISTED, Noise(encoder_counts_per_rev=counts), PERIOD_S)
    a, _, _ = propagated(LISTED, PERIOD_S)
    poles = estimator.poles_1_s(LISTED)
    assert len(poles) == 4 - left_out
    assert np.max(poles.real) < -40.0
    found = np.poly(a @ (np.eye(4) - np.outer(estimator.gains, ENCODER)))
    reported = np.poly(np.append(np.exp(poles * PERIOD_S), np.zeros(left_out)))
    np.testing.assert_allclose(reported, found, atol=1e-9)


@pytest.mark.parametrize("counts", [8192, 2**16])
def test_the_predicted_deviations_are_those_of_a_joint_with_noise_and_an_encoder(counts):
    rng, joints, samples, step = np.random.default_rng(4), 300, 1200, 2.0 * math.pi / counts
    estimator = sampled_kalman(LISTED, Noise(encoder_counts_per_rev=counts), PERIOD_S)
    a, b, added = propagated(LISTED, PERIOD_S)
    spread, gains = np.linalg.cholesky(added), estimator.sampled(LISTED, PERIOD_S)[:, None]
    truth = np.array([[0.0], [50.0], [0.0], [50.0]]) + np.zeros(
        (4, joints)
    )  # they turn, else the error of a step is no noise
    guess, squares, count = truth.copy(), np.zeros(4), 0
    for k in range(samples):
        read = step * np.round(truth[0] / step)
        estimate = guess + gains * (read - guess[0])
        if k > 200:
            squares, count = squares + np.sum((estimate - truth) ** 2, axis=1), count + joints
        torque = b[:, None] * 0.17  # against friction
        truth = a @ truth + torque + spread @ rng.standard_normal((4, joints))
        guess = a @ estimate + torque
    np.testing.assert_allclose(np.sqrt(squares / count), estimator.deviations, rtol=0.02)


@settings(max_examples=150, deadline=None)
@given(
    st.floats(-5.0, 1.0),
    st.floats(-2.0, 2.0),
    st.floats(0.5, 3.5),
    st.just(0.0) | st.floats(1e-4, 0.3),
    st.floats(-15.0, 3.0),
    st.just(0.0) | st.floats(-15.0, 3.0).map(lambda x: 10.0**x),
    st.floats(0.0, 40.0),
    st.floats(-3.0, 0.4),
)
def test_any_joint_and_noise_has_a_filter_that_settles_or_a_word_why_not(
    inertia, ratio, antiresonance, damping, motor_torque, load_torque, bits, sampling
):
    joint = TwoMass.normalised(10.0**antiresonance, 10.0**ratio, damping, 10.0**inertia)
    period_s = max(10.0**sampling / float(np.max(np.abs(joint.poles_1_s))), 1e-7)
    noise = Noise(
        motor_torque_n2_m2_s=10.0**motor_torque,
        load_torque_n2_m2_s=load_torque,
        encoder_counts_per_rev=2.0**bits,
        encoder_period_s=period_s,
    )
    if continuous := unless_refused(kalman, joint, noise):
        error = joint_units(joint).matrix(joint.state_matrix - np.outer(continuous.gains, ENCODER))
        assert np.max(np.linalg.eigvals(error).real) < 0.0
    if sampled := unless_refused(sampled_kalman, joint, noise, period_s):
        assert np.max(sampled.poles_1_s(joint).real) < 0.0
        assert np.all(np.isfinite(sampled.deviations))
        assert sampled.deviations[0] <= math.sqrt(noise.angle_rad2) * (
            1 + 1e-9
        )  # one reading alone is no better


def test_sampled_gains_tend_to_the_continuous_ones_with_the_period():
    off = [
        np.max(np.abs(assign(LISTED, POLES).sampled(LISTED, t) / t / DATA["kalman"]["gains"] - 1.0))
        for t in (1e-5, 1e-6)
    ]
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


def test_an_unobservable_mode_is_refused():
    for design in (
        kalman,
        lambda joint: assign(joint, POLES),
        lambda joint: sampled_kalman(joint, Noise(), PERIOD_S),
    ):
        with pytest.raises(NotObservable, match=r"measure = .* must be > 1e-08"):
            design(SOFT)


def test_noise_on_the_motor_alone_is_enough():
    estimator = kalman(LISTED, Noise(load_torque_n2_m2_s=0.0))
    assert np.max(estimator.poles_1_s(LISTED).real) < 0.0


@pytest.mark.parametrize(
    ("poles", "match"),
    [
        ([-100, -200, -300], r"\(4,\)"),
        ([-100, -200, -300 + 1j, -300 + 1j], "conjugate"),
        ([-100, -200, -300, 1.0], "real part <"),
        ([-100, -200, -300, -3200], "reduce the sample time"),
    ],
)
def test_poles_that_cannot_be_assigned_are_refused(poles, match):
    with pytest.raises(PolesNotAssignable, match=match):
        assign(LISTED, poles, PERIOD_S)


def test_a_filter_too_fast_for_the_sample_time_is_refused():
    with pytest.raises(PolesNotAssignable, match=r"sample time of 0\.005 s"):
        kalman(LISTED).sampled(LISTED, 5e-3)


def test_noises_too_far_apart_for_floating_point_are_refused():
    with pytest.raises(
        ServoError,
        match=(
            r"load_torque_n2_m2_s=0\.0, encoder_counts_per_rev=1099511627776"
            r".*rounding.*lower the encoder counts"
        ),
    ):
        kalman(UNDAMPED, Noise(load_torque_n2_m2_s=0.0, encoder_counts_per_rev=2**40))
    coarse = Noise(motor_torque_n2_m2_s=1e-18, load_torque_n2_m2_s=0.0, encoder_counts_per_rev=1)
    with pytest.raises(
        ServoError,
        match=r"leaves 0\.9999.* a sample; must be < 1 - 1e-09: raise the noise of the torques",
    ):
        sampled_kalman(UNDAMPED, coarse, PERIOD_S)


@pytest.mark.parametrize(
    ("period_s", "error", "match"),
    [
        (0.0, ServoError, "period_s = 0"),
        (math.nan, ServoError, "nan"),
        (0.02, BeyondNyquist, "157"),
    ],
)
def test_a_sample_time_that_cannot_be_is_refused(period_s, error, match):
    with pytest.raises(error, match=match):
        sampled_kalman(LISTED, Noise(), period_s)


def test_a_sampled_filter_without_a_sample_time_is_refused():
    with pytest.raises(ServoError, match="period_s = 0"):
        SampledEstimator((0.8, 1.0, 1.0, 1.0), 0.0, (1.0, 1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("joint", "motor_torque", "load_torque", "counts", "period_s"),
    [  # entries of 2e15 and 1.5e16: the sampled equations would depend on the BLAS kernel
        (
            [
                7.170768017872791e-09,
                1.0235251824526983e-06,
                3953815175.6819324,
                71.46164955885139,
                0.0,
                0.0,
                4.612631252960704,
            ],
            135663427057.0272,
            0.0,
            106.99889860713124,
            0.011240919214936328,
        ),
        (
            [
                1.2581707610067238e-09,
                4.080691534820021e-05,
                41463989.446214475,
                3.604800977323418,
                1.1828258456646092,
                0.0,
                1.5927332931730714e-08,
            ],
            7111447264.565147,
            40866990256.831024,
            1112040.0215012878,
            0.6822600014004736,
        ),
    ],
)
def test_a_joint_far_stiffer_than_its_sampling_never_makes_a_filter_of_rounding(
    joint, motor_torque, load_torque, counts, period_s
):
    names = [field.name for field in fields(TwoMass)]
    noise = Noise(
        motor_torque_n2_m2_s=motor_torque,
        load_torque_n2_m2_s=load_torque,
        encoder_counts_per_rev=counts,
    )
    with pytest.raises(
        ServoError, match=r"sampled equations is .*; must be <= 1e\+09 for floating point"
    ):
        sampled_kalman(TwoMass(**dict(zip(names, joint, strict=True))), noise, period_s)


def test_a_sampled_filter_is_refused_at_another_sample_time():
    with pytest.raises(
        ServoError, match=r"period_s = 0\.002 for an estimator of 0\.001 s; must be the same"
    ):
        sampled_kalman(LISTED, Noise(), PERIOD_S).sampled(LISTED, 2e-3)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("motor_torque_n2_m2_s", 0.0),
        ("load_torque_n2_m2_s", -1e-6),
        ("encoder_counts_per_rev", 0),
        ("encoder_counts_per_rev", 2**40 + 1),
        ("encoder_period_s", 0.0),
        ("motor_torque_n2_m2_s", math.nan),
    ],
)
def test_noise_that_cannot_be_is_refused(key, value):
    with pytest.raises(ServoError, match="must be"):
        Noise(**{key: value})


@pytest.mark.parametrize("gains", [(1.0, 2.0, 3.0), (1.0, 2.0, 3.0, math.nan)])
def test_gains_that_are_not_four_numbers_are_refused(gains):
    for design in (
        Estimator,
        lambda gains: SampledEstimator(gains, PERIOD_S, (1.0, 1.0, 1.0, 1.0)),
    ):
        with pytest.raises(ServoError, match="must be four"):
            design(gains)
