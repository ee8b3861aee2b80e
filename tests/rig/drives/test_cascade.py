"""Cascade against three references.

Poles of the reference data, polynomials derived by hand, and a joint integrated by the test.
"""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from rig.drives.servo.cascade import Cascade, CascadeController
from rig.drives.servo.errors import BeyondNyquist, ServoError
from rig.drives.servo.loops import PolePair, oscillatory_pairs, pole_pairs
from rig.drives.servo.notch import Notch
from rig.drives.servo.setpoint import MotorSetpoint
from rig.drives.servo.two_mass import TwoMass
from rig.drives.servo.wiring import position_loop

FIGURES = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_loops.toml").read_text())
EXAMPLE = FIGURES["example"]
JOINT = TwoMass.normalised(
    EXAMPLE["antiresonance_rad_s"], EXAMPLE["inertia_ratio"], EXAMPLE["antiresonance_damping"]
)
DRIVE = TwoMass(**FIGURES["drive"])
GAINS = Cascade.normalised(JOINT)
INSIDE = Notch.tuned_to(oscillatory_pairs(JOINT.poles_1_s)[-1])
UPSTREAM = Notch.tuned_to(oscillatory_pairs(GAINS.speed_loop(JOINT).controllable_poles_1_s)[-1])
PLACES = [(None, "inside"), (INSIDE, "inside"), (UPSTREAM, "upstream")]


class Joint:
    """Two-mass joint, integrated exactly from its equations: [qm, qm', n ql, n ql']."""

    def __init__(self, joint, period_s):
        jm, jl = joint.motor_inertia_kg_m2, joint.load_inertia_kg_m2 / joint.gear_ratio**2
        k, d = joint.stiffness_n_m_rad, joint.elastic_damping_n_m_s_rad
        spring = np.array([k, d, -k, -d])
        motor = -spring / jm - np.array([0, joint.motor_friction_n_m_s_rad / jm, 0, 0])
        whole = np.zeros((6, 6))
        whole[:4] = [
            [0, 1, 0, 0, 0, 0],
            [*motor, 1 / jm, 0],
            [0, 0, 0, 1, 0, 0],
            [*(spring / jl), 0, 1 / jl],
        ]
        self.step_matrix, self.x = expm(whole * period_s)[:4], np.zeros(4)

    def run(self, controller, setpoint, steps, motor_torque=0.0, load_torque=0.0):
        """States and torques, (steps, 4) and (steps,), each state before its torque."""
        states, torques = [], []
        for index in range(steps):
            wanted = setpoint(index) if callable(setpoint) else setpoint
            torque = controller.step(wanted, float(self.x[0]))
            states.append(self.x)
            torques.append(torque)
            self.x = self.step_matrix @ np.array([*self.x, torque + motor_torque, load_torque])
        return np.array(states), np.array(torques)


def test_normalised_gains_are_those_of_the_example():
    for name, value in EXAMPLE["gains"].items():
        assert getattr(GAINS, name) == pytest.approx(value, rel=1e-12)


def test_the_speed_loop_has_the_poles_and_the_margin_of_the_reference():
    for name, notch in (("none", None), ("inside", INSIDE)):
        loop, known = GAINS.speed_loop(JOINT, notch), EXAMPLE[name]
        shown = pole_pairs(loop.controllable_poles_1_s)
        assert [mode.frequency_rad_s for mode in shown] == pytest.approx(
            known["speed_rad_s"], rel=1e-5
        )
        assert [mode.damping for mode in shown] == pytest.approx(known["speed_damping"], abs=1e-5)
        assert loop.analysis.margins.phase_margin_deg == pytest.approx(
            known["phase_margin_deg"], abs=1e-3
        )
    assert GAINS.speed_loop(JOINT).analysis.margins.crossover_rad_s == pytest.approx(
        EXAMPLE["none"]["crossover_rad_s"], rel=1e-5
    )


