"""Simulated Quattro: response, rest, saturation, energy, and an integration of its own."""

from __future__ import annotations

import math
import timeit
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from planners.kinematics.quattro import QuattroGeometry, QuattroPose
from sim_rig.bench import Bench
from sim_rig.params import BenchParams, RobotParams
from sim_rig.quattro import QuattroPlatform
from sim_rig.quattro_geometry import PlatePose, joint_angles, rate_matrix
from sim_rig.quattro_motion import QuattroMotion
from sim_rig.quattro_params import QuattroParams
from sim_rig.robot import Platform

MS = 1_000_000
GRAVITY = 9.81
NO_FRICTION = {"coulomb_n_m": 0.0, "viscous_n_m_s_rad": 0.0}
IDEAL_ENCODER = {"encoder_counts_per_rev": 0}
FloatArray = NDArray[Any]


class Record(NamedTuple):
    """States after each millisecond of a run, the start first."""

    positions_m: FloatArray  # (N, 3)
    velocities_m_s: FloatArray  # (N, 3)
    torques_n_m: FloatArray  # (N, 4)
    rates_rad_s: FloatArray  # (N, 4)


def record(platform: QuattroPlatform, steps: int, setpoints: dict | None = None) -> Record:
    """Run steps of 1 ms; setpoints: position at the start of a step."""
    rows = [[], [], [], []]
    for k in range(steps + 1):
        rows[0].append(platform.position_m)
        rows[1].append(platform.velocity_m_s)
        rows[2].append(platform.torques_n_m)
        rows[3].append(platform.joint_rates_rad_s)
        if setpoints and k in setpoints:
            platform.set_setpoint(setpoints[k])
        platform.advance(k * MS, MS, 1)
    return Record(*(np.array(row) for row in rows))


def rise_time_ms(values: FloatArray) -> float:
    """Compute the time from 10 to 90 % of a step response to 1, sampled at 1 kHz."""
    instants = []
    for level in (0.1, 0.9):
        k = int(np.argmax(values >= level))
        instants.append(k - 1 + (level - values[k - 1]) / (values[k] - values[k - 1]))
    return instants[1] - instants[0]


def step_response(axis: int, payload_kg: float = 0.7, **changes) -> FloatArray:
    """Compute the response to a step of 10 mm, over its size, (301,)."""
    platform = QuattroPlatform(QuattroParams(**changes), payload_kg=payload_kg)
    setpoint_m = tuple(0.01 if k == axis else 0.0 for k in range(3))
    return record(platform, 300, {0: setpoint_m}).positions_m[:, axis] / 0.01


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("payload_kg", [0.0, 0.7, 6.0])
def test_a_step_at_home_rises_in_31_ms_with_little_overshoot(axis, payload_kg):
    response = step_response(axis, payload_kg)
    assert rise_time_ms(response) == pytest.approx(31.0, abs=1.0)
    assert response.max() < 1.01
    assert response[-1] == pytest.approx(1.0, abs=1e-4)


def test_the_response_is_that_of_the_second_order_axes():
    axes = Platform(RobotParams(), (0.0, 0.0, 0.0))
    axes.set_setpoint((0.01, 0.0, 0.0))
    values = [0.0]
    for k in range(300):
        axes.advance(k * MS, MS, 1)
        values.append(axes.position_m[0] / 0.01)
    assert step_response(0) == pytest.approx(np.array(values), abs=0.02)


def test_setpoints_of_joints_and_of_positions_move_alike():
    by_position, by_joints = (QuattroPlatform(QuattroParams()) for _ in range(2))
    by_position.set_setpoint((0.01, 0.002, -0.003))
    by_joints.set_joint_setpoint(QuattroGeometry().inverse((0.01, 0.002, -0.903)))
    one, other = record(by_position, 100), record(by_joints, 100)
    assert one.positions_m == pytest.approx(other.positions_m, abs=1e-7)


def test_a_robot_at_rest_stays_there_without_computing(monkeypatch):
    platform = QuattroPlatform(QuattroParams(start_m=0.1), (0.1, 0.0, 0.0), payload_kg=0.7)
    assert platform.still
    assert platform.position_m == pytest.approx((0.1, 0.0, 0.0), abs=1e-15)
    monkeypatch.setattr(QuattroMotion, "advance", None)
    assert platform.advance(0, MS, 3) == ([0.0] * 7, [0.0] * 7, [0.0] * 7)
    platform.set_setpoint((0.1, 0.0, 0.0))
    assert platform.still


