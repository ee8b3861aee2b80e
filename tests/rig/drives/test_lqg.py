"""State-space controller on a joint integrated by the test.

By the matrix exponential of equations written here.
"""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.signal import lsim

from rig.drives.servo.errors import BeyondNyquist, Improper, PolesNotAssignable, ServoError
from rig.drives.servo.estimator import Estimator, Noise, kalman, sampled_kalman
from rig.drives.servo.feed_forward import LoadFilter
from rig.drives.servo.lqg import StateSpaceController, analyse_continuous_loop, compensator
from rig.drives.servo.setpoint import MotorSetpoint
from rig.drives.servo.state_feedback import Feedback, assign, lq
from rig.drives.servo.two_mass import TwoMass
from rig.drives.servo.wiring import position_loop

DATA = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_state_space.toml").read_text())
JOINTS = {name: TwoMass(**keys) for name, keys in DATA["joints"].items()}
LISTED = JOINTS["listed"]
FEEDBACK, ESTIMATOR = lq(LISTED, DATA["lq"]["weights"]), kalman(LISTED)
joints = pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS)
AT_REST = MotorSetpoint(0.0)


class Run(NamedTuple):
    t_s: np.ndarray  # (N,)
    x: np.ndarray  # (N, 4) motor and load, angle and speed, at the motor's side
    torque_n_m: np.ndarray  # (N,)


def drive(joint, period_s=1e-3, **keys):
    return StateSpaceController(
        joint, lq(joint, DATA["lq"]["weights"]), kalman(joint), period_s, **keys
    )


def facts(controller, period_s):
    return position_loop(LISTED, [controller.system], period_s).analysis


def run(
    controller,
    setpoint,
    time_s,
    period_s=1e-3,
    joint=LISTED,
    load_n_m=0.0,
    motor_n_m=0.0,
    fine=5,
    start=(0, 0, 0, 0),
):
    """Simulate the joint with the controller.

    fine instants per sample; the torques on motor and load are constant.
    """
    jm, jl = joint.motor_inertia_kg_m2, joint.load_inertia_kg_m2 / joint.gear_ratio**2
    k, d = joint.stiffness_n_m_rad, joint.elastic_damping_n_m_s_rad
    dm, dl = joint.motor_friction_n_m_s_rad, joint.load_friction_n_m_s_rad / joint.gear_ratio**2
    whole = np.zeros((6, 6))
    whole[0, 1] = whole[2, 3] = 1.0
    whole[1] = np.array([-k, -d - dm, k, d, 1.0, 0.0]) / jm
    whole[3] = np.array([k, d, -k, -d - dl, 0.0, 1.0]) / jl
    ahead = expm(whole * period_s / fine)
    x, rows, torques = np.array([*start, 0.0, load_n_m], dtype=float), [], []
    for i in range(round(time_s / period_s)):
        torque = controller.step(setpoint(i * period_s), float(x[0]))
        x[4] = torque + motor_n_m
        for _ in range(fine):
            x = ahead @ x
            rows.append(x[:4])
            torques.append(torque)
    return Run(np.arange(1, len(rows) + 1) * period_s / fine, np.array(rows), np.array(torques))


def trapezoid(figures):
    """Build the setpoint as a function of time, and its top speed."""
    h, time, a = figures["distance_rad"], figures["time_s"], figures["acceleration_rad_s2"]
    ramp = (time - math.sqrt(time**2 - 4 * h / a)) / 2

    def at(t):
        if t < ramp:
            return MotorSetpoint(a * t**2 / 2, a * t, a)
        if t < time - ramp:
            return MotorSetpoint(a * ramp * (t - ramp / 2), a * ramp, 0.0)
        left = max(time - t, 0.0)
        return MotorSetpoint(h - a * left**2 / 2, a * left, -a if left else 0.0)

    return at, a * ramp


