"""Disturbance observer whose nominal model is any transfer function.

Against the closed forms of the rigid and the elastic joint, a ball-screw axis solved at a
frequency, and a first-order plant.
"""

import math
import re
import tomllib
from pathlib import Path

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.drives.servo.disturbance_design import ObserverDesign
from rig.drives.servo.disturbance_observer import DisturbanceObserver
from rig.drives.servo.errors import Improper, ServoError
from rig.drives.servo.nominal import LowPass, Nominal
from rig.drives.servo.two_mass import TwoMass

FIGURES = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_loops.toml").read_text())
DRIVE = TwoMass(**FIGURES["drive"])
FREQUENCIES = np.array([0.5, 20.0, 150.0, 2000.0, 9000.0])
# ball-screw axis of the reference data: rotor with screw, nut on a spring, table
ROTOR_KG_M2, TABLE_KG = 1.4962e-4, 10.0
M_RAD = 0.02 / (2.0 * math.pi)  # lead 20 mm
STIFFNESS_N_M, DAMPING_N_S_M, GUIDE_N_S_M = 3.541e7, 1.165e3, 20.0


def design(nominal, time_constant_s=2e-3, order=1, measured="output"):
    low_pass = LowPass(time_constant_s=time_constant_s, order=order)
    return ObserverDesign(low_pass=low_pass, nominal=nominal, measured=measured)


def screw_from_torque(signal):
    """Polynomials of rotor speed or of table speed over torque, from the two balances.

    J w s = u - r F, m v s = F - g v, F = (k / s + c)(r w - v).
    """
    s = np.poly1d([1.0, 0.0])
    spring = np.poly1d([DAMPING_N_S_M, STIFFNESS_N_M])
    table = np.poly1d([TABLE_KG, GUIDE_N_S_M, 0.0]) + spring
    determinant = (ROTOR_KG_M2 * s * s + M_RAD**2 * spring) * table - (M_RAD * spring) ** 2
    numerator = {"rotor": table * s, "table": M_RAD * spring * s}[signal]
    # both have the factor s
    return np.asarray((numerator / s)[0].coeffs), np.asarray((determinant / s)[0].coeffs)


def screw_solved(observer, signal, omega):
    """Solve the balances of rotor, table and observer at a frequency.

    Torques of 1 N m on the motor; returns the measured signal with a disturbance, and with a
    command.
    """
    s = 1j * omega
    spring = DAMPING_N_S_M + STIFFNESS_N_M / s
    q = 1.0 / np.polyval(observer.low_pass.denominator, s)
    inverse = np.polyval(observer.nominal.denominator, s) / np.polyval(
        observer.nominal.numerator, s
    )
    r = M_RAD
    measured = {"rotor": [1.0, 0.0], "table": [0.0, 1.0]}[signal]
    equations = np.array(
        [
            [ROTOR_KG_M2 * s + r * r * spring, -r * spring, -1.0],
            [-r * spring, TABLE_KG * s + GUIDE_N_S_M + spring, 0.0],
            # torque applied u = command + q u - q inverse y
            [q * inverse * measured[0], q * inverse * measured[1], 1.0 - q],
        ]
    )
    index = measured.index(1.0)
    disturbed = np.linalg.solve(equations, np.array([1.0, 0.0, 0.0], dtype=complex))[index]
    commanded = np.linalg.solve(equations, np.array([0.0, 0.0, 1.0], dtype=complex))[index]
    return disturbed, commanded


# the joints, written as transfer functions


@pytest.mark.parametrize("order", [1, 3])
def test_a_transfer_function_of_the_rigid_joint_is_the_rigid_nominal(order):
    inertia, friction = DRIVE.motor_inertia_kg_m2, DRIVE.motor_friction_n_m_s_rad
    written = Nominal.of(control.tf([1.0], [inertia, friction]))
    known = Nominal.motor_alone(DRIVE)
    for nominal in (written, Nominal([0.0, 1.0], [0.0, inertia, friction])):
        found, right = (design(n, order=order, measured="speed") for n in (nominal, known))
        np.testing.assert_array_equal(found.characteristic(DRIVE), right.characteristic(DRIVE))
        for speed in ("motor", "load"):
            np.testing.assert_allclose(
                found.disturbance(DRIVE, "motor", speed).at(FREQUENCIES),
                right.disturbance(DRIVE, "motor", speed).at(FREQUENCIES),
            )


