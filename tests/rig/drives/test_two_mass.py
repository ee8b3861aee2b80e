"""Model of an elastic joint: modes of source 001, and polynomials against state space."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.drives.servo.errors import ServoError
from rig.drives.servo.loops import oscillatory_pairs, pole_pairs
from rig.drives.servo.two_mass import TwoMass

DATA = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_joint.toml").read_text())
joints = st.builds(
    TwoMass,
    motor_inertia_kg_m2=st.floats(1e-5, 1e-2),
    load_inertia_kg_m2=st.floats(1e-2, 10.0),
    stiffness_n_m_rad=st.floats(0.1, 100.0),
    gear_ratio=st.floats(1.0, 200.0),
    motor_friction_n_m_s_rad=st.just(0.0) | st.floats(1e-6, 1e-2),
    load_friction_n_m_s_rad=st.just(0.0) | st.floats(1e-3, 10.0),
    elastic_damping_n_m_s_rad=st.just(0.0) | st.floats(1e-6, 1e-2),
)


def figures(joint: TwoMass) -> dict[str, float]:
    (zero,), (pole,) = (
        oscillatory_pairs(np.roots(joint.motor_numerator)),
        oscillatory_pairs(joint.poles_1_s),
    )
    return {
        "antiresonance_rad_s": zero.frequency_rad_s,
        "antiresonance_damping": zero.damping,
        "resonance_rad_s": pole.frequency_rad_s,
        "resonance_damping": pole.damping,
        "real_pole_1_s": pole_pairs(joint.poles_1_s)[0].frequency_rad_s,
    }


def test_the_listed_constants_have_modes_of_their_own_and_only_the_resonance_is_the_printed_one():
    found = figures(TwoMass(**DATA["listed"]))
    assert found == pytest.approx(DATA["modes"]["listed"], rel=1e-7)
    off = {name: found[name] / value - 1.0 for name, value in DATA["modes"]["printed"].items()}
    assert [name for name, share in off.items() if abs(share) < 0.003] == ["resonance_rad_s"]


def test_the_fitted_constants_have_all_five_printed_modes():
    assert figures(TwoMass(**DATA["fitted"])) == pytest.approx(DATA["modes"]["printed"], rel=1e-7)


def test_the_normalised_joint_has_the_modes_of_its_closed_form():
    n = DATA["normalised"]
    joint = TwoMass.normalised(
        n["antiresonance_rad_s"], n["inertia_ratio"], n["antiresonance_damping"]
    )
    (pole,) = oscillatory_pairs(joint.poles_1_s)
    assert pole == pytest.approx((n["resonance_rad_s"], n["resonance_damping"]), rel=1e-7)
    assert joint.rigid_inertia_kg_m2 == pytest.approx(1.0)
    assert joint.antiresonance_rad_s == pytest.approx(n["antiresonance_rad_s"])


@given(joints, st.floats(0.1, 1e3))
def test_the_polynomials_are_the_transfer_functions_of_the_state_space(joint, omega):
    """(s I - A) x = B tau with the states from the polynomials.

    Each term to the rounding of the largest.
    """
    s = 1j * omega
    angles = [
        np.polyval(n, s) / np.polyval(joint.denominator, s)
        for n in (joint.motor_numerator, joint.load_numerator)
    ]
    states = np.array([angles[0], s * angles[0], angles[1], s * angles[1]])
    rounding = 1e-10 * (np.abs(joint.state_matrix) @ np.abs(states)).max()
    assert s * states == pytest.approx(
        joint.state_matrix @ states + joint.input_matrix[:, 0], abs=rounding
    )


@given(joints)
def test_without_friction_momentum_is_what_the_torque_put_in(joint):
    a, b = joint.state_matrix, joint.input_matrix
    momentum = np.array([0.0, joint.motor_inertia_kg_m2, 0.0, joint.reflected_inertia_kg_m2])
    friction = np.array(
        [0.0, joint.motor_friction_n_m_s_rad, 0.0, joint.reflected_friction_n_m_s_rad]
    )
    scale = np.abs(momentum) @ np.abs(a)
    assert momentum @ a == pytest.approx(-friction, abs=1e-12 * scale.max())
    assert momentum @ b == pytest.approx([1.0, 1.0])


def test_the_plant_is_asked_for_by_name():
    joint = TwoMass(**DATA["listed"])
    speed = joint.plant["load_speed", "motor_torque"]
    s = 37.0j
    assert speed(s) == pytest.approx(
        s * np.polyval(joint.load_numerator, s) / np.polyval(joint.denominator, s)
    )


@pytest.mark.parametrize("name", DATA["listed"])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_a_datum_that_no_joint_has_is_named_with_its_bound(name, value):
    with pytest.raises(
        ServoError, match=rf"{name} = {value}; must be 1e-12 to 1e\+12: take it from"
    ):
        TwoMass(**(DATA["listed"] | {name: value}))


def test_a_joint_that_does_not_oscillate_is_refused_when_it_must():
    with pytest.raises(ServoError, match="does not oscillate; must leave a complex pole pair"):
        TwoMass(**(DATA["listed"] | {"elastic_damping_n_m_s_rad": 10.0})).check_elastic()
    TwoMass(**DATA["listed"]).check_elastic()


def test_more_than_critical_damping_is_no_normalised_joint():
    with pytest.raises(ServoError, match=r"antiresonance_damping = 1.5; must be 0 to 1"):
        TwoMass.normalised(200.0, 1.0, 1.5)