@pytest.mark.parametrize("figures", DATA["experiments"])
def test_the_source_s_moves_leave_the_reference_s_vibration(figures):
    period = 1e-3
    setpoint, top = trapezoid(figures)
    found = run(
        drive(LISTED, period, feed_forward="rigid"),
        setpoint,
        figures["time_s"] + 0.6,
        period,
        fine=10,
    )
    after = found.t_s >= figures["time_s"] - 1e-9
    wanted = np.array([setpoint(t)[:2] for t in found.t_s])
    assert 100 * np.abs(found.x[after, 3]).max() / top == pytest.approx(
        figures["residual_pct"], rel=0.01
    )
    over_deg = math.degrees((found.x[:, 2].max() - figures["distance_rad"]) / LISTED.gear_ratio)
    assert over_deg == pytest.approx(figures["load_overshoot_deg"], rel=2e-3)
    assert np.abs(found.torque_n_m).max() == pytest.approx(figures["peak_torque_n_m"], rel=2e-3)
    rms = 100 * np.sqrt(np.mean((found.x[:, 3] - wanted[:, 1]) ** 2)) / top
    assert rms == pytest.approx(figures["speed_error_rms_pct"], rel=0.01)


@pytest.mark.parametrize("figures", DATA["experiments"])
def test_sampled_fast_the_vibration_is_that_of_the_continuous_loop(figures):
    period = 1e-4
    setpoint, top = trapezoid(figures)
    found = run(
        drive(LISTED, period, feed_forward="rigid"),
        setpoint,
        figures["time_s"] + 0.1,
        period,
        fine=1,
    )
    residual = 100 * np.abs(found.x[found.t_s >= figures["time_s"] - 1e-9, 3]).max() / top
    assert residual == pytest.approx(figures["exact_residual_pct"], rel=1e-3)


def test_observer_and_feedback_keep_their_poles_when_put_together():
    apart = np.concatenate([FEEDBACK.poles_1_s(LISTED), ESTIMATOR.poles_1_s(LISTED)])
    found = analyse_continuous_loop(LISTED, FEEDBACK, ESTIMATOR).poles_1_s
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(apart), rtol=1e-7)


@pytest.mark.parametrize("period_s", [1e-4, 1e-3, 2e-3])
def test_the_sampled_loop_has_the_poles_of_the_design_at_any_sample_time(period_s):
    apart = np.concatenate([FEEDBACK.poles_1_s(LISTED), ESTIMATOR.poles_1_s(LISTED)])
    found = facts(StateSpaceController(LISTED, FEEDBACK, ESTIMATOR, period_s), period_s).poles_1_s
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(apart), rtol=1e-6)


@pytest.mark.parametrize(
    ("counts", "period_s"),
    [(8192, 1e-3), (2**16, 1e-3), (2**20, 1e-3), (2**23, 1.25e-4), (2**12, 5e-3)],
)
def test_with_the_sampled_kalman_filter_an_encoder_of_any_resolution_serves(counts, period_s):
    estimator = sampled_kalman(LISTED, Noise(encoder_counts_per_rev=counts), period_s)
    controller = StateSpaceController(LISTED, FEEDBACK, estimator, period_s, feed_forward="rigid")
    apart = np.concatenate([FEEDBACK.poles_1_s(LISTED), estimator.poles_1_s(LISTED)])
    found = np.exp(facts(controller, period_s).poles_1_s * period_s)
    np.testing.assert_allclose(
        np.poly(found).real, np.poly(np.exp(apart * period_s)).real, atol=1e-7
    )
    figures = DATA["experiments"][0]
    setpoint, top = trapezoid(figures)
    moved = run(controller, setpoint, figures["time_s"] + 0.5, period_s, fine=1)
    residual = 100 * np.abs(moved.x[moved.t_s >= figures["time_s"] - 1e-9, 3]).max() / top
    assert residual == pytest.approx(figures["residual_pct"], rel=0.02 if period_s < 5e-3 else 0.06)
    assert moved.x[-1, 2] == pytest.approx(figures["distance_rad"], abs=1e-3)