@pytest.mark.parametrize("counts", [0, 8192, 65536, 1_048_576])
def test_a_robot_comes_to_rest_at_its_setpoint(counts):
    platform = QuattroPlatform(QuattroParams(encoder_counts_per_rev=counts), payload_kg=0.7)
    platform.set_setpoint((0.02, -0.01, 0.005))
    assert not platform.still
    run = record(platform, 600)
    assert platform.still
    assert platform.velocity_m_s == (0.0, 0.0, 0.0)
    assert platform.joint_rates_rad_s == (0.0, 0.0, 0.0, 0.0)
    step_rad = max(2.0 * math.pi / (33.0 * max(counts, 1)) if counts else 0.0, 1e-6)
    assert platform.position_m == pytest.approx((0.02, -0.01, 0.005), abs=4.0 * step_rad)
    assert np.array_equal(run.positions_m[-1], run.positions_m[-2])


def test_the_speed_lost_on_coming_to_rest_is_small():
    platform = QuattroPlatform(QuattroParams(), payload_kg=0.7)
    platform.set_setpoint((0.01, 0.0, 0.0))
    before = platform.velocity_m_s
    k = 0
    while not platform.still:
        before = platform.velocity_m_s
        platform.advance(k * MS, MS, 1)
        k += 1
    assert math.hypot(*before) < 6e-5


def test_a_robot_holds_its_position_against_gravity():
    platform = QuattroPlatform(QuattroParams(**IDEAL_ENCODER, **NO_FRICTION), payload_kg=2.0)
    platform.set_setpoint((0.0, 0.0, 1e-12))  # awake, without a motion
    run = record(platform, 40)
    assert np.abs(run.positions_m).max() < 1e-11


def test_holding_torques_are_those_of_the_potential_energy():
    position_m = (0.2, -0.1, 0.05)
    platform = QuattroPlatform(QuattroParams(), position_m, payload_kg=2.0)
    geometry = QuattroGeometry()
    joints_rad = np.array(geometry.inverse((0.2, -0.1, -0.85)))

    def potential_j(joints: FloatArray) -> float:
        pose = geometry.forward(joints, QuattroPose(0.2, -0.1, -0.85, 0.0))
        # plate, payload and half forearms; arms at half, forearms at full length below the base
        plate_j = (1.3 + 2.0 + 4 * 0.175) * GRAVITY * pose.z_m
        return plate_j - (0.9 * 0.2 + 0.175 * 0.4) * GRAVITY * float(np.sin(joints).sum())

    for index in range(4):
        moved = np.zeros(4)
        moved[index] = 1e-5
        slope = (potential_j(joints_rad + moved) - potential_j(joints_rad - moved)) / 2e-5
        assert platform.torques_n_m[index] == pytest.approx(slope, abs=1e-6)


def energy_j(motion: QuattroMotion, payload_kg: float) -> float:
    """Compute kinetic and potential energy with default masses."""
    pose, rates = PlatePose(*motion.pose), np.array(motion.rates)
    masses_kg = np.array([2.0 + payload_kg] * 3 + [0.01 + 0.7 * 0.12**2])
    joint_rates = rate_matrix(motion.legs, pose) @ rates
    kinetic_j = masses_kg @ rates**2 + 0.376 * joint_rates @ joint_rates
    arms_kg_m = 0.25 * np.sin(joint_angles(motion.legs, pose)).sum()
    return 0.5 * kinetic_j + GRAVITY * ((2.0 + payload_kg) * pose.z_m - arms_kg_m)


@pytest.mark.parametrize("errors", [{}, {"arm_error_m": (2e-3, 0.0, -1e-3, 0.0)}])
def test_a_robot_without_friction_and_torque_keeps_its_energy(errors):
    motion = QuattroMotion(QuattroParams(**NO_FRICTION, **errors), 0.7)
    motion.pose, motion.rates = (0.1, 0.05, -0.95, 0.2), (1.0, 0.5, 0.8, 2.0)
    before_j = energy_j(motion, 0.7)
    lengths = {leg: leg.arm_m for leg in motion.legs}
    assert len(lengths) == 4
    for _ in range(150):
        motion.advance((0.0, 0.0, 0.0, 0.0), 1e-3)
    # inertia of the changed arms is that of the nominal ones: the energy holds all the same
    assert energy_j(motion, 0.7) == pytest.approx(before_j, abs=1e-9)


