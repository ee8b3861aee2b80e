"""Torque disturbance observer against three references.

Poles of the reference data, equations solved at a frequency, and a joint integrated exactly.
"""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from rig.drives.servo.cascade import Cascade, CascadeController
from rig.drives.servo.disturbance_design import ObserverDesign
from rig.drives.servo.disturbance_observer import Compensated, DisturbanceObserver
from rig.drives.servo.errors import BeyondNyquist, Improper, ServoError
from rig.drives.servo.loops import oscillatory_pairs, pole_pairs
from rig.drives.servo.nominal import LowPass, Nominal
from rig.drives.servo.setpoint import MotorSetpoint
from rig.drives.servo.two_mass import TwoMass

FIGURES = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_loops.toml").read_text())
KNOWN = FIGURES["observer"]
DRIVE = TwoMass(**FIGURES["drive"])
NOMINALS = {
    "rigid": Nominal.motor_alone(DRIVE),
    "whole": Nominal.rigid_joint(DRIVE),
    "elastic": Nominal.elastic(DRIVE),
}
PERIOD_S = 1e-4


def design(time_constant_s=2e-3, nominal="rigid", order=1, kind="binomial", measured="speed"):
    low_pass = LowPass(time_constant_s=time_constant_s, order=order, kind=kind)
    return ObserverDesign(low_pass=low_pass, nominal=NOMINALS[nominal], measured=measured)


def value(polynomial, s):
    return complex(np.polyval(polynomial, s))


class Resting:
    """Controller without torque."""

    def step(self, setpoint, motor_angle_rad):
        return 0.0

    def reset(self):
        pass


def run(joint, controller, steps, period_s=PERIOD_S, motor_torque=0.0, load_torque=0.0):
    """Compute states [qm, qm', n ql, n ql'] and torques.

    From the equations of the joint and a matrix exponential.
    """
    jm, jl = joint.motor_inertia_kg_m2, joint.load_inertia_kg_m2 / joint.gear_ratio**2
    spring = np.array([joint.stiffness_n_m_rad, joint.elastic_damping_n_m_s_rad])
    spring = np.array([*spring, *-spring])
    motor = -spring / jm - np.array([0, joint.motor_friction_n_m_s_rad / jm, 0, 0])
    whole = np.zeros((6, 6))
    whole[:4] = [
        [0, 1, 0, 0, 0, 0],
        [*motor, 1 / jm, 0],
        [0, 0, 0, 1, 0, 0],
        [*(spring / jl), 0, 1 / jl],
    ]
    step, x, states, torques = expm(whole * period_s)[:4], np.zeros(4), [], []
    for _ in range(steps):
        torque = controller.step(MotorSetpoint(0.0), float(x[0]))
        states.append(x)
        torques.append(torque)
        x = step @ np.array([*x, torque + motor_torque, load_torque])
    return np.array(states), np.array(torques)


# Q


@given(st.floats(1e-5, 10.0), st.integers(1, 8), st.sampled_from(["binomial", "butterworth"]))
def test_q_passes_all_at_zero_and_falls_with_its_order(time_constant_s, order, kind):
    q = LowPass(time_constant_s=time_constant_s, order=order, kind=kind).denominator
    assert q.size == order + 1
    assert q[-1] == pytest.approx(1.0, rel=1e-9)
    corner = abs(1.0 / value(q, 1j / time_constant_s))
    assert corner == pytest.approx(
        2.0 ** (-order / 2.0) if kind == "binomial" else math.sqrt(0.5), rel=1e-6
    )
    assert abs(1.0 / value(q, 1e3j / time_constant_s)) == pytest.approx(1e3**-order, rel=1e-3)


# the closed form


@pytest.mark.parametrize("index", range(4))
def test_the_elastic_pair_over_the_time_constant_is_the_reference_s(index):
    pair = design(KNOWN["time_constant_s"][index]).least_damped(DRIVE)
    assert pair.frequency_rad_s == pytest.approx(KNOWN["elastic_rad_s"][index], rel=1e-6)
    assert pair.damping == pytest.approx(KNOWN["elastic_damping"][index], rel=1e-6)


def test_a_very_fast_q_leaves_the_motor_alone_and_the_load_at_the_locked_rotor_pair():
    motor, load, _ = pole_pairs(design(1e-9).poles_1_s(DRIVE))
    assert motor.frequency_rad_s == pytest.approx(KNOWN["motor_pole_rad_s"], rel=1e-6)
    assert load.frequency_rad_s == pytest.approx(KNOWN["locked_rotor_rad_s"], rel=1e-6)
    assert load.damping == pytest.approx(KNOWN["locked_rotor_damping"], rel=1e-5)