@joints
def test_a_disturbed_joint_decays_with_the_poles_of_the_design(joint):
    period = 1e-3
    kicked = run(
        drive(joint, period),
        lambda t: AT_REST,
        0.3,
        period,
        joint,
        fine=1,
        start=(0.0, 0.0, 1.0, 20.0),
    )
    angles = kicked.x[:, 0]
    poles = np.concatenate(
        [lq(joint, DATA["lq"]["weights"]).poles_1_s(joint), kalman(joint).poles_1_s(joint)]
    )
    coefficients = np.poly(
        np.exp(poles * period)
    ).real  # nine modes: any ten samples obey one recursion
    left = np.convolve(angles, coefficients, "valid")
    assert np.abs(angles).max() > 0.1
    assert np.abs(left).max() < 1e-9 * np.abs(coefficients).sum()


@pytest.mark.parametrize("period_s", [1e-3, 1e-4])
def test_margins_are_those_of_the_frequency_response(period_s):
    controller = StateSpaceController(LISTED, FEEDBACK, ESTIMATOR, period_s)
    whole = expm(
        np.block([[LISTED.state_matrix, LISTED.input_matrix], [np.zeros((2, 6))]]) * period_s
    )
    w = np.geomspace(10.0, 0.999 * math.pi / period_s, 20001)
    drive_now = controller.system
    loop = np.empty(len(w), dtype=complex)
    for i, z in enumerate(np.exp(1j * w * period_s)):
        plant = np.linalg.solve(z * np.eye(4) - whole[:4, :4], whole[:4, 4])[0]
        back = (
            drive_now.C @ np.linalg.solve(z * np.eye(5) - drive_now.A, drive_now.B[:, 3:])
            + drive_now.D[:, 3:]
        )
        loop[i] = -plant * back[0, 0]
    margins = facts(controller, period_s).margins
    crossings = np.flatnonzero((np.abs(loop[:-1]) - 1.0) * (np.abs(loop[1:]) - 1.0) < 0.0)
    phases = np.abs(np.degrees(np.angle(-loop[crossings])))
    assert margins.phase_margin_deg == pytest.approx(phases.min(), abs=0.1)
    assert margins.crossover_rad_s == pytest.approx(w[crossings[phases.argmin()]], rel=1e-3)
    real = np.flatnonzero((loop.imag[:-1] * loop.imag[1:] < 0.0) & (loop.real[:-1] < 0.0))
    gains = -1.0 / loop.real[real]
    assert margins.upper_gain_margin == pytest.approx(gains[gains > 1.0].min(), rel=2e-3)
    assert margins.lower_gain_margin == pytest.approx(gains[gains < 1.0].max(), rel=2e-3)
    assert margins.peak_sensitivity == pytest.approx(np.max(1.0 / np.abs(1.0 + loop)), rel=1e-4)


@joints
@pytest.mark.parametrize("feed_forward", ["none", "rigid", "dynamic"])
def test_constant_torques_leave_no_error_of_the_motor(joint, feed_forward):
    controller = drive(joint, feed_forward=feed_forward)
    found = run(
        controller,
        lambda t: MotorSetpoint(3.0),
        2.0,
        joint=joint,
        motor_n_m=-0.2,
        load_n_m=0.1,
        fine=1,
    )
    assert found.x[-1, 0] == pytest.approx(3.0, abs=1e-9)
    assert found.x[-1, 2] == pytest.approx(
        3.0 + 0.1 / joint.stiffness_n_m_rad, abs=1e-9
    )  # the spring still yields
    assert found.torque_n_m[-1] == pytest.approx(0.1, abs=1e-9)


@joints
def test_with_dynamic_feed_forward_the_load_follows_the_filter_and_better_with_faster_sampling(
    joint,
):
    figures = DATA["experiments"][0]
    setpoint, _ = trapezoid(figures)
    fine = np.arange(0, 0.7, 1e-5)
    load_filter = LoadFilter.binomial(3, 150.0)
    angles = [setpoint(t).angle_rad for t in fine]
    _, wanted, _ = lsim((load_filter.numerator, load_filter.denominator), angles, fine)
    off = []
    for period in (2e-3, 1e-3, 5e-4):
        found = run(
            drive(joint, period, feed_forward="dynamic"), setpoint, 0.69, period, joint, fine=2
        )
        off.append(np.abs(np.interp(found.t_s, fine, wanted) - found.x[:, 2]).max())
    assert off[1] < 1e-6 * figures["distance_rad"]
    assert np.log2(off[0] / off[1]) > 1.8
    assert np.log2(off[1] / off[2]) > 1.8