def test_friction_takes_energy_and_torque_gives_it():
    motion = QuattroMotion(QuattroParams(), 0.0)
    motion.pose, motion.rates = (0.0, 0.0, -0.9, 0.0), (0.5, 0.0, 0.0, 0.0)
    energies = []
    for _ in range(50):
        energies.append(energy_j(motion, 0.0))
        motion.advance((0.0, 0.0, 0.0, 0.0), 1e-3)
    assert np.all(np.diff(energies) < 0.0)


class JointEquations:
    """Equations of motion in the joint angles, with the geometry of the planner.

    T = qd^T (I + G^T M G) qd / 2 with the pose rates G qd; G' by differences along the motion.
    """

    def __init__(self, params: QuattroParams, payload_kg: float) -> None:
        mass_kg = 1.3 + 0.7 + payload_kg
        self.masses = np.diag([mass_kg, mass_kg, mass_kg, 0.01 + 0.7 * 0.12**2])
        self.weight = np.array([0.0, 0.0, -mass_kg * GRAVITY, 0.0])
        self.geometry = QuattroGeometry()
        self.params = params
        self.near = QuattroPose(0.0, 0.0, -0.9, 0.0)

    def gain(self, joints: FloatArray) -> FloatArray:
        self.near = self.geometry.forward(joints, self.near)
        plate, diagonal = self.geometry.jacobian(self.near)
        return np.linalg.solve(np.array(plate), np.diag(diagonal))

    def derivative(self, _t: float, y: FloatArray, torques: FloatArray) -> FloatArray:
        joints, rates = y[:4], y[4:]
        step_s = 1e-6
        gain = self.gain(joints)
        change = self.gain(joints + step_s * rates) - self.gain(joints - step_s * rates)
        bias = change @ rates / (2.0 * step_s)
        dry = self.params.coulomb_n_m * rates / np.sqrt(rates**2 + 0.02**2)
        right = torques - dry - self.params.viscous_n_m_s_rad * rates
        right = right + GRAVITY * 0.25 * np.cos(joints)
        right = right + gain.T @ (self.weight - self.masses @ bias)
        inertia = 0.376 * np.eye(4) + gain.T @ self.masses @ gain
        return np.concatenate([rates, np.linalg.solve(inertia, right)])


def test_the_integration_agrees_with_one_in_the_joint_angles():
    params = QuattroParams()
    platform = QuattroPlatform(params, payload_kg=0.7)
    setpoints = {}
    for k in range(0, 120, 5):
        wave = math.sin(0.05 * k)
        setpoints[k] = (0.03 * wave, 0.02 * (1.0 - math.cos(0.07 * k)), 0.01 * wave)
    setpoints[0] = (0.001, 0.0, 0.0)
    run = record(platform, 120, setpoints)
    equations = JointEquations(params, 0.7)
    y = np.concatenate([equations.geometry.inverse((0.0, 0.0, -0.9)), np.zeros(4)])
    bounds = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13}
    worst_m = worst_m_s = 0.0
    for k in range(1, 121):
        arguments = (run.torques_n_m[k],)
        y = solve_ivp(equations.derivative, (0.0, 1e-3), y, args=arguments, **bounds).y[:, -1]
        rates = equations.gain(y[:4]) @ y[4:]
        position_m = np.add(equations.near[:3], (0.0, 0.0, 0.9))
        worst_m = max(worst_m, np.abs(position_m - run.positions_m[k]).max())
        worst_m_s = max(worst_m_s, np.abs(rates[:3] - run.velocities_m_s[k]).max())
    assert np.abs(run.velocities_m_s).max() > 0.3
    assert worst_m < 5e-8
    assert worst_m_s < 1e-6