def test_the_position_loop_has_the_poles_of_the_reference_and_a_cancelled_pair():
    for name, (notch, where) in zip(("none", "inside", "upstream"), PLACES, strict=True):
        loop, known = GAINS.position_loop(JOINT, notch, where), EXAMPLE[name]
        shown, hidden = (
            pole_pairs(loop.controllable_poles_1_s),
            pole_pairs(loop.cancelled_poles_1_s),
        )
        assert [mode.frequency_rad_s for mode in shown] == pytest.approx(
            known["position_rad_s"], rel=1e-5
        )
        assert [mode.damping for mode in shown] == pytest.approx(
            known["position_damping"], abs=1e-5
        )
        if notch is None:
            assert hidden == ()
        else:
            ((frequency, damping),) = hidden
            assert (frequency, damping) == pytest.approx(
                (known["hidden_rad_s"], known["hidden_damping"]), rel=1e-5
            )
        assert len(loop.analysis.pole_pairs) == len(shown) + len(hidden)


def test_a_notch_beside_the_pair_cancels_no_pole():
    off = Notch.tuned_to(PolePair(0.9 * INSIDE.frequency_rad_s, INSIDE.numerator_damping))
    assert GAINS.position_loop(JOINT, off).cancelled_poles_1_s.size == 0
    assert len(pole_pairs(GAINS.position_loop(JOINT, off).controllable_poles_1_s)) == 5


@pytest.mark.parametrize("filter_s", [0.0, 5e-4])
def test_closed_loops_are_the_hand_polynomial_of_any_joint(filter_s):
    """Polynomial of the closed position loop.

    Tiv s (s D (1 + s Tf) N2) + Kpv (1 + Tiv s)(s + Kpp (1 + s Tf)) Nm N1, with s D the denominator
    of the angles.
    """
    gains = Cascade.normalised(DRIVE, 0.7, 0.15, speed_filter_s=filter_s)
    notch = Notch(frequency_rad_s=150.0, numerator_damping=0.2, denominator_damping=0.8)
    lag = [filter_s, 1.0] if filter_s else [1.0]
    pi = gains.speed_gain_n_m_s_rad * np.array([gains.reset_time_s, 1.0])
    outer = np.polyadd([1.0, 0.0], gains.position_gain_1_s * np.array(lag))
    below = np.polymul(
        np.polymul([gains.reset_time_s, 0.0], lag), np.polymul(DRIVE.denominator, notch.denominator)
    )
    above = np.polymul(np.polymul(pi, outer), np.polymul(DRIVE.motor_numerator, notch.numerator))
    whole = np.polyadd(below, above)
    found = gains.position_loop(DRIVE, notch).closed.poles()
    np.testing.assert_allclose(np.poly(found), whole / whole[0], rtol=1e-6)


@pytest.mark.parametrize(("notch", "where"), PLACES)
def test_the_opened_loop_is_the_product_of_its_blocks(notch, where):
    loop, s = (
        GAINS.position_loop(JOINT, notch, where),
        1j * np.array([3.0, 40.0, 190.0, 260.0, 2000.0]),
    )
    passed = (
        np.ones_like(s)
        if notch is None
        else np.polyval(notch.numerator, s) / np.polyval(notch.denominator, s)
    )
    inside, upstream = (passed, 1.0) if where == "inside" else (1.0, passed)
    pi = GAINS.speed_gain_n_m_s_rad * (1.0 + 1.0 / (GAINS.reset_time_s * s))
    plant = np.polyval(JOINT.motor_numerator, s) / np.polyval(JOINT.denominator, s)
    np.testing.assert_allclose(
        loop.opened(s), inside * pi * plant * (s + upstream * GAINS.position_gain_1_s), rtol=1e-7
    )


@pytest.mark.parametrize(("notch", "where"), PLACES)
def test_one_plus_the_sampled_loop_is_the_ratio_of_the_characteristic_polynomials(notch, where):
    loop = position_loop(JOINT, [GAINS.sampled(5e-4, notch, where)], 5e-4)
    for z in (1.1 + 0.2j, 0.9 + 0.3j, -0.5 + 0.1j):
        ratio = np.prod(z - loop.closed.poles()) / np.prod(z - loop.opened.poles())
        assert 1.0 + complex(loop.opened(z)) == pytest.approx(ratio, rel=1e-6)


def test_the_sampled_loop_tends_to_the_continuous_one():
    for notch, where in PLACES:
        right = pole_pairs(GAINS.position_loop(JOINT, notch, where).closed.poles())
        off = []
        for period_s in (4e-5, 1e-5):
            found = position_loop(
                JOINT, [GAINS.sampled(period_s, notch, where)], period_s
            ).analysis.pole_pairs
            near = [
                min(abs(mode.frequency_rad_s / one.frequency_rad_s - 1.0) for mode in found)
                for one in right
            ]
            off.append(max(near))
        assert off[1] < 0.3 * off[0] < 0.02