def test_a_very_slow_q_leaves_the_joint_its_own_poles():
    found = sorted(design(1e9).poles_1_s(DRIVE), key=abs)[1:]
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(DRIVE.poles_1_s), rtol=1e-6)


@pytest.mark.parametrize("time_constant_s", [1e-5, 5e-4, 2e-3, 0.3])
def test_the_lecture_s_h_f_with_the_load_s_inertia_is_this_closed_form(time_constant_s):
    j, jl = DRIVE, DRIVE.load_inertia_kg_m2 / DRIVE.gear_ratio**2
    for s in (3.0 + 40.0j, -20.0 + 150.0j, 900.0j):
        spring = j.elastic_damping_n_m_s_rad * s + j.stiffness_n_m_rad
        high = s * time_constant_s / (1.0 + s * time_constant_s)
        motor = j.motor_inertia_kg_m2 * s**2 + j.motor_friction_n_m_s_rad * s
        h_f = (jl * s**2 + spring) * motor + high * spring * jl * s**2
        found = design(time_constant_s)
        assert found.command(j, "motor").at(s / 1j) / s == pytest.approx(
            (jl * s**2 + spring) / h_f, rel=1e-10
        )
        assert found.command(j, "load").at(s / 1j) / s == pytest.approx(spring / h_f, rel=1e-10)
        assert found.disturbance(j, "motor", "load").at(s / 1j) / s == pytest.approx(
            high * spring / h_f, rel=1e-10
        )


@pytest.mark.parametrize("nominal", NOMINALS)
@pytest.mark.parametrize(("order", "kind"), [(1, "binomial"), (2, "butterworth"), (3, "binomial")])
def test_disturbance_and_command_are_those_of_the_equations_solved_at_a_frequency(
    nominal, order, kind
):
    """Four linear equations of motor, load and observer.

    Unknown: the two speeds, the torque and its estimate.
    """
    j, jl = DRIVE, DRIVE.load_inertia_kg_m2 / DRIVE.gear_ratio**2
    observer = design(1.3e-3, nominal, order, kind)
    for omega in (2.0, 90.0, 180.0, 1500.0):
        s = 1j * omega
        spring = j.elastic_damping_n_m_s_rad + j.stiffness_n_m_rad / s
        q = 1.0 / value(observer.low_pass.denominator, s)
        inverse = value(observer.nominal.denominator, s) / value(observer.nominal.numerator, s)
        motor = [
            j.motor_inertia_kg_m2 * s + j.motor_friction_n_m_s_rad + spring,
            -spring,
            -1.0,
            -1.0,
        ]  # motor, load, wanted, added
        load = [-spring, jl * s + spring, 0.0, 0.0]
        estimate = [q * inverse, 0.0, -q, 1.0 - q]
        equations = np.array([motor, load, [0.0, 0.0, 1.0, 0.0], estimate])
        for torque, speeds in (
            ([1, 0, 0, 0], ("motor",)),
            ([0, 1, 0, 0], ("load",)),
            ([0, 0, 1, 0], ("command",)),
        ):
            right = np.linalg.solve(equations, np.array(torque, dtype=complex))
            for index, speed in enumerate(("motor", "load")):
                ratio = (
                    observer.command(j, speed)
                    if speeds == ("command",)
                    else observer.disturbance(j, speeds[0], speed)
                )
                assert complex(ratio.at(omega)) == pytest.approx(right[index], rel=1e-8)


@pytest.mark.parametrize("nominal", NOMINALS)
@pytest.mark.parametrize("torque", ["motor", "load"])
def test_a_constant_torque_moves_nothing_in_the_end(nominal, torque):
    for speed in ("motor", "load"):
        assert abs(design(nominal=nominal).disturbance(DRIVE, torque, speed).at(0.0)) < 1e-12
    bare = (
        DRIVE.load_numerator[-1] / DRIVE.denominator[-2]
    )  # without observer friction alone holds it
    assert bare == pytest.approx(1.0 / FIGURES["drive"]["motor_friction_n_m_s_rad"], rel=1e-9)


