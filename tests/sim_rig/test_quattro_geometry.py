"""Geometry of the simulated Quattro against that of the planner, and with errors of the lengths."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from planners.kinematics.quattro import QuattroGeometry, QuattroPose
from sim_rig.quattro_geometry import (
    PlatePose,
    actual_legs,
    joint_angles,
    leg_state,
    nominal_legs,
    pose_of,
    rate_matrix,
)
from sim_rig.quattro_params import QuattroParams

HOME = PlatePose(0.0, 0.0, -0.9, 0.0)
LEGS = actual_legs(QuattroParams())
PLANNED = QuattroGeometry()
ERRORS = QuattroParams(
    arm_error_m=(1e-3, -5e-4, 0.0, 2e-3),
    forearm_error_m=(-1e-3, 0.0, 1.5e-3, 5e-4),
    base_radius_error_m=-7e-4,
)


@st.composite
def poses(draw) -> PlatePose:
    """Poses of the work envelope: radius 0.65 m, 0.25 m high, plate at up to 45 deg."""
    radius_m = draw(st.floats(0.0, 0.65))
    azimuth = draw(st.floats(-math.pi, math.pi))
    z_m = draw(st.floats(-1.0, -0.75))
    angle_rad = draw(st.floats(-math.pi / 4, math.pi / 4))
    return PlatePose(radius_m * math.cos(azimuth), radius_m * math.sin(azimuth), z_m, angle_rad)


@given(poses())
def test_joints_agree_with_the_planner_s_inverse_kinematics(pose):
    expected = PLANNED.inverse(pose[:3], pose.angle_rad)
    assert joint_angles(LEGS, pose) == pytest.approx(expected, abs=1e-12)


@given(poses())
def test_the_pose_agrees_with_the_planner_s_forward_kinematics(pose):
    joints_rad = joint_angles(LEGS, pose)
    expected = PLANNED.forward(joints_rad, QuattroPose(*HOME))
    assert pose_of(LEGS, joints_rad, HOME) == pytest.approx(expected, abs=1e-12)
    assert expected == pytest.approx(pose, abs=1e-12)


@given(poses())
def test_the_rate_matrix_agrees_with_the_planner_s_jacobian(pose):
    plate, diagonal = PLANNED.jacobian(QuattroPose(*pose))
    expected = np.array(plate) / np.array(diagonal)[:, None]
    assert rate_matrix(LEGS, pose) == pytest.approx(expected, abs=1e-12)


def test_another_size_agrees_with_the_planner_too():
    sizes = {"base_radius_m": 0.25, "arm_m": 0.35, "forearm_m": 0.9, "bar_m": 0.2, "offset_m": 0.05}
    legs = actual_legs(QuattroParams(**sizes))
    planned = QuattroGeometry(**sizes)
    pose = PlatePose(0.1, -0.2, -0.8, 0.3)
    expected = planned.inverse(pose[:3], pose.angle_rad)
    assert joint_angles(legs, pose) == pytest.approx(expected, abs=1e-12)


@given(poses())
def test_with_errors_arm_and_forearm_have_their_actual_lengths(pose):
    c, s = math.cos(pose.angle_rad), math.sin(pose.angle_rad)
    for index, leg in enumerate(actual_legs(ERRORS)):
        state = leg_state(leg, *pose[:3], c, s)
        forearm_m = 1.02 + ERRORS.forearm_error_m[index]
        length_m = math.hypot(state.x_m, state.y_m, state.z_m)
        assert length_m == pytest.approx(forearm_m, abs=1e-14)
        azimuth = math.radians(-45.0 + 90.0 * index)
        arm_m = 0.4 + ERRORS.arm_error_m[index]
        sign = 1.0 if index < 2 else -1.0
        out_m = 0.3 - 7e-4 + arm_m * state.cos
        elbow = (out_m * math.cos(azimuth), out_m * math.sin(azimuth), -arm_m * state.sin)
        offset_m = (-0.12, 0.12, 0.12, -0.12)[index]
        point = (pose.x_m + sign * 0.12 * c, pose.y_m + sign * 0.12 * s + offset_m, pose.z_m)
        assert np.subtract(point, elbow) == pytest.approx(state[2:5], abs=1e-14)


@given(poses())
def test_a_pose_survives_joints_and_back_with_errors(pose):
    legs = actual_legs(ERRORS)
    assert pose_of(legs, joint_angles(legs, pose), HOME) == pytest.approx(pose, abs=1e-12)


def test_an_error_moves_the_plate_by_about_its_own_size():
    joints_rad = joint_angles(nominal_legs(ERRORS), HOME)
    shift = np.subtract(pose_of(actual_legs(ERRORS), joints_rad, HOME), HOME)
    assert 1e-4 < np.linalg.norm(shift[:3]) < 5e-3
    assert nominal_legs(ERRORS) == LEGS


@given(poses(), st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).map(np.array))
def test_the_rate_matrix_is_the_derivative_of_the_joint_angles(pose, rates):
    step = 1e-5
    inner = np.array(pose) * [0.98, 0.98, 1.0, 0.98]
    after = joint_angles(LEGS, PlatePose(*(inner + step * rates)))
    before = joint_angles(LEGS, PlatePose(*(inner - step * rates)))
    slope = np.subtract(after, before) / (2.0 * step)
    assert rate_matrix(LEGS, PlatePose(*inner)) @ rates == pytest.approx(slope, abs=1e-6)


@pytest.mark.parametrize(
    "pose",
    [
        (0.0, 0.0, -1.6, 0.0),
        (1.5, 0.0, -0.9, 0.0),
        (0.0, 0.0, -0.3, 0.0),
        (math.nan, 0.0, -0.9, 0.0),
        (0.0, 0.0, -math.inf, 0.0),
    ],
)
def test_a_pose_out_of_reach_is_named(pose):
    message = r"plate at \(.*\) m, .* m from the shoulder at -45 deg; must be within reach of arm"
    with pytest.raises(ValueError, match=message):
        joint_angles(LEGS, PlatePose(*pose))


def test_an_arm_in_line_with_its_forearm_is_named():
    across_m = 0.3 - 0.12 * math.sqrt(2.0)
    edge_m = -math.sqrt(1.42**2 - across_m**2)
    assert np.all(np.isfinite(joint_angles(LEGS, PlatePose(0.0, 0.0, edge_m + 1e-4, 0.0))))
    with pytest.raises(ValueError, match="not in line: keep the setpoints in the work envelope"):
        joint_angles(LEGS, PlatePose(0.0, 0.0, edge_m + 1e-11, 0.0))


@pytest.mark.parametrize(
    "joints_rad", [(math.nan, 0.0, 0.0, 0.0), (-3.0, 3.0, -3.0, 3.0), (0.0, math.inf, 0.0, 0.0)]
)
def test_joints_without_a_pose_are_refused(joints_rad):
    with pytest.raises(ValueError, match=r"joints = .* rad; must be angles at which all forearms"):
        pose_of(LEGS, joints_rad, HOME)


def test_a_search_from_a_singular_pose_is_refused():
    def determinant(angle_rad: float) -> float:
        return float(np.linalg.det(rate_matrix(LEGS, HOME._replace(angle_rad=angle_rad))))

    singular_rad = brentq(determinant, 1.4, 1.7, xtol=1e-15)
    assert math.degrees(singular_rad) == pytest.approx(93.1, abs=0.1)
    start = HOME._replace(angle_rad=singular_rad)
    with pytest.raises(ValueError, match="compute them from a pose within reach"):
        pose_of(LEGS, (0.1, 0.1, 0.1, 0.2), start)