def test_a_transfer_function_of_the_elastic_joint_is_the_elastic_nominal():
    channel = control.tf(DRIVE.motor_numerator, DRIVE.denominator[:-1])
    written = design(Nominal.of(channel), measured="speed")
    assert written.nominal.is_plant(DRIVE)
    right = design(Nominal.elastic(DRIVE), measured="speed")
    np.testing.assert_allclose(written.poles_1_s(DRIVE), right.poles_1_s(DRIVE))
    np.testing.assert_allclose(
        written.cancelled_poles_1_s(DRIVE), np.roots(DRIVE.motor_numerator), rtol=1e-9
    )


def test_the_joint_as_a_plant_of_its_own_has_the_closed_form_of_the_joint():
    plant = Nominal.elastic(DRIVE)
    observer = design(Nominal.rigid_joint(DRIVE), measured="speed")
    np.testing.assert_allclose(
        observer.rejection(plant).at(FREQUENCIES),
        observer.disturbance(DRIVE, "motor", "motor").at(FREQUENCIES),
    )
    np.testing.assert_allclose(
        observer.response(plant).at(FREQUENCIES), observer.command(DRIVE, "motor").at(FREQUENCIES)
    )
    np.testing.assert_allclose(
        np.sort_complex(observer.poles_1_s(plant)), np.sort_complex(observer.poles_1_s(DRIVE))
    )


# a ball-screw axis of two masses


@pytest.mark.parametrize(("signal", "order"), [("rotor", 1), ("rotor", 2), ("table", 2)])
def test_the_observer_of_a_ball_screw_axis_is_that_of_its_balances(signal, order):
    plant = Nominal(*screw_from_torque(signal))
    rigid = Nominal(
        [1.0 if signal == "rotor" else M_RAD],
        [ROTOR_KG_M2 + M_RAD**2 * TABLE_KG, M_RAD**2 * GUIDE_N_S_M],
    )
    for nominal in (plant, rigid):
        observer = design(nominal, 5e-4, order)
        for omega in FREQUENCIES:
            disturbed, commanded = screw_solved(observer, signal, omega)
            assert complex(observer.rejection(plant).at(omega)) == pytest.approx(
                disturbed, rel=1e-7
            )
            assert complex(observer.response(plant).at(omega)) == pytest.approx(commanded, rel=1e-7)


def test_a_ball_screw_axis_has_its_antiresonance_and_its_resonance():
    """omega_z = sqrt(k / m), omega_p = omega_z sqrt(1 + m r^2 / J)."""
    plant = Nominal(*screw_from_torque("rotor"))
    assert plant.relative_degree == 1
    antiresonance = math.sqrt(STIFFNESS_N_M / TABLE_KG)
    resonance = antiresonance * math.sqrt(1.0 + TABLE_KG * M_RAD**2 / ROTOR_KG_M2)
    assert abs(np.roots(plant.numerator)[0]) == pytest.approx(antiresonance, rel=1e-3)
    assert abs(np.roots(plant.denominator)[0]) == pytest.approx(resonance, rel=1e-3)


def test_the_speed_of_the_table_needs_a_q_of_second_order():
    plant = Nominal(*screw_from_torque("table"))
    assert plant.relative_degree == 2
    message = (
        "order = 1 of Q (its relative degree) over a nominal model of relative degree 2 "
        "(degrees 3 - 1) from torque to output; must be >= 2: raise the order"
    )
    with pytest.raises(Improper, match=re.escape(message) + "$"):
        design(plant)
    assert design(plant, order=2).low_pass.order == 2


# a first-order plant