def test_the_elastic_nominal_keeps_the_joint_s_poles_and_filters_only_what_is_not_the_joint_s():
    observer, omega = design(5e-4, "elastic"), np.array([1.0, 50.0, 179.0, 900.0])
    pair = observer.least_damped(DRIVE)
    assert pair == pytest.approx(oscillatory_pairs(DRIVE.poles_1_s)[0], rel=1e-9)
    plant = DRIVE.plant["motor_speed", "motor_torque"]
    high = 1j * omega * 5e-4 / (1.0 + 1j * omega * 5e-4)
    np.testing.assert_allclose(
        observer.disturbance(DRIVE, "motor", "motor").at(omega), high * plant(1j * omega), rtol=1e-9
    )
    np.testing.assert_allclose(
        observer.command(DRIVE, "motor").at(omega), plant(1j * omega), rtol=1e-9
    )
    (hidden,) = pole_pairs(observer.cancelled_poles_1_s(DRIVE))
    assert hidden.frequency_rad_s == pytest.approx(KNOWN["locked_rotor_rad_s"], rel=1e-6)


def test_an_elastic_nominal_of_another_joint_has_poles_of_its_own():
    other = TwoMass(**{**FIGURES["drive"], "stiffness_n_m_rad": 3.5})
    found = design(5e-4, "elastic").poles_1_s(other)
    assert design(5e-4, "elastic").cancelled_poles_1_s(other).size == 0
    assert len(found) == 6
    assert np.all(found.real < 0.0)


@pytest.mark.parametrize("nominal", NOMINALS)
@pytest.mark.parametrize(
    ("measured", "order", "kind"),
    [("speed", 1, "binomial"), ("speed", 3, "butterworth"), ("angle", 2, "binomial")],
)
def test_the_estimator_is_q_over_the_nominal(nominal, measured, order, kind):
    observer = design(2e-3, nominal, order, kind, measured)
    for s in (10j, 300j, 5000j):
        q = 1.0 / value(observer.low_pass.denominator, s)
        inverse = (
            value(observer.nominal.denominator, s)
            / value(observer.nominal.numerator, s)
            * (s if measured == "angle" else 1.0)
        )
        np.testing.assert_allclose(observer.estimator()(s), [[q, -q * inverse]], rtol=1e-8)


@pytest.mark.parametrize("nominal", NOMINALS)
@pytest.mark.parametrize(("measured", "order"), [("speed", 1), ("angle", 2)])
def test_the_loop_of_blocks_is_the_closed_form(nominal, measured, order):
    observer = design(2e-3, nominal, order, "binomial", measured)
    loop, s = observer.loop(DRIVE), 1j * np.array([2.0, 90.0, 180.0, 1500.0])
    for source, torque in (("motor_torque", "motor"), ("load_torque", "load")):
        for speed in ("motor", "load"):
            right = observer.disturbance(DRIVE, torque, speed).at(s.imag)
            np.testing.assert_allclose(loop.closed[f"{speed}_speed", source](s), right, rtol=1e-6)
    q = 1.0 / np.polyval(observer.low_pass.denominator, s)
    plant = np.polyval(DRIVE.motor_numerator, s) / np.polyval(DRIVE.denominator[:-1], s)
    inverse = np.polyval(observer.nominal.denominator, s) / np.polyval(
        observer.nominal.numerator, s
    )
    np.testing.assert_allclose(loop.opened(s), q / (1.0 - q) * plant * inverse, rtol=1e-6)


def test_a_joint_that_is_the_nominal_leaves_the_observer_the_margins_of_its_filter_alone():
    """Loop transfer function Q / (1 - Q) = 1 / (s Tf).

    Phase margin 90 degrees at 1 / Tf, gain margin infinite.
    """
    found = design(1.0 / 300.0, "elastic").loop(DRIVE).analysis.margins
    assert (found.phase_margin_deg, found.crossover_rad_s) == pytest.approx((90.0, 300.0), rel=1e-4)
    assert found.upper_gain_margin > 1e6


# sampled


@pytest.mark.parametrize("nominal", NOMINALS)
@pytest.mark.parametrize(
    ("measured", "order", "kind"),
    [("speed", 1, "binomial"), ("speed", 3, "butterworth"), ("angle", 2, "binomial")],
)
def test_a_constant_torque_on_the_motor_is_found_and_cancelled(nominal, measured, order, kind):
    observer = DisturbanceObserver(design(2e-3, nominal, order, kind, measured), PERIOD_S)
    states, torques = run(DRIVE, Compensated(Resting(), observer), 10_000, motor_torque=0.1)
    assert torques[-1] == pytest.approx(-0.1, abs=1e-6)
    assert abs(states[-1, 1]) < 1e-2 * np.abs(states[:, 1]).max()


