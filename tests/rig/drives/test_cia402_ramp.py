"""Ramps of the drive against kinematics."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.drives.cia402.ramp import RampLimits, approach_velocity, plan_move, plan_stop

POSITIONS = st.floats(-1e6, 1e6)
VELOCITIES = st.floats(-1e5, 1e5)
RATES = st.floats(1.0, 1e6)
LIMITS = st.builds(RampLimits, st.floats(1.0, 1e5), RATES, RATES)


def instants(motion, count=200):
    return [motion.duration_s * k / count for k in range(count + 1)]


@given(position=POSITIONS, velocity=VELOCITIES, deceleration=RATES)
def test_a_stop_takes_v_squared_over_twice_the_deceleration(position, velocity, deceleration):
    motion = plan_stop(position, velocity, deceleration)
    distance = velocity * abs(velocity) / (2 * deceleration)
    assert motion.target == pytest.approx(position + distance, rel=1e-9, abs=1e-6)
    assert motion.duration_s == pytest.approx(abs(velocity) / deceleration)
    assert motion.at(motion.duration_s) == (motion.target, 0.0, 0.0)


@given(position=POSITIONS, velocity=VELOCITIES, target=POSITIONS, limits=LIMITS)
def test_a_move_is_continuous_and_ends_at_rest_in_its_target(position, velocity, target, limits):
    motion = plan_move(position, velocity, target, limits)
    assert motion.target == target
    start = motion.at(0.0)
    if motion.duration_s > 0.0:
        assert (start.position, start.velocity) == (position, velocity)
    points = [motion.at(t_s) for t_s in instants(motion)]
    step_s = motion.duration_s / 200
    largest = max(limits.acceleration, limits.deceleration)
    scale = max(abs(position), abs(target), abs(velocity), 1.0)
    for before, after in itertools.pairwise(points):
        assert abs(after.velocity - before.velocity) <= largest * step_s + 1e-6 * scale
        mean = (before.velocity + after.velocity) / 2
        travelled = after.position - before.position
        assert abs(travelled - mean * step_s) <= largest * step_s**2 + 1e-6 * scale


@given(position=POSITIONS, velocity=VELOCITIES, target=POSITIONS, limits=LIMITS)
def test_a_move_keeps_its_limits(position, velocity, target, limits):
    motion = plan_move(position, velocity, target, limits)
    allowed = max(limits.speed, abs(velocity)) * (1 + 1e-9)
    for t_s in instants(motion):
        point = motion.at(t_s)
        assert abs(point.velocity) <= allowed + 1e-6
        power = point.acceleration * point.velocity
        if power > 1e-9:
            assert abs(point.acceleration) <= limits.acceleration
        elif power < -1e-9:
            assert abs(point.acceleration) <= limits.deceleration


@given(target=POSITIONS, limits=LIMITS)
def test_a_move_from_rest_never_overshoots(target, limits):
    motion = plan_move(0.0, 0.0, target, limits)
    for t_s in instants(motion):
        position = motion.at(t_s).position
        assert min(0.0, target) - 1e-6 <= position <= max(0.0, target) + 1e-6


def test_a_move_from_rest_takes_the_time_of_the_trapezoid():
    limits = RampLimits(speed=100.0, acceleration=200.0, deceleration=400.0)
    assert plan_move(0.0, 0.0, 500.0, limits).duration_s == pytest.approx(5.0 + 0.25 + 0.125)
    triangle = plan_move(0.0, 0.0, 12.0, limits)
    peak = (2 * 12.0 / (1 / 200 + 1 / 400)) ** 0.5
    assert triangle.duration_s == pytest.approx(peak / 200 + peak / 400)


def test_a_move_that_cannot_stop_in_time_returns():
    limits = RampLimits(speed=100.0, acceleration=100.0, deceleration=100.0)
    motion = plan_move(0.0, 100.0, 10.0, limits)
    positions = [motion.at(t_s).position for t_s in instants(motion)]
    assert max(positions) == pytest.approx(50.0, abs=0.1)
    assert positions[-1] == 10.0


def test_a_move_above_the_speed_limit_slows_down_first():
    limits = RampLimits(speed=50.0, acceleration=100.0, deceleration=100.0)
    motion = plan_move(0.0, 100.0, 1000.0, limits)
    assert motion.at(0.25).velocity == pytest.approx(75.0)
    assert motion.at(5.0).velocity == pytest.approx(50.0)


def test_a_move_to_where_the_axis_rests_takes_no_time():
    motion = plan_move(3.0, 0.0, 3.0, RampLimits(1.0, 1.0, 1.0))
    assert (motion.duration_s, motion.at(0.0)) == (0.0, (3.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("velocity", "target", "expected"), [(0, 10, 3), (0, -10, -3), (9, 10, 10), (5, 5, 5)]
)
def test_a_velocity_approaches_its_target_by_the_change(velocity, target, expected):
    assert approach_velocity(velocity, target, 3.0) == expected