def test_the_drive_tends_to_the_continuous_design_in_proportion_to_its_sample_time():
    joint, drive_now = LISTED, compensator(LISTED, FEEDBACK, ESTIMATOR)
    whole = np.zeros((10, 10))  # [joint; estimate, integral; setpoint]
    whole[:4, :4] = joint.state_matrix
    whole[:4, 4:9] = np.outer(joint.input_matrix[:, 0], drive_now.C)
    whole[4:9, :4] = np.outer(drive_now.B[:, 1], [1.0, 0.0, 0.0, 0.0])
    whole[4:9, 4:9], whole[4:9, 9] = drive_now.A, drive_now.B[:, 0]
    start = np.append(np.zeros(9), 1.0)
    off = []
    for period in (2e-3, 1e-3, 5e-4, 2.5e-4):
        found = run(
            StateSpaceController(joint, FEEDBACK, ESTIMATOR, period),
            lambda t: MotorSetpoint(1.0),
            0.1,
            period,
            fine=1,
        )
        exact = np.array([(expm(whole * t) @ start)[:4] for t in found.t_s])
        off.append(np.abs(found.x[:, 2] - exact[:, 2]).max())
    order = np.log2(np.array(off[:-1]) / off[1:])
    assert off[-1] < 0.01
    np.testing.assert_allclose(order, 1.0, atol=0.15)


@pytest.mark.parametrize("feed_forward", ["none", "rigid", "dynamic"])
@pytest.mark.parametrize("limit_n_m", [0.3, 0.5, 0.9])
def test_a_drive_at_its_limit_comes_back_without_winding_up(feed_forward, limit_n_m):
    setpoint, _ = trapezoid(DATA["experiments"][0])
    distance = DATA["experiments"][0]["distance_rad"]
    found = run(
        drive(LISTED, feed_forward=feed_forward, torque_limit_n_m=limit_n_m), setpoint, 1.6, fine=1
    )
    assert np.abs(found.torque_n_m).max() <= limit_n_m
    assert np.sum(np.abs(found.torque_n_m) == limit_n_m) > (
        0 if feed_forward == "none" and limit_n_m == 0.9 else 50
    )
    assert found.x[:, 2].max() < distance * (1 + 5e-4)  # 54 rad too far if the integral went on
    assert found.x[-1] == pytest.approx([distance, 0.0, distance, 0.0], abs=0.02)


def test_the_integral_waits_no_sample_to_leave_the_limit():
    controller = drive(LISTED, torque_limit_n_m=0.3)
    for _ in range(3000):  # against a stop
        assert abs(controller.step(MotorSetpoint(1.0), 0.0)) <= 0.3
    assert controller.step(MotorSetpoint(-1.0), 0.0) == 0.3  # the integral sees it from here on
    assert controller.step(MotorSetpoint(-1.0), 0.0) < 0.3


def test_a_limit_that_is_not_met_changes_nothing():
    setpoint, _ = trapezoid(DATA["experiments"][2])
    free, limited = (
        run(drive(LISTED, feed_forward="rigid", torque_limit_n_m=u), setpoint, 0.3)
        for u in (math.inf, 0.8)
    )
    np.testing.assert_array_equal(free.x, limited.x)


def test_the_observer_receives_the_limited_torque():
    """With the torque requested it would expect, and counteract, ten times the speed."""
    controller = drive(LISTED, torque_limit_n_m=0.1, feed_forward="rigid")
    pushed = run(controller, lambda t: MotorSetpoint(50.0), 0.2, fine=1)
    assert np.all(pushed.torque_n_m == 0.1)
    held = np.full(2, 0.1)
    exact = (
        expm(
            np.block([[LISTED.state_matrix, LISTED.input_matrix[:, :1]], [np.zeros((1, 5))]]) * 0.2
        )[:4, 4]
        * held[0]
    )
    np.testing.assert_allclose(pushed.x[-1], exact, rtol=1e-9)
    back = run(
        controller, lambda t: MotorSetpoint(float(exact[0])), 1.5, fine=1, start=pushed.x[-1]
    )
    assert back.x[-1, 2] == pytest.approx(exact[0], abs=1e-3)


