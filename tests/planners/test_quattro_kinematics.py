"""Kinematics of the Quattro: round trips, reference poses, finite differences, refusals."""

from __future__ import annotations

import math
import timeit

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.errors import NotConverged, PlanError
from planners.kinematics.errors import SingularPose, UnreachablePose
from planners.kinematics.minors import solve_by_minors
from planners.kinematics.placement import HOME, WorkspacePlacement
from planners.kinematics.quattro import QuattroGeometry, QuattroPose

GEOMETRY = QuattroGeometry()
TURN_RAD = math.pi / 4

# position [m], plate angle [deg], joints [deg]: computed for this geometry with a program of its
# own, whose Jacobian agreed with finite differences to 4e-10; printed to 8 digits
REFERENCES = [
    ((0.0, 0.0, -0.9), 0.0, (4.0263406, 4.0263406, 4.0263406, 4.0263406)),
    ((0.0, 0.0, -1.0), 0.0, (17.170029, 17.170029, 17.170029, 17.170029)),
    ((0.1, 0.0, -0.9), 0.0, (-1.1294437, -1.1294437, 10.648027, 10.648027)),
    ((0.2, 0.0, -0.9), 0.0, (-4.7121338, -4.7121338, 18.584574, 18.584574)),
    ((0.65, 0.0, -0.9), 0.0, (-1.1224717, -1.1224717, 67.843346, 67.843346)),
    ((0.0, 0.65, -1.0), 0.0, (77.496026, 13.209978, 13.209978, 77.496026)),
    ((0.3, -0.2, -1.1), 30.0, (15.702339, 30.002375, 65.335872, 44.864267)),
    ((-0.4, 0.35, -0.8), -45.0, (49.758048, 23.168345, -32.367397, 22.469601)),
]


@st.composite
def poses(draw) -> QuattroPose:
    """Poses of the work envelope: a cylinder above a cone, plate at up to 45 deg."""
    z_m = draw(st.floats(-1.25, -0.75))
    radius_m = 0.65 - 1.4 * max(0.0, -1.0 - z_m)
    radius_m *= draw(st.floats(0.0, 1.0))
    azimuth = draw(st.floats(-math.pi, math.pi))
    angle_rad = draw(st.floats(-TURN_RAD, TURN_RAD))
    return QuattroPose(radius_m * math.cos(azimuth), radius_m * math.sin(azimuth), z_m, angle_rad)


rates = st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4).map(np.array)


@pytest.mark.parametrize(("position_m", "angle_deg", "joints_deg"), REFERENCES)
def test_the_reference_poses_have_their_joint_angles(position_m, angle_deg, joints_deg):
    joints_rad = GEOMETRY.inverse(position_m, math.radians(angle_deg))
    assert np.degrees(joints_rad) == pytest.approx(joints_deg, abs=6e-7)


@given(poses())
def test_a_pose_survives_inverse_and_forward_from_home(pose):
    joints_rad = GEOMETRY.inverse(pose[:3], pose.angle_rad)
    found = GEOMETRY.forward(joints_rad, HOME)
    assert np.max(np.abs(np.subtract(found, pose))) < 1e-12


@given(poses())
def test_every_forearm_has_its_length(pose):
    joints_rad = GEOMETRY.inverse(pose[:3], pose.angle_rad)
    bar_m = 0.12 * np.array([math.cos(pose.angle_rad), math.sin(pose.angle_rad), 0.0])
    offsets_m = (-0.12, 0.12, 0.12, -0.12)
    for index, q in enumerate(joints_rad):
        azimuth = math.radians(-45.0 + 90.0 * index)
        outward = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        down = np.array([0.0, 0.0, -1.0])
        elbow = 0.3 * outward + 0.4 * (math.cos(q) * outward + math.sin(q) * down)
        sign = 1.0 if index < 2 else -1.0
        point = np.array(pose[:3]) + sign * bar_m + np.array([0.0, offsets_m[index], 0.0])
        assert np.linalg.norm(point - elbow) == pytest.approx(1.02, abs=1e-14)
        # the elbow is outside the line from shoulder to plate point
        across = np.cross(elbow - 0.3 * outward, point - 0.3 * outward)
        assert across @ np.cross(outward, down) > 0.0


@given(poses(), rates)
def test_the_rates_agree_with_finite_differences(pose, pose_rates):
    step_s = 1e-4
    inner = QuattroPose(*(np.array(pose) * [0.98, 0.98, 1.0, 0.98]))
    angles_rad = []
    for sign in (1.0, -1.0):
        moved = np.array(inner) + sign * step_s * pose_rates
        wide = QuattroGeometry(max_angle_rad=1.0)
        angles_rad.append(np.array(wide.inverse(moved[:3], moved[3])))
    slope = (angles_rad[0] - angles_rad[1]) / (2.0 * step_s)
    # error of the difference: step^2 / 6 times the third derivative
    assert GEOMETRY.joint_rates(inner, pose_rates) == pytest.approx(slope, abs=1e-4)