@pytest.mark.parametrize(("notch", "where"), PLACES)
@pytest.mark.parametrize("filter_s", [0.0, 2e-3])
def test_the_controller_moves_a_joint_as_its_sampled_loop_says(notch, where, filter_s):
    period_s, steps = 5e-4, 400
    gains = Cascade.normalised(
        JOINT, speed_filter_s=filter_s, feed_forward_inertia_kg_m2=0.7, speed_feed_forward=0.9
    )
    loop = position_loop(JOINT, [CascadeController(gains, period_s, notch, where).system], period_s)
    pushes = np.array(
        [1.0, 2.0, 30.0, 4.0, 5.0]
    )  # angle, speed, acceleration, motor and load torque
    controller = CascadeController(gains, period_s, notch, where)
    states, _ = Joint(JOINT, period_s).run(
        controller, MotorSetpoint(1.0, 2.0, 30.0), steps, motor_torque=4.0, load_torque=5.0
    )
    x, outputs = np.zeros(loop.closed.nstates), []
    for _ in range(steps):
        outputs.append(loop.closed.C @ x + loop.closed.D @ pushes)
        x = loop.closed.A @ x + loop.closed.B @ pushes
    np.testing.assert_allclose(states, outputs, atol=1e-9 * np.abs(states).max())


def test_sampled_fast_the_controller_does_what_the_continuous_loop_does():
    """Compare with joint, P, PI and their integrator, integrated by scipy."""

    def rate(_, x):
        motor, speed, load, load_speed, integral = x
        error = GAINS.position_gain_1_s * (1.0 - motor) - speed
        torque = GAINS.speed_gain_n_m_s_rad * (error + integral / GAINS.reset_time_s)
        twist = JOINT.stiffness_n_m_rad * (motor - load) + JOINT.elastic_damping_n_m_s_rad * (
            speed - load_speed
        )
        return speed, (torque - twist) / 0.5, load_speed, (twist - 3.0) / 0.5, error

    period_s, steps = 2e-5, 10_000
    found, _ = Joint(JOINT, period_s).run(
        CascadeController(GAINS, period_s), MotorSetpoint(1.0), steps, load_torque=-3.0
    )
    times = np.arange(0, steps, 500) * period_s
    right = (
        solve_ivp(rate, (0.0, steps * period_s), np.zeros(5), t_eval=times, rtol=1e-10, atol=1e-12)
        .y[:4]
        .T
    )
    scale = np.abs(right).max(axis=0)
    np.testing.assert_allclose(found[::500] / scale, right / scale, atol=5e-3)


def test_a_constant_torque_on_the_load_leaves_no_error_of_the_motor():
    states, torques = Joint(DRIVE, 1e-3).run(
        CascadeController(Cascade.normalised(DRIVE), 1e-3),
        MotorSetpoint(0.5),
        4000,
        load_torque=0.2,
    )
    assert states[-1, 0] == pytest.approx(0.5, abs=1e-7)
    assert torques[-1] == pytest.approx(-0.2, abs=1e-6)
    assert states[-1, 2] - states[-1, 0] == pytest.approx(0.2 / DRIVE.stiffness_n_m_rad, rel=1e-5)


def test_full_speed_feed_forward_tracks_a_ramp_and_a_share_lags_by_the_rest_over_the_gain():
    period_s, speed = 1e-3, 5.0
    for share in (1.0, 0.4):
        gains = Cascade.normalised(DRIVE, speed_feed_forward=share)
        controller = CascadeController(gains, period_s)
        states, _ = Joint(DRIVE, period_s).run(
            controller, lambda i: MotorSetpoint(speed * i * period_s, speed), 4000
        )
        lag = speed * 3999 * period_s - states[-1, 0]
        assert lag == pytest.approx((1.0 - share) * speed / gains.position_gain_1_s, abs=1e-6)