@settings(max_examples=20)
@given(st.lists(st.floats(-10, 10), min_size=8, max_size=8), st.floats(-3, 3))
def test_without_a_limit_the_drive_is_linear_and_resets_to_rest(angles, factor):
    controller = drive(LISTED, feed_forward="dynamic")
    one = [controller.step(MotorSetpoint(a, 2 * a, -a), a / 3) for a in angles]
    controller.reset()
    other = [
        controller.step(MotorSetpoint(factor * a, 2 * factor * a, -factor * a), factor * a / 3)
        for a in angles
    ]
    np.testing.assert_allclose(other, factor * np.array(one), rtol=1e-9, atol=1e-9)
    controller.reset()
    assert controller.step(AT_REST, 0.0) == 0.0


@pytest.mark.parametrize("feed_forward", ["none", "rigid", "dynamic"])
def test_the_block_of_a_drive_is_what_it_steps(feed_forward):
    controller = drive(LISTED, feed_forward=feed_forward)
    system, x = controller.system, np.zeros(controller.system.nstates)
    for k in range(30):
        u = np.array([math.sin(0.1 * k), 0.1 * k, 2.0, 0.02 * k**2])
        assert controller.step(MotorSetpoint(*u[:3]), u[3]) == pytest.approx(
            float((system.C @ x + system.D @ u)[0]), rel=1e-9
        )
        x = system.A @ x + system.B @ u


@joints
def test_a_joint_other_than_the_model_reaches_its_goal_too(joint):
    other = JOINTS["fitted" if joint is LISTED else "listed"]
    setpoint, _ = trapezoid(DATA["experiments"][0])
    found = run(drive(joint, feed_forward="rigid"), setpoint, 1.5, joint=other, fine=1)
    assert found.x[-1, 2] == pytest.approx(DATA["experiments"][0]["distance_rad"], abs=1e-3)


def test_a_feedback_without_integral_still_steps():
    k = assign(LISTED, [-60 + 60j, -60 - 60j, -105 + 105j, -105 - 105j, -1e-3])
    controller = StateSpaceController(LISTED, k, ESTIMATOR, 1e-3, torque_limit_n_m=1.0)
    assert math.isfinite(controller.step(MotorSetpoint(100.0), 0.0))


@pytest.mark.parametrize(
    ("keys", "error", "match"),
    [
        ({"period_s": 0.0}, ServoError, "period_s = 0"),
        ({"period_s": math.nan}, ServoError, "period_s = nan"),
        ({"period_s": 5e-3}, PolesNotAssignable, "reduce the sample time"),
        ({"period_s": 0.03}, BeyondNyquist, "resonance"),
        ({"torque_limit_n_m": 0.0}, ServoError, "torque_limit_n_m = 0"),
        ({"torque_limit_n_m": math.nan}, ServoError, "torque_limit_n_m = nan"),
        ({"feed_forward": "dynamics"}, ServoError, "did you mean 'dynamic'"),
        (
            {"feed_forward": "dynamic", "load_filter": LoadFilter.binomial(2)},
            Improper,
            "must be >= 3",
        ),
        (
            {"estimator": sampled_kalman(LISTED, Noise(), 2e-3)},
            ServoError,
            "estimator of 0.002 s; must be the same",
        ),
        ({"estimator": Estimator((0.0, 0.0, 0.0, 0.0))}, PolesNotAssignable, "real part <"),
        ({"feedback": Feedback((1.0, 1.0, 0.0, 0.0), 1.0)}, PolesNotAssignable, "real part <"),
    ],
)
def test_drives_that_cannot_be_are_refused(keys, error, match):
    whole = {"joint": LISTED, "feedback": FEEDBACK, "estimator": ESTIMATOR, "period_s": 1e-3} | keys
    with pytest.raises(error, match=match):
        StateSpaceController(**whole)