@given(poses(), rates)
def test_pose_rates_and_joint_rates_are_inverse(pose, pose_rates):
    joint_rates = GEOMETRY.joint_rates(pose, pose_rates)
    assert GEOMETRY.pose_rates(pose, joint_rates) == pytest.approx(pose_rates, abs=1e-12)
    plate, diagonal = GEOMETRY.jacobian(pose)
    left = np.array(plate) @ pose_rates
    assert left == pytest.approx(np.array(diagonal) * joint_rates, abs=1e-12)


@given(poses())
def test_the_work_envelope_is_far_from_singular(pose):
    assert 1.0 <= GEOMETRY.condition_number(pose) < 12.0
    plate, diagonal = GEOMETRY.jacobian(pose)
    volume = abs(np.linalg.det(np.array(plate))) / (1.02**4 * 0.12)
    assert volume > 0.1
    assert min(diagonal) > 0.2


def test_the_condition_number_at_home_is_that_of_the_symmetric_pose():
    # joint rates per velocity at home by central differences, rotation as 0.12 m times the angle
    columns = []
    for axis, step in enumerate((1e-6, 1e-6, 1e-6, 1e-6 / 0.12)):
        moved = np.zeros(4)
        moved[axis] = step
        upper, lower = np.add(HOME, moved), np.subtract(HOME, moved)
        change = np.subtract(
            GEOMETRY.inverse(upper[:3], upper[3]), GEOMETRY.inverse(lower[:3], lower[3])
        )
        columns.append(change / 2e-6)
    expected = np.linalg.cond(np.stack(columns, axis=1))
    assert GEOMETRY.condition_number(HOME) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("angle_rad", [math.pi / 2, -math.pi / 2])
def test_a_plate_at_a_right_angle_is_named_singular(angle_rad):
    match = r"angle_rad = -?1\.5708, singular near \+-1\.57; must be -0\.785398 to 0\.785398: turn"
    with pytest.raises(SingularPose, match=match):
        GEOMETRY.inverse((0.0, 0.0, -0.9), angle_rad)
    with pytest.raises(SingularPose, match=match):
        GEOMETRY.jacobian(QuattroPose(0.0, 0.0, -0.9, angle_rad))


def test_a_search_from_a_singular_pose_is_refused():
    with pytest.raises(SingularPose, match=r"bars in line .* volume = .*; must be >= 0.001: keep"):
        GEOMETRY.forward(GEOMETRY.inverse(HOME[:3]), HOME._replace(angle_rad=math.pi / 2))


def in_line_height_m() -> float:
    """Height over the base axis at which arm and forearm of all legs are in line."""
    across_m = 0.3 - 0.12 * math.sqrt(2.0)
    return -math.sqrt(1.42**2 - across_m**2)


def test_an_arm_in_line_with_its_forearm_is_named_singular():
    edge_m = in_line_height_m()
    wide = QuattroGeometry(max_joint_rad=math.pi)
    inside = wide.inverse((0.0, 0.0, edge_m + 1e-4))
    assert np.all(np.isfinite(inside))
    with pytest.raises(SingularPose, match=r"arm and forearm of leg 1 in line: sine = .*; must be"):
        wide.inverse((0.0, 0.0, edge_m + 1e-8))
    with pytest.raises(UnreachablePose):
        wide.inverse((0.0, 0.0, edge_m - 1e-8))


@given(
    st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    st.floats(-4.0, 4.0) | st.sampled_from([math.pi / 2, -math.pi / 2, math.nan, math.inf]),
)
def test_a_pose_gives_finite_joints_or_an_error(position_m, angle_rad):
    try:
        joints_rad = GEOMETRY.inverse(position_m, angle_rad)
    except PlanError:
        return
    assert np.all(np.isfinite(joints_rad))
    assert np.all(
        np.isfinite(np.array(GEOMETRY.jacobian(QuattroPose(*position_m, angle_rad)).plate))
    )


@given(st.tuples(*[st.floats(-0.9, 2.1)] * 4))
def test_joint_angles_give_a_pose_that_closes_or_an_error(joints_rad):
    try:
        pose = GEOMETRY.forward(joints_rad, HOME)
    except PlanError:
        return
    for leg, (x_m, y_m, z_m) in zip(GEOMETRY.legs, GEOMETRY._elbows(joints_rad), strict=True):
        n = (
            pose.x_m + leg.bar_m * math.cos(pose.angle_rad) - x_m,
            pose.y_m + leg.bar_m * math.sin(pose.angle_rad) - y_m,
            pose.z_m - z_m,
        )
        assert math.hypot(*n) == pytest.approx(1.02, abs=1e-13)


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_not_finite_are_refused(number):
    for axis in range(3):
        position_m = [0.0, 0.0, -0.9]
        position_m[axis] = number
        with pytest.raises(UnreachablePose):
            GEOMETRY.inverse(position_m)
    with pytest.raises(
        UnreachablePose, match=r"joint 2 = .* rad; must be -0.907571 to 2.16421 rad"
    ):
        GEOMETRY.forward((0.0, number, 0.0, 0.0), HOME)