@given(st.floats(0.01, 100.0), st.floats(0.01, 10.0), st.floats(1e-3, 1.0))
def test_a_first_order_plant_has_its_closed_form(gain, lag_s, time_constant_s):
    """P = g / (1 + s tau): rejection P s T / (1 + s T), response P, for its own nominal model."""
    plant = Nominal([gain], [lag_s, 1.0])
    observer = design(plant, time_constant_s)
    s = 1j * FREQUENCIES
    p = gain / (1.0 + s * lag_s)
    high = s * time_constant_s / (1.0 + s * time_constant_s)
    np.testing.assert_allclose(observer.rejection(plant).at(FREQUENCIES), high * p, rtol=1e-8)
    np.testing.assert_allclose(observer.response(plant).at(FREQUENCIES), p, rtol=1e-8)
    assert np.sort(observer.poles_1_s(plant).real) == pytest.approx(
        np.sort([-1.0 / lag_s, -1.0 / time_constant_s])
    )
    assert observer.cancelled_poles_1_s(plant).size == 0


def test_the_estimator_of_a_first_order_plant_is_q_over_it():
    observer = design(Nominal([3.0], [0.2, 1.0]), 0.05)
    for s in (1j, 30j, 900j):
        q = 1.0 / (1.0 + 0.05 * s)
        np.testing.assert_allclose(
            observer.estimator()(s), [[q, -q * (0.2 * s + 1.0) / 3.0]], rtol=1e-9
        )


@pytest.mark.parametrize("order", [1, 2])
def test_sampled_it_removes_a_constant_disturbance_of_a_first_order_plant(order):
    gain, lag_s, period_s = 3.0, 0.2, 1e-3
    observer = DisturbanceObserver(design(Nominal([gain], [lag_s, 1.0]), 0.02, order), period_s)
    decay = math.exp(-period_s / lag_s)
    output = added = 0.0
    outputs = []
    for _ in range(2000):
        added = observer.step(added, output)
        output = decay * output + (1.0 - decay) * gain * (added + 0.5)
        outputs.append(output)
    assert added == pytest.approx(-0.5, rel=1e-3)
    assert abs(outputs[-1]) < 1e-3 * max(outputs)


def test_sampled_it_is_exact_for_an_integrator():
    """The torque to add stays 0, whatever the torque held for a sample."""
    observer = DisturbanceObserver(design(Nominal([2.0], [1.0, 0.0]), 0.01), 1e-3)
    output = torque = 0.0
    for index in range(200):
        assert abs(observer.step(torque, output)) < 1e-9
        torque = math.sin(0.3 * index)
        output += 2.0 * torque * 1e-3


# refused


@pytest.mark.parametrize(
    ("make", "error", "said"),
    [
        (lambda: Nominal([1.0, 0.0, 0.0], [1.0, 1.0]), Improper, "numerator of degree 2 and a den"),
        (lambda: Nominal([0.0], [1.0, 1.0]), ServoError, "must not be 0"),
        (lambda: Nominal([1.0], [0.0, 0.0]), ServoError, "must not be 0"),
        (lambda: Nominal([1.0], [math.nan, 1.0]), ServoError, "must be finite"),
        (lambda: Nominal([1.0, -2.0], [1.0, 1.0, 1.0]), ServoError, "zero at 2+0j 1/s"),
        (lambda: Nominal([1.0, 0.0], [1.0, 1.0]), ServoError, "real part < 0"),
        (lambda: Nominal.of(DRIVE.plant), ServoError, "convert it with control.tf"),
        (lambda: Nominal.of(control.tf([1.0], [1.0, 0.5], 1e-3)), ServoError, "sample time 0.001"),
        (
            lambda: design(Nominal.rigid(1.0)).loop(DRIVE),
            ServoError,
            "measured = 'output' around a joint",
        ),
        (
            lambda: design(Nominal([1.0], [1.0, 0.0, 0.0]), measured="angle", order=2),
            Improper,
            r"relative degree 3 \(degrees 3 - 0\) from torque to angle; must be >= 3: raise",
        ),
    ],
)
def test_a_model_that_cannot_be_inverted_is_refused(make, error, said):
    with pytest.raises(error, match=said.replace("+", r"\+")):
        make()


def test_leading_zeros_are_no_degrees():
    nominal = Nominal([0.0, 0.0, 1.0], [0.0, 2.0, 1.0])
    assert (nominal.numerator.tolist(), nominal.denominator.tolist()) == ([1.0], [2.0, 1.0])
    assert nominal.relative_degree == 1