def test_the_velocities_in_the_middle_agree_with_half_the_step():
    # without encoder steps, as a reading near a step may fall on either side
    params = QuattroParams(**IDEAL_ENCODER)
    whole, halves = (QuattroPlatform(params, payload_kg=0.7) for _ in range(2))
    for platform in (whole, halves):
        platform.set_setpoint((0.02, 0.01, -0.01))
    coarse = np.array(whole.advance(0, MS, 60))
    fine = np.array(halves.advance(0, MS // 2, 120))
    assert coarse.shape == (3, 121)
    assert coarse[:, 1::2] == pytest.approx(fine[:, 2::4], abs=1e-5)
    assert coarse[:, 2::2] == pytest.approx(fine[:, 4::4], abs=1e-6)
    assert coarse[:, -1] == pytest.approx(np.array(whole.velocity_m_s), abs=0.0)


def test_the_velocities_add_up_to_the_displacement():
    platform = QuattroPlatform(QuattroParams())
    platform.set_setpoint((0.02, 0.01, -0.01))
    v = np.array(platform.advance(0, MS, 80))
    simpson_m = 1e-3 / 6.0 * (v[:, :-1:2] + 4.0 * v[:, 1::2] + v[:, 2::2]).sum(axis=1)
    assert simpson_m == pytest.approx(np.array(platform.position_m), abs=1e-7)


def test_the_torque_saturates_and_the_robot_still_arrives():
    platform = QuattroPlatform(QuattroParams(), payload_kg=0.7)
    run = record(platform, 700, {0: (0.3, 0.0, 0.0)})
    assert np.abs(run.torques_n_m).max() == 260.0
    assert (np.abs(run.torques_n_m) == 260.0).any(axis=1).sum() > 20
    assert platform.still
    assert platform.position_m == pytest.approx((0.3, 0.0, 0.0), abs=4e-6)


def test_the_speed_saturates_and_the_robot_still_arrives():
    platform = QuattroPlatform(QuattroParams(speed_limit_rad_s=2.0), payload_kg=0.7)
    run = record(platform, 900, {0: (0.3, 0.0, 0.0)})
    fastest_rad_s = np.abs(run.rates_rad_s).max(axis=1)
    # a joint at the limit is still moved by the plate, which slower joints accelerate; 14 rad/s
    # without the limit
    assert fastest_rad_s.max() < 3.5
    assert (fastest_rad_s > 1.9).sum() > 50
    assert platform.position_m == pytest.approx((0.3, 0.0, 0.0), abs=1e-5)


def test_encoders_round_down_to_their_steps():
    platform = QuattroPlatform(QuattroParams(encoder_counts_per_rev=8192), payload_kg=0.7)
    count_rad = 2.0 * math.pi / (8192 * 33)
    platform.set_setpoint((0.02, 0.01, 0.0))
    for k in range(50):
        platform.advance(k * MS, MS, 1)
        x_m, y_m, z_m = platform.position_m
        angles = QuattroGeometry().inverse((x_m, y_m, z_m - 0.9), platform.angle_rad)
        gaps = np.subtract(angles, platform.joints_rad)
        assert np.all(gaps > -1e-12)
        assert np.all(gaps < count_rad + 1e-12)
        counts = np.array(platform.joint_rates_rad_s) * 1e-3 / count_rad
        assert counts == pytest.approx(np.round(counts), abs=1e-6)


def test_errors_of_the_geometry_move_the_plate_but_not_the_joints():
    errors = {"arm_error_m": (1e-3, -1e-3, 0.0, 0.0), "base_radius_error_m": 5e-4}
    platform = QuattroPlatform(QuattroParams(**errors), payload_kg=0.7)
    nominal = QuattroGeometry().inverse((0.0, 0.0, -0.9))
    assert platform.joints_rad == pytest.approx(nominal, abs=2e-7)
    assert 1e-4 < math.hypot(*platform.position_m) < 5e-3
    platform.set_setpoint((0.05, 0.0, 0.0))
    record(platform, 600)
    assert platform.still
    wanted = QuattroGeometry().inverse((0.05, 0.0, -0.9))
    assert platform.joints_rad == pytest.approx(wanted, abs=4e-6)


def test_a_load_that_pulls_moves_the_plate_little():
    # 1 N along X, from a robot that is kept awake
    platform = QuattroPlatform(QuattroParams(**IDEAL_ENCODER))
    platform.carry(lambda acceleration_m_s2: (1.0, 0.0, 0.0))
    platform.set_setpoint((0.0, 0.0, 1e-6))
    run = record(platform, 100)
    assert 1e-7 < np.abs(run.positions_m[:, 0]).max() < 2e-5


def test_the_force_of_a_rigid_load_acts_as_the_payload():
    rigid = QuattroPlatform(QuattroParams(**IDEAL_ENCODER), payload_kg=0.7)
    pulled = QuattroPlatform(QuattroParams(**IDEAL_ENCODER), payload_kg=0.7)
    pulled.carry(lambda a: (-0.7 * a[0], -0.7 * a[1], -0.7 * (a[2] + GRAVITY)))
    runs = [record(platform, 100, {0: (0.01, 0.01, 0.0)}) for platform in (rigid, pulled)]
    assert runs[0].positions_m == pytest.approx(runs[1].positions_m, abs=1e-12)


@pytest.mark.parametrize(("amplitude_n", "rests"), [(1.4, True), (60.0, False)])
def test_a_swinging_load_keeps_the_robot_awake_where_it_moves_it(amplitude_n, rests):
    robot = QuattroPlatform(QuattroParams(), payload_kg=0.7)
    time_s = [0.0]
    robot.carry(lambda _: (amplitude_n * math.sin(3.13 * time_s[0]), 0.0, -0.7 * GRAVITY))
    robot.set_setpoint((0.001, 0.0, 0.0))
    for k in range(300):
        time_s[0] = 5e-3 * k
        robot.advance(5 * k * MS, MS, 5)
    assert robot.still is rests
    assert robot.position_m == pytest.approx((0.001, 0.0, 0.0), abs=5e-4)


def test_a_force_in_space_takes_the_place_of_the_payload():
    # a point mass, and what a link of 0.5 kg at 30 deg to the vertical adds to it
    direction = np.array([0.3, 0.4, -math.sqrt(0.75)])
    mass = 0.7 * np.eye(3) + 0.5 * np.outer(direction, direction)
    platform = QuattroPlatform(QuattroParams(**IDEAL_ENCODER, **NO_FRICTION), payload_kg=0.7)
    weight = np.array([0.2, 0.0, -0.7 * GRAVITY])
    platform.carry(lambda a: tuple(map(float, weight - mass @ a)))
    platform.set_setpoint((0.01, 0.01, 0.0))
    platform.advance(0, MS, 3)
    motion = platform._motion
    pose, rates = motion.pose, motion.rates
    plate = np.array(motion.acceleration(pose, rates, platform.torques_n_m))
    bare = QuattroMotion(QuattroParams(**NO_FRICTION), 0.0)
    bare.set_load(tuple(map(float, weight - mass @ plate[:3])), (0.0,) * 6)
    assert bare.acceleration(pose, rates, platform.torques_n_m) == pytest.approx(plate, abs=1e-10)


def test_a_bench_moves_its_load_on_the_robot_as_on_the_axes():
    params = BenchParams()
    on_robot = QuattroPlatform(QuattroParams(), params.start_m, params.pendulum.mass_kg)
    benches = [Bench(params), Bench(params, platform=on_robot)]
    for k in range(0, 1500, 5):
        s = min(k / 1000.0, 1.0)
        x_m = 0.2 * (s - math.sin(2.0 * math.pi * s) / (2.0 * math.pi))  # cycloidal
        for bench in benches:
            bench.set_setpoint((x_m, 0.0, 0.0))
            bench.advance((k + 5) * MS)
        assert benches[1].angle_rad == pytest.approx(benches[0].angle_rad, abs=1e-4)
        assert benches[1].position_m == pytest.approx(benches[0].position_m, abs=1e-4)


def test_equal_calls_give_equal_floats():
    setpoints = {k: (1e-4 * k, -5e-5 * k, 2e-5 * k) for k in range(0, 100, 5)}
    runs = [record(QuattroPlatform(QuattroParams()), 150, setpoints) for _ in range(2)]
    for one, other in zip(*runs, strict=True):
        assert np.array_equal(one, other)


def test_batches_and_single_steps_give_equal_floats():
    one, other = (QuattroPlatform(QuattroParams()) for _ in range(2))
    one.set_setpoint((0.01, 0.0, 0.0))
    other.set_setpoint((0.01, 0.0, 0.0))
    batch = one.advance(0, MS, 400)
    singles = [other.advance(k * MS, MS, 1) for k in range(400)]
    for axis in range(3):
        joined = [singles[0][axis][0]]
        for single in singles:
            joined.extend(single[axis][1:])
        assert joined == batch[axis]
    assert one.position_m == other.position_m


def test_a_setpoint_between_samples_waits_for_the_next_one():
    platform = QuattroPlatform(QuattroParams(), payload_kg=0.7)
    platform.set_setpoint((0.01, 0.0, 0.0))
    platform.advance(400_000, 600_000, 1)
    assert math.hypot(*platform.position_m) < 1e-9
    platform.advance(MS, MS, 5)
    assert platform.position_m[0] > 1e-4


@pytest.mark.parametrize(("t_ns", "step_ns"), [(0, 0), (0, -5), (0, 2 * MS), (400_000, MS)])
def test_a_step_across_a_sample_is_refused(t_ns, step_ns):
    with pytest.raises(ValueError, match=r"step_ns = .* at t_ns = .*; must be > 0 and <= .* ns"):
        QuattroPlatform(QuattroParams()).advance(t_ns, step_ns, 1)


def test_setpoints_out_of_reach_are_refused():
    platform = QuattroPlatform(QuattroParams())
    with pytest.raises(ValueError, match="must be within reach of arm"):
        platform.set_setpoint((2.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="must be angles at which all forearms reach"):
        platform.set_joint_setpoint((math.nan, 0.0, 0.0, 0.0))
    assert platform.still
    with pytest.raises(ValueError, match="must be within reach of arm"):
        QuattroPlatform(QuattroParams(), (0.0, 0.0, -1.0))


def test_a_moving_millisecond_costs_less_than_150_us():
    """65 us were measured for most, 80 us where joints reverse."""
    platform = QuattroPlatform(QuattroParams(), payload_kg=0.7)
    times_s = []
    for k in range(10):
        platform.set_setpoint((0.01 * (k % 2), 0.0, 0.0))
        advance = timeit.Timer(lambda k=k: platform.advance(20 * k * MS, MS, 20))
        times_s.append(advance.timeit(number=1) / 20)
    assert not platform.still
    assert min(times_s) < 150e-6


WRONG = {
    "base_radius_m": 0.0,
    "arm_m": -0.4,
    "forearm_m": math.nan,
    "bar_m": 0.0,
    "offset_m": -0.1,
    "arm_error_m": (0.1, 0.0, 0.0, 0.0),
    "forearm_error_m": (0.0, 0.0, 0.0),
    "base_radius_error_m": 0.5,
    "arm_mass_kg": -1.0,
    "forearm_mass_kg": math.inf,
    "plate_mass_kg": 0.0,
    "plate_inertia_kg_m2": 0.0,
    "motor_inertia_kg_m2": 0.0,
    "gear_ratio": 0.5,
    "torque_limit_n_m": 0.0,
    "speed_limit_rad_s": 0.0,
    "coulomb_n_m": -1.0,
    "viscous_n_m_s_rad": -1.0,
    "encoder_counts_per_rev": 1.5,
    "bandwidth_hz": 0.0,
    "damping": 0.0,
    "position_gain_1_s": -1.0,
    "speed_gain_n_m_s_rad": -1.0,
    "reset_time_s": 0.0,
    "gravity_m_s2": -9.81,
    "start_m": math.nan,
    "home_z_m": 0.0,
}


def test_every_parameter_has_a_wrong_value_here():
    assert set(WRONG) == set(QuattroParams.__struct_fields__)


@pytest.mark.parametrize("key", WRONG)
def test_a_wrong_parameter_is_named_with_its_bound(key):
    with pytest.raises(ValueError, match=f"^{key} = .*: expected .*: [a-zA-Z0-9]"):
        QuattroParams(**{key: WRONG[key]})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"coulomb_n_m": 50.0}, r"coulomb_n_m = 50.0 .* must be <= 1000 1/s: lower them"),
        ({"speed_gain_n_m_s_rad": 500.0}, r"speed_gain_n_m_s_rad = 500.0 .* must be <= 800 1/s"),
    ],
)
def test_parameters_that_the_step_cannot_follow_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        QuattroParams(**changes)


def test_a_table_of_an_experiment_gives_the_parameters():
    table = {"kind": "quattro", "start_m": 0.1, "arm_error_m": [0.001, 0.0, 0.0, 0.0]}
    params = msgspec.convert(table, QuattroParams)
    assert params == QuattroParams(start_m=0.1, arm_error_m=(0.001, 0.0, 0.0, 0.0))
    with pytest.raises(msgspec.ValidationError, match="unknown field `arm`"):
        msgspec.convert({"kind": "quattro", "arm": 0.4}, QuattroParams)
    with pytest.raises(msgspec.ValidationError, match="axes"):
        msgspec.convert({"kind": "axes"}, QuattroParams)


def test_the_inertia_of_a_joint_is_that_of_motor_arm_and_half_a_forearm():
    assert QuattroParams().joint_inertia_kg_m2 == pytest.approx(0.376)
    assert QuattroParams().arm_moment_kg_m == pytest.approx(0.25)
    assert QuattroParams().moving_mass_kg == pytest.approx(2.0)