REFUSALS = [
    (
        (0.0, 0.0, -1.6),
        0.0,
        r"forearm_m = 1.02 of leg 1; must be 1\.20\d* to .* to reach \(0, 0, -",
    ),
    ((0.0, 0.0, -0.61), 0.0, r"joint 1 = -.* rad; must be -0\.907571 to"),
    ((1.4, 0.0, -0.9), 0.0, r"forearm_m = 1.02 of leg 1; must be .* move the plate nearer"),
    ((0.0, 0.0, -0.9), 0.9, r"angle_rad = 0.9; must be -0.785398 to 0.785398: turn the plate"),
]


@pytest.mark.parametrize(("position_m", "angle_rad", "message"), REFUSALS)
def test_an_unreachable_pose_is_named(position_m, angle_rad, message):
    with pytest.raises(UnreachablePose, match=message):
        GEOMETRY.inverse(position_m, angle_rad)


def test_a_search_that_does_not_converge_is_named():
    # shoulders so far apart that no plate joins the forearms
    torn = QuattroGeometry(base_radius_m=3.0)
    with pytest.raises((NotConverged, SingularPose), match="must be"):
        torn.forward((0.0, 0.5, 0.0, 0.5), HOME)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("arm_m", 0.0),
        ("forearm_m", -1.0),
        ("base_radius_m", math.nan),
        ("bar_m", 0.0),
        ("offset_m", -0.1),
        ("max_angle_rad", math.pi / 2),
        ("min_joint_rad", -4.0),
        ("max_joint_rad", -1.0),
    ],
)
def test_a_wrong_geometry_is_refused(key, value):
    with pytest.raises(PlanError, match=f"{key} = .*; must be .* to .*: "):
        QuattroGeometry(**{key: value})


def test_a_platform_position_survives_the_placement():
    placement = WorkspacePlacement()
    for k in range(200):
        position_m = (0.3 * math.sin(0.05 * k), 0.2 * math.cos(0.03 * k), 0.05 * math.sin(0.1 * k))
        found_m = placement.position_of(placement.joints_of(position_m))
        assert found_m == pytest.approx(position_m, abs=1e-12)


def test_the_placement_shifts_by_its_home_pose():
    placement = WorkspacePlacement(home=QuattroPose(0.1, -0.05, -1.0, 0.2))
    robot_rad = GEOMETRY.inverse((0.3, -0.05, -0.95), 0.2)
    assert placement.joints_of((0.2, 0.0, 0.05)) == pytest.approx(robot_rad, abs=1e-13)
    assert placement.position_of(robot_rad) == pytest.approx((0.2, 0.0, 0.05), abs=1e-12)
    assert WorkspacePlacement().joints_of((0, 0, 0)) == GEOMETRY.inverse((0, 0, -0.9))


def test_the_placement_finds_a_position_far_from_the_last_one():
    placement = WorkspacePlacement()
    for x_m in (-0.6, 0.6, -0.6):
        joints_rad = placement.joints_of((x_m, 0.0, 0.0))
        assert placement.position_of(joints_rad) == pytest.approx((x_m, 0.0, 0.0), abs=1e-12)


def test_an_unreachable_home_is_refused():
    with pytest.raises(PlanError):
        WorkspacePlacement(home=QuattroPose(0.0, 0.0, -2.0, 0.0))


def test_a_control_task_can_call_the_placement_each_tick():
    """Bounds are 30 us and 60 us; 3 us and 16 us were measured."""
    placement = WorkspacePlacement()
    ends = [placement.joints_of((x_m, 0.05, 0.02)) for x_m in (0.10, 0.11)]

    def alternate() -> None:
        for joints_rad in ends:
            placement.position_of(joints_rad)

    inverse_s = min(timeit.repeat(lambda: placement.joints_of((0.1, 0.05, 0.02)), number=100))
    assert inverse_s / 100 < 30e-6
    assert min(timeit.repeat(alternate, number=50)) / 100 < 60e-6


@given(st.lists(st.floats(-1.0, 1.0), min_size=20, max_size=20))
def test_four_equations_are_solved_by_minors(numbers):
    matrix = np.array(numbers[:16]).reshape(4, 4)
    right = np.array(numbers[16:])
    found, determinant = solve_by_minors(tuple(map(tuple, matrix)), tuple(right), 1e-3)
    with np.errstate(all="ignore"):  # old versions of numpy warn of denormal numbers
        expected = np.linalg.det(matrix)
    assert determinant == pytest.approx(expected, abs=1e-13)
    if found is None:
        assert abs(determinant) < 1e-3
    else:
        assert matrix @ found == pytest.approx(right, abs=1e-11)