@pytest.mark.parametrize("measured", ["speed", "angle"])
def test_for_a_rigid_load_without_friction_the_sampled_observer_is_exact(measured):
    """Torques held for a sample, and the resulting angles.

    The torque to add stays 0 at any sample time.
    """
    inertia, period_s = 4e-4, 1e-3
    low_pass = LowPass(time_constant_s=2e-3, order=2)
    observer = DisturbanceObserver(
        ObserverDesign(low_pass=low_pass, nominal=Nominal.rigid(inertia), measured=measured),
        period_s,
    )
    angle = speed = torque = 0.0
    for index in range(200):
        assert abs(observer.step(torque, angle)) < 1e-9
        torque = math.sin(0.3 * index)
        angle += speed * period_s + torque / inertia * period_s**2 / 2.0
        speed += torque / inertia * period_s


@pytest.mark.parametrize(
    ("nominal", "time_constant_s"), [("rigid", 5e-4), ("rigid", 2e-3), ("elastic", 5e-4)]
)
def test_the_sampled_observer_acts_like_the_closed_form_with_a_time_constant_longer_by_a_sample(
    nominal, time_constant_s
):
    observer, steps, period_s = design(time_constant_s, nominal), 4000, 2e-5
    states, _ = run(
        DRIVE,
        Compensated(Resting(), DisturbanceObserver(observer, period_s)),
        steps,
        period_s,
        motor_torque=0.1,
    )
    top, below = design(time_constant_s + period_s, nominal).disturbance(DRIVE, "motor", "load")
    poles = np.roots(below)
    times = np.arange(steps) * period_s
    slope = np.polyder(below)
    right = (
        sum(  # residues of the step's response
            0.1 * value(top, p) / (p * value(slope, p)) * np.exp(p * times) for p in poles
        ).real
        + 0.1 * value(top, 0.0).real / value(below, 0.0).real
    )
    np.testing.assert_allclose(states[:, 3], right, atol=0.002 * np.abs(right).max())


class Push:
    """Controller that gives a torque for some samples."""

    def __init__(self, samples=20):
        self.samples = samples

    def step(self, setpoint, motor_angle_rad):
        self.samples -= 1
        return 0.2 if self.samples >= 0 else 0.0

    def reset(self):
        pass


def ring(time_constant_s, nominal):
    """Compute the twist of the coupling after a push, over its peak.

    (N,) from 0.15 s on; samples of 0.05 ms.
    """
    observer = DisturbanceObserver(design(time_constant_s, nominal), 5e-5)
    states, _ = run(DRIVE, Compensated(Push(), observer), 12_000, 5e-5)
    twist = states[:, 0] - states[:, 2]
    return twist[3000:] / np.abs(twist).max()


def test_with_a_fast_rigid_observer_the_load_rings_at_the_locked_rotor_pair():
    twist, pair = ring(2e-4, "rigid"), design(2.5e-4).least_damped(DRIVE)  # a sample longer
    tops = (
        np.flatnonzero(
            (np.abs(twist[1:-1]) > np.abs(twist[:-2])) & (np.abs(twist[1:-1]) >= np.abs(twist[2:]))
        )
        + 1
    )
    half_period_s = float(np.mean(np.diff(tops))) * 5e-5
    decrement = math.log(abs(twist[tops[0]] / twist[tops[-1]])) / (len(tops) - 1)
    damping = decrement / math.hypot(math.pi, decrement)
    frequency = math.pi / half_period_s / math.sqrt(1.0 - damping**2)
    assert frequency == pytest.approx(pair.frequency_rad_s, rel=0.01)
    assert frequency == pytest.approx(KNOWN["locked_rotor_rad_s"], rel=0.02)
    assert damping == pytest.approx(pair.damping, rel=0.02)
    assert damping < 0.6 * KNOWN["elastic_damping"][-1]  # of the joint without observer


def test_a_slower_rigid_observer_damps_the_load_and_the_elastic_one_does_not_change_it():
    bare_states, _ = run(DRIVE, Push(), 12_000, 5e-5)
    bare = bare_states[:, 0] - bare_states[:, 2]
    bare = bare[3000:] / np.abs(bare).max()
    fast, slow, elastic = (
        np.sqrt(np.mean(ring(*words) ** 2))
        for words in ((2e-4, "rigid"), (2e-3, "rigid"), (2e-4, "elastic"))
    )
    assert slow < 0.4 * fast
    np.testing.assert_allclose(elastic, np.sqrt(np.mean(bare**2)), rtol=0.05)


