"""Motor check against the two tasks of source 000, sampling, quadrature and properties."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.errors import PlanError
from planners.laws import LAWS
from planners.trajectories.pieces import ExpPolynomial, ModalTerm, Smooth, polynomial
from planners.trajectories.trajectory import Trajectory
from rig.drives.motor import Drivetrain, Motor, check_motor, effort, operating_points, torque

DATA = tomllib.loads((Path(__file__).parents[2] / "data" / "spectra.toml").read_text())["motor"]
MOTOR = Motor(continuous_torque_n_m=8.0, peak_torque_n_m=20.0, max_speed_rad_s=10.0)
SHAFT = Drivetrain(motor_inertia_kg_m2=1.0, motor_friction_n_m_s_rad=0.3)
RAMP_S = (3.0 - math.sqrt(5.0)) / 2.0  # of the trapezoid: 15 rad/s2 (3 s - ramp) ramp = 15 rad
TASKS = {
    "cycloidal": Trajectory(
        (ExpPolynomial(3.0, (0.0, 5.0), (ModalTerm(2j * math.pi / 3.0, (15j / (2 * math.pi),)),)),)
    ),
    "trapezoidal": Trajectory(
        (
            polynomial(RAMP_S, (0.0, 0.0, 7.5)),
            polynomial(3.0 - 2.0 * RAMP_S, (7.5 * RAMP_S**2, 15.0 * RAMP_S)),
            polynomial(RAMP_S, (15.0 - 7.5 * RAMP_S**2, 15.0 * RAMP_S, -7.5)),
        )
    ),
}
numbers = st.floats(-2, 2)
motions = st.builds(
    lambda d, c, s, w, a: Trajectory(
        (ExpPolynomial(d, tuple(c), (ModalTerm(complex(s, w), (complex(a, 0.2), 0.1j)),)),)
    ),
    st.floats(0.2, 2.0),
    st.lists(numbers, min_size=2, max_size=5),
    st.floats(-1, 1),
    st.floats(0.0, 20.0),
    numbers,
)


@pytest.mark.parametrize("name", TASKS)
def test_the_source_s_tasks_have_the_torque_of_the_closed_form_and_are_feasible(name):
    figures, verdict = DATA[name], check_motor(MOTOR, SHAFT, TASKS[name])
    assert verdict.effort.rms_torque_n_m == pytest.approx(figures["rms_n_m"], rel=1e-12)
    assert verdict.effort.peak_torque_n_m.value == pytest.approx(figures["peak_n_m"], abs=6e-7)
    assert verdict.effort.peak_speed_rad_s.value == pytest.approx(figures["speed_rad_s"], rel=1e-12)
    assert verdict.feasible


def test_one_of_the_two_printed_rms_torques_is_right_and_the_other_a_quarter_of_a_percent_low():
    off = {
        name: check_motor(MOTOR, SHAFT, task).cycle_torque_n_m / DATA[name]["published_rms_n_m"]
        for name, task in TASKS.items()
    }
    assert off["cycloidal"] == pytest.approx(1.0, abs=1e-6)
    assert off["trapezoidal"] == pytest.approx(1.0025, abs=1e-5)


def test_a_speed_that_is_the_limit_to_rounding_keeps_it_and_one_above_does_not():
    for factor, kept in ((1.0, True), (1.0 + 1e-12, True), (1.0 + 1e-6, False)):
        verdict = check_motor(MOTOR, SHAFT, TASKS["cycloidal"].scaled(factor))
        assert (verdict.feasible, verdict.tightest) == (kept, "speed")


def test_the_sign_of_a_move_does_not_matter_to_its_verdict():
    one, other = (
        check_motor(MOTOR, SHAFT, TASKS["trapezoidal"]),
        check_motor(MOTOR, SHAFT, TASKS["trapezoidal"].scaled(-1.0)),
    )
    assert one.margins == pytest.approx(other.margins, rel=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_peaks_bound_the_sampled_curve_and_are_met_by_it(name):
    law = LAWS[name](0.8).scaled(2.0)
    need, (speed, twist) = effort(SHAFT, law), operating_points(SHAFT, law, 4001)
    sampled = np.abs(twist).max(), np.abs(speed).max(), np.abs(twist * speed).max()
    exact = need.peak_torque_n_m.value, need.peak_speed_rad_s.value, need.peak_power_w.value
    assert np.all(np.array(sampled) <= np.array(exact) * (1 + 1e-12))
    np.testing.assert_allclose(sampled, exact, rtol=1e-5)


@settings(max_examples=40)
@given(motions)
def test_effort_between_any_two_speeds_agrees_with_quadrature_and_sampling(motion):
    x, w = np.polynomial.legendre.leggauss(300)
    t = motion.duration_s * (1 + x) / 2
    twist, speed = motion.at(t, 2) + 0.3 * motion.at(t, 1), motion.at(t, 1)
    need = effort(SHAFT, motion)
    assert need.rms_torque_n_m == pytest.approx(
        math.sqrt(float(w @ twist**2) / 2.0), rel=1e-9, abs=1e-12
    )
    assert need.peak_power_w.value >= np.abs(twist * speed).max() * (1 - 1e-9) - 1e-12
    assert need.peak_power_w.value == pytest.approx(
        abs(
            float(
                torque(SHAFT, motion).at(need.peak_power_w.t_s)
                * motion.at(need.peak_power_w.t_s, 1)
            )
        ),
        rel=1e-9,
        abs=1e-9,
    )


def test_a_smooth_motion_has_the_effort_of_the_closed_form_that_it_copies():
    law = LAWS["septic"](0.9)
    twin = Trajectory(tuple(Smooth(p.duration_s, p.at, 4) for p in law.pieces))
    one, other = effort(SHAFT, law), effort(SHAFT, twin)
    for a, b in (
        (one.peak_torque_n_m, other.peak_torque_n_m),
        (one.peak_power_w, other.peak_power_w),
    ):
        assert a.value == pytest.approx(b.value, rel=1e-10)
    assert one.rms_torque_n_m == pytest.approx(other.rms_torque_n_m, rel=1e-10)


def test_a_gear_divides_the_load_by_its_square_and_multiplies_the_speed():
    """The torque at the shaft is the motor's own, and the load's over the ratio."""
    law, ratio = LAWS["quintic"](1.0), 12.0
    geared = Drivetrain(
        motor_inertia_kg_m2=2e-4,
        load_inertia_kg_m2=0.3,
        motor_friction_n_m_s_rad=1e-3,
        load_friction_n_m_s_rad=0.2,
        gear_ratio=ratio,
    )
    t = np.linspace(0.0, 1.0, 21)
    speed, acceleration = law.at(t, 1), law.at(t, 2)
    expected = (
        ratio * (2e-4 * acceleration + 1e-3 * speed) + (0.3 * acceleration + 0.2 * speed) / ratio
    )
    np.testing.assert_allclose(torque(geared, law).at(t), expected, rtol=1e-12, atol=1e-14)
    assert effort(geared, law).peak_speed_rad_s.value == pytest.approx(
        ratio * law.peak(1).value, rel=1e-12
    )


def test_a_mass_on_a_drum_has_its_inertia_and_its_speed_over_the_radius():
    law, radius_m = LAWS["cubic"](2.0).scaled(0.5), 0.04
    drum = Drivetrain(
        motor_inertia_kg_m2=1e-5, load_inertia_kg_m2=3.0 * radius_m**2, radius_m=radius_m
    )
    need = effort(drum, law)
    assert need.peak_speed_rad_s.value == pytest.approx(law.peak(1).value / radius_m, rel=1e-12)
    inertia = 1e-5 + 3.0 * radius_m**2
    assert need.peak_torque_n_m.value == pytest.approx(
        inertia * law.peak(2).value / radius_m, rel=1e-12
    )


def test_the_least_rest_between_the_moves_brings_the_rms_torque_to_its_limit():
    small = Motor(continuous_torque_n_m=5.0, peak_torque_n_m=20.0, max_speed_rad_s=10.0)
    hot = check_motor(small, SHAFT, TASKS["trapezoidal"])
    assert (hot.feasible, hot.tightest) == (False, "thermal")
    cool = check_motor(small, SHAFT, TASKS["trapezoidal"], rest_s=hot.least_rest_s)
    assert cool.feasible
    assert cool.cycle_torque_n_m == pytest.approx(5.0, rel=1e-12)
    held = TASKS["trapezoidal"].then(
        Trajectory.hold(15.0, hot.least_rest_s)
    )  # rest written as part of the motion
    assert effort(SHAFT, held).rms_torque_n_m == pytest.approx(5.0, rel=1e-12)


def test_a_power_limit_can_be_the_tightest_limit():
    assert (
        check_motor(
            Motor(
                continuous_torque_n_m=8.0,
                peak_torque_n_m=20.0,
                max_speed_rad_s=10.0,
                peak_power_w=95.0,
            ),
            SHAFT,
            TASKS["trapezoidal"],
        ).tightest
        == "power"
    )
    verdict = check_motor(MOTOR, SHAFT, TASKS["trapezoidal"])
    assert verdict.effort.peak_power_w.value == pytest.approx(
        16.718847050625474 * 5.729490168751577, rel=1e-12
    )
    assert verdict.power_margin == 1.0


def test_the_outline_is_the_edge_of_torque_speed_and_power():
    motor = Motor(
        continuous_torque_n_m=8.0, peak_torque_n_m=20.0, max_speed_rad_s=10.0, peak_power_w=100.0
    )
    speed, edge = motor.outline(motor.peak_torque_n_m, points=11)
    np.testing.assert_allclose(speed, np.arange(11.0))
    np.testing.assert_allclose(edge, [20.0] * 6 + [100 / 6, 100 / 7, 12.5, 100 / 9, 10.0])
    np.testing.assert_allclose(MOTOR.outline(MOTOR.continuous_torque_n_m)[1], 8.0)


def test_a_step_of_torque_is_drawn_as_one():
    speed, twist = operating_points(SHAFT, TASKS["trapezoidal"], 3)
    assert speed[2] == pytest.approx(speed[3])
    assert twist[2] - twist[3] == pytest.approx(15.0)


def test_many_pieces_are_checked_like_one():
    whole = LAWS["quintic"](2.0)
    cut = Trajectory(tuple(whole.pieces[0].window(0.05 * k, 0.05) for k in range(40)))
    one, other = effort(SHAFT, whole), effort(SHAFT, cut)
    assert other.rms_torque_n_m == pytest.approx(one.rms_torque_n_m, rel=1e-10)
    assert other.peak_power_w.value == pytest.approx(one.peak_power_w.value, rel=1e-10)


def test_a_step_in_speed_is_refused_and_a_start_at_speed_is_not():
    begun = Trajectory((polynomial(1.0, (0.0, 1.0)), polynomial(1.0, (1.0, 2.0))))
    with pytest.raises(PlanError, match=r"speed steps by 1 at 1 s; must be 0 for a motor"):
        check_motor(MOTOR, SHAFT, begun)
    assert check_motor(
        MOTOR, SHAFT, Trajectory(begun.pieces[:1])
    ).effort.rms_torque_n_m == pytest.approx(0.3)


def test_invalid_motors_and_drivetrains_are_refused_by_name_value_and_bound():
    with pytest.raises(PlanError, match=r"max_speed_rad_s = 0\.0; must be 1e-12 to"):
        Motor(continuous_torque_n_m=1.0, peak_torque_n_m=2.0, max_speed_rad_s=0.0)
    with pytest.raises(
        PlanError, match=r"continuous_torque_n_m = 3\.0; must be <= peak_torque_n_m = 2\.0"
    ):
        Motor(continuous_torque_n_m=3.0, peak_torque_n_m=2.0, max_speed_rad_s=1.0)
    with pytest.raises(PlanError, match=r"gear_ratio = 0\.0; must be 1e-12 to"):
        Drivetrain(motor_inertia_kg_m2=1.0, gear_ratio=0.0)
    with pytest.raises(PlanError, match=r"load_inertia_kg_m2 = -1\.0; must be 1e-12 to"):
        Drivetrain(motor_inertia_kg_m2=1.0, load_inertia_kg_m2=-1.0)
    with pytest.raises(PlanError, match="inertia_kg_m2 = 0 of a drivetrain"):
        Drivetrain(motor_inertia_kg_m2=0.0)
    with pytest.raises(PlanError, match=r"rest_s = nan"):
        check_motor(MOTOR, SHAFT, TASKS["cycloidal"], rest_s=math.nan)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: Drivetrain(motor_inertia_kg_m2=1.0, gear_ratio=1e-200),
            "gear_ratio = 1e-200; must be 1e-12 to",
        ),
        (
            lambda: Motor(continuous_torque_n_m=1.0, peak_torque_n_m=2.0, max_speed_rad_s=math.inf),
            "max_speed_rad_s = inf; must be 1e-12 to",
        ),
        (lambda: MOTOR.outline(math.nan), "torque_n_m = nan; must be"),
        (
            lambda: check_motor(MOTOR, SHAFT, TASKS["cycloidal"].scaled(1e300)),
            r"position = .*e\+\d+; must be -1e\+09 to",
        ),
    ],
)
def test_numbers_beyond_all_machines_are_refused_by_name(call, words):
    with pytest.raises(PlanError, match=words):
        call()