def test_the_torque_keeps_its_limit_and_the_integrator_does_not_wind_up():
    """A step that requires far more torque than the limit.

    Without anti-windup the same loop overshoots several times as far.
    """
    period_s, limit = 1e-3, 0.15
    gains = Cascade.normalised(DRIVE, 0.7, 0.15, reset_time=3.0, torque_limit_n_m=limit)

    class Winding:
        """The same law with an integrator that takes everything."""

        def __init__(self):
            self.free = CascadeController(
                Cascade.normalised(DRIVE, 0.7, 0.15, reset_time=3.0), period_s
            )  # knows no limit, its torque is cut afterwards

        def step(self, setpoint, motor_angle_rad):
            return min(max(self.free.step(setpoint, motor_angle_rad), -limit), limit)

    bound, torques = Joint(DRIVE, period_s).run(
        CascadeController(gains, period_s), MotorSetpoint(20.0), 3000
    )
    wound, _ = Joint(DRIVE, period_s).run(Winding(), MotorSetpoint(20.0), 3000)
    assert np.abs(torques).max() == limit
    assert np.mean(np.abs(torques) == limit) > 0.1
    assert bound[-1, 0] == pytest.approx(20.0, abs=1e-3)
    assert bound[:, 0].max() - 20.0 < 0.25 * (wound[:, 0].max() - 20.0)


def test_a_limited_torque_lets_the_integrator_work_the_other_way():
    """A feed-forward of three times the limit, and a motor ahead of its setpoint.

    Only the integrator can reduce the torque.
    """
    gains = Cascade(
        speed_gain_n_m_s_rad=0.1,
        reset_time_s=0.05,
        position_gain_1_s=10.0,
        torque_limit_n_m=1.0,
        feed_forward_inertia_kg_m2=0.03,
    )
    controller = CascadeController(gains, 1e-3)
    torques = [controller.step(MotorSetpoint(0.0, 0.0, 100.0), 0.5) for _ in range(1000)]
    assert torques[2] == 1.0
    assert torques[-1] == -1.0
    assert min(np.diff(torques[2:])) > -0.02


def test_after_a_long_push_beyond_its_limit_the_drive_comes_back_at_once():
    """A load torque above the limit, then none.

    The motor returns as soon as the load torque ends.
    """
    period_s, limit = 1e-3, 0.2
    gains = Cascade.normalised(DRIVE, torque_limit_n_m=limit)
    joint, controller = Joint(DRIVE, period_s), CascadeController(gains, period_s)
    joint.run(controller, MotorSetpoint(0.0), 500, load_torque=0.3)
    pushed = joint.x[0]
    states, torques = joint.run(controller, MotorSetpoint(0.0), 2000)
    assert pushed > 5.0
    assert states[:, 0].max() < 1.1 * pushed
    assert states[:, 0].min() > -0.05 * pushed
    assert abs(states[-1, 0]) < 1e-3
    assert abs(torques[-1]) < 1e-3


def test_a_reset_controller_does_what_a_new_one_does():
    for notch, where in PLACES:
        controller = CascadeController(GAINS, 1e-3, notch, where)
        first = [controller.step(MotorSetpoint(1.0, 2.0, 3.0), 0.01 * i) for i in range(20)]
        controller.reset()
        assert [controller.step(MotorSetpoint(1.0, 2.0, 3.0), 0.01 * i) for i in range(20)] == first


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"speed_gain_n_m_s_rad": 0.0}, "speed_gain_n_m_s_rad = 0.0; must be"),
        ({"reset_time_s": -1.0}, "reset_time_s = -1.0; must be"),
        ({"position_gain_1_s": math.nan}, "position_gain_1_s = nan; must be"),
        ({"speed_filter_s": -1e-3}, "speed_filter_s = -0.001; must be"),
        ({"torque_limit_n_m": 0.0}, "torque_limit_n_m = 0.0; must be"),
        ({"speed_feed_forward": 1.5}, "speed_feed_forward = 1.5; must be 0 to 1"),
        ({"feed_forward_inertia_kg_m2": -1.0}, "feed_forward_inertia_kg_m2 = -1.0; must be"),
    ],
)
def test_gains_out_of_bounds_are_refused(change, said):
    with pytest.raises(ServoError, match=said):
        Cascade(
            **{"speed_gain_n_m_s_rad": 1.0, "reset_time_s": 1.0, "position_gain_1_s": 1.0, **change}
        )


def test_a_controller_without_a_sample_time_or_with_a_notch_beyond_nyquist_is_refused():
    with pytest.raises(ServoError, match=r"period_s = 0.0; must be"):
        CascadeController(GAINS, 0.0)
    for make in (CascadeController, Cascade.sampled):
        with pytest.raises(BeyondNyquist, match=r"frequency_rad_s = 282.843 rad/s"):
            make(GAINS, 0.02, INSIDE)