def test_under_a_cascade_the_observer_cuts_what_a_torque_on_the_motor_does():
    gains, peaks = Cascade.normalised(DRIVE, 0.7, 0.15), {}
    for name in ("none", "rigid", "elastic"):
        cascade = CascadeController(gains, 5e-4)
        controller = (
            cascade
            if name == "none"
            else Compensated(cascade, DisturbanceObserver(design(1e-3, name), 5e-4))
        )
        states, _ = run(DRIVE, controller, 1500, 5e-4, motor_torque=0.1)
        assert np.abs(states[-1, 1:]).max() < 0.05 * np.abs(states[:, 1:]).max()
        peaks[name] = np.abs(states[:, 2]).max()
    assert peaks["rigid"] < 0.5 * peaks["none"]
    assert peaks["elastic"] < 0.5 * peaks["none"]


def test_under_a_cascade_too_the_load_rings_after_a_torque_on_it_unless_a_rigid_q_is_slow():
    """Residual speed of the load 0.25 s after the step, with low gains."""
    gains, left = Cascade.normalised(DRIVE, 0.1, 0.03), {}
    for nominal, time_constant_s in (("rigid", 2e-4), ("rigid", 2e-3), ("elastic", 2e-4)):
        observer = DisturbanceObserver(design(time_constant_s, nominal), PERIOD_S)
        controller = Compensated(CascadeController(gains, PERIOD_S), observer)
        states, _ = run(DRIVE, controller, 5000, load_torque=0.1)
        left[nominal, time_constant_s] = np.abs(states[2500:, 3]).max()
    assert left["rigid", 2e-4] > 5.0 * left["rigid", 2e-3]
    assert left["elastic", 2e-4] > 5.0 * left["rigid", 2e-3]


def test_the_observer_receives_the_limited_torque():
    """A limited torque is no disturbance, so nothing is added."""
    limit, added_torques = 0.05, []

    class Greedy(Resting):
        def step(self, setpoint, motor_angle_rad):
            return 1.0

    class Listening(DisturbanceObserver):
        def step(self, torque_n_m, motor_angle_rad):
            added_torques.append(super().step(torque_n_m, motor_angle_rad))
            return added_torques[-1]

    observer = Listening(design(1e-3, "elastic"), PERIOD_S)
    _, torques = run(DRIVE, Compensated(Greedy(), observer, limit), 500)
    assert set(torques.tolist()) == {limit}
    assert np.abs(added_torques).max() < 0.02 * limit


def test_a_reset_observer_does_what_a_new_one_does():
    controller = Compensated(
        CascadeController(Cascade.normalised(DRIVE), PERIOD_S),
        DisturbanceObserver(design(), PERIOD_S),
    )
    first = [controller.step(MotorSetpoint(1.0, 2.0, 3.0), 0.01 * i) for i in range(20)]
    controller.reset()
    assert [controller.step(MotorSetpoint(1.0, 2.0, 3.0), 0.01 * i) for i in range(20)] == first


# refused


def test_a_q_that_would_have_to_differentiate_is_refused():
    with pytest.raises(
        Improper,
        match=r"order = 1 of Q .* to angle; must be >= 2: raise the order, or measure the speed",
    ):
        design(order=1, measured="angle")


def test_a_q_with_its_corner_beyond_nyquist_is_refused():
    with pytest.raises(
        BeyondNyquist, match=r"1 / time_constant_s = 10000 rad/s with a sample time of 0.001 s"
    ):
        DisturbanceObserver(design(1e-4), 1e-3)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: LowPass(time_constant_s=0.0), "time_constant_s = 0.0; must be"),
        (lambda: LowPass(time_constant_s=1.0, order=0), "order = 0; must be 1 to 8"),
        (lambda: Nominal.rigid(0.0), "inertia_kg_m2 = 0.0; must be"),
        (lambda: Nominal.rigid(1.0, -1.0), "friction_n_m_s_rad = -1.0; must be"),
        (
            lambda: Nominal.elastic(TwoMass.normalised(100.0, 1.0, 0.0)),
            "elastic_damping_n_m_s_rad = 0 .* must be > 0",
        ),
        (lambda: DisturbanceObserver(design(), math.nan), "period_s = nan; must be"),
        (
            lambda: Compensated(Resting(), DisturbanceObserver(design(), PERIOD_S), 0.0),
            "torque_limit_n_m = 0.0; must be",
        ),
    ],
)
def test_what_is_no_observer_is_refused(make, said):
    with pytest.raises(ServoError, match=said):
        make()
