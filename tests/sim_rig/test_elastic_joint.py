"""Elastic joint: matrix exponentials, an independent integrator, closed forms, conservation."""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import simpson, solve_ivp
from scipy.linalg import expm

from rig.errors import ConfigError
from rig.studies.servo import bench
from sim_rig.crossing import first_below, value
from sim_rig.elastic_joint import ElasticJoint, JointTruth
from sim_rig.joint_params import DisturbancePulse, Joint

DATA = tomllib.loads((Path(__file__).parents[1] / "data" / "elastic_joint.toml").read_text())
SAMPLE_S = 1e-3
FloatArray = NDArray[Any]
commands = st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=40)
extended = pytest.mark.skipif(
    np.finfo(np.longdouble).eps > 1e-18, reason="this machine has no extended precision"
)


def run(
    joint: ElasticJoint, torques_n_m: Sequence[float], sample_s: float = SAMPLE_S
) -> list[JointTruth]:
    truths = []
    for torque_n_m in torques_n_m:
        joint.advance(float(torque_n_m), sample_s)
        truths.append(joint.truth())
    return truths


def state(truth: JointTruth) -> FloatArray:
    """State (4,): angle and speed of the motor, then of the load."""
    return np.array(
        [
            truth.motor_angle_rad,
            truth.motor_speed_rad_s,
            truth.load_angle_rad,
            truth.load_speed_rad_s,
        ]
    )


def linear(params: Joint) -> tuple[FloatArray, FloatArray]:
    """A (4, 4) and B (4, 2) of the joint without ripple and dry friction.

    Inputs: torque of the motor, torque of the load.
    """
    n, k, d = params.gear_ratio, params.stiffness_n_m_rad, params.elastic_damping_n_m_s_rad
    jm, jl = params.motor_inertia_kg_m2, params.load_inertia_kg_m2
    motor_damping = d + params.motor_friction_n_m_s_rad
    load_damping = n * n * d + params.load_friction_n_m_s_rad
    a = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-k / jm, -motor_damping / jm, n * k / jm, n * d / jm],
            [0.0, 0.0, 0.0, 1.0],
            [n * k / jl, n * d / jl, -n * n * k / jl, -load_damping / jl],
        ]
    )
    b = np.array([[0.0, 0.0], [1.0 / jm, 0.0], [0.0, 0.0], [0.0, 1.0 / jl]])
    return a, b


def rates(samples: FloatArray, sample_s: float) -> FloatArray:
    """Eigenvalues [1/s] of a free linear motion from its states (N, n)."""
    scaled = samples / np.abs(samples).max(axis=0)
    step, *_ = np.linalg.lstsq(scaled[:-1], scaled[1:], rcond=None)
    return np.log(np.linalg.eigvals(step).astype(complex)) / sample_s


def wiggle(samples: int, amplitude_n_m: float = 0.3) -> FloatArray:
    k = np.arange(samples)
    return amplitude_n_m * np.cos(0.02 * k) * np.sin(0.09 * k)


@pytest.mark.parametrize("name", ["printed", "fitted"])
def test_a_free_joint_oscillates_at_its_resonance_and_slows_at_its_real_pole(name):
    modes, joint = DATA[f"{name}_modes"], ElasticJoint(Joint(**DATA[name]))
    run(joint, [1.0, 1.0, -0.5])
    found = rates(np.array([state(truth) for truth in run(joint, [0.0] * 30, 4e-3)]), 4e-3)
    wave, slow, rigid = (
        found[found.imag > 1.0][0],
        *sorted(abs(found[np.abs(found.imag) <= 1.0]), reverse=True),
    )
    assert abs(wave) == pytest.approx(modes["omega_p"], rel=1e-6)
    assert -wave.real / abs(wave) == pytest.approx(modes["zeta_p"], rel=1e-6)
    assert slow == pytest.approx(modes["real_pole"], rel=1e-6)
    assert rigid < 1e-6


@pytest.mark.parametrize("name", ["printed", "fitted"])
def test_a_load_oscillates_at_the_antiresonance_while_friction_holds_the_motor(name):
    modes, kick = DATA[f"{name}_modes"], (DisturbancePulse(start_s=0.0, end_s=2e-3, load_n_m=50.0),)
    joint = ElasticJoint(Joint(**DATA[name], coulomb_torque_n_m=1.0, disturbances=kick))
    run(joint, [0.0, 0.0])
    truths = run(joint, [0.0] * 30, 4e-3)
    assert all(truth.sticking and truth.motor_angle_rad == 0.0 for truth in truths)
    wave = rates(np.array([state(truth)[2:] for truth in truths]), 4e-3)[0]
    assert abs(wave) == pytest.approx(modes["omega_z"], rel=1e-6)
    assert -wave.real / abs(wave) == pytest.approx(modes["zeta_z"], rel=1e-6)


def exact_linear(params: Joint, torques_n_m: FloatArray) -> FloatArray:
    """Motor angles (N,) in extended precision, by powers of a matrix exponential (its series)."""
    a, b = (matrix.astype(np.longdouble) for matrix in linear(params))
    block = np.zeros((5, 5), np.longdouble)
    block[:4, :4], block[:4, 4] = a * np.longdouble(SAMPLE_S), b[:, 0] * np.longdouble(SAMPLE_S)
    term = step = np.eye(5, dtype=np.longdouble)
    for k in range(1, 60):
        term = term @ block / k
        step = step + term
    x, angles = np.zeros(4, np.longdouble), []
    for torque_n_m in torques_n_m:
        x = step[:4, :4] @ x + step[:4, 4] * torque_n_m
        angles.append(x[0])
    return np.array(angles)


@extended
@pytest.mark.parametrize(
    "changes",
    [{}, {"gear_ratio": 1.0, "load_inertia_kg_m2": 2.7e-4}, {"elastic_damping_n_m_s_rad": 0.0}],
)
def test_the_stated_error_bounds_the_error_of_a_linear_second(changes):
    params, torques = Joint(**changes), 2.0 * np.cos(0.01 * np.arange(1000))
    truths = run(ElasticJoint(params), torques)
    errors = [
        abs(np.longdouble(t.motor_angle_rad) - x)
        for t, x in zip(truths, exact_linear(params, torques), strict=True)
    ]
    assert all(
        error <= truth.integration_error_rad for error, truth in zip(errors, truths, strict=True)
    )
    assert 0.0 < truths[-1].integration_error_rad < 1e-9


@extended
def test_the_stated_error_bounds_the_error_of_sliding_one_way():
    torques, friction = 1.0 + 0.3 * np.sin(0.05 * np.arange(500)), 0.25
    truths = run(ElasticJoint(Joint(coulomb_torque_n_m=friction)), torques)
    assert min(truth.motor_speed_rad_s for truth in truths) > 0.0
    exact = exact_linear(Joint(), torques.astype(np.longdouble) - friction)
    assert all(
        abs(t.motor_angle_rad - x) <= t.integration_error_rad < 1e-9
        for t, x in zip(truths, exact, strict=True)
    )


def extrapolated(
    derivative: Callable[[FloatArray], FloatArray],
    x: FloatArray,
    duration_s: float,
    columns: int = 12,
) -> FloatArray:
    """One Gragg-Bulirsch-Stoer step in extended precision (Hairer, Norsett, Wanner 1993, II.9)."""
    table: list[FloatArray] = []
    for j in range(1, columns + 1):
        h = np.longdouble(duration_s) / (2 * j)
        before, now = x, x + h * derivative(x)
        for _ in range(2 * j - 1):
            before, now = now, before + 2 * h * derivative(now)
        row = [(before + now + h * derivative(now)) / 2]
        for k in range(1, j):
            row.append(row[-1] + (row[-1] - table[k - 1]) / ((np.longdouble(j) / (j - k)) ** 2 - 1))
        table = row
    return table[-1]


@extended
def test_the_stated_error_bounds_the_error_with_ripple():
    params = Joint(
        torque_ripple_n_m=0.05, torque_ripple_cycles_per_rev=4.0, torque_ripple_phase_rad=0.4
    )
    a, b = (matrix.astype(np.longdouble) for matrix in linear(params))
    x, torques = np.zeros(4, np.longdouble), wiggle(200, 1.0)
    for truth, torque_n_m in zip(run(ElasticJoint(params), torques), torques, strict=True):

        def derivative(x, torque_n_m=torque_n_m):
            ripple = np.longdouble(0.05) * np.sin(
                4 * x[0] + np.longdouble(params.torque_ripple_phase_rad)
            )
            return a @ x + b[:, 0] * (torque_n_m + ripple)

        x = extrapolated(derivative, x, SAMPLE_S)
        assert (
            abs(np.longdouble(truth.motor_angle_rad) - x[0]) <= truth.integration_error_rad < 1e-9
        )


def events_by_scipy(
    params: Joint, torques_n_m: FloatArray, step_s: float
) -> tuple[FloatArray, int]:
    """State after the commands, and the number of switches of the friction.

    DOP853 in steps that must be shorter than any slip.
    """
    a, b = linear(params)
    samples = SAMPLE_S * np.arange(len(torques_n_m) + 1)
    edges = [
        edge for p in params.disturbances for edge in (p.start_s, p.end_s) if edge < samples[-1]
    ]
    x, direction, switches = np.zeros(4), 0.0, 0
    friction = params.coulomb_torque_n_m
    tolerance = 1e-12  # more than the rounding of the sums, or a switch could repeat at once
    for begin_s, end_s in itertools.pairwise(sorted({*samples, *edges})):
        middle_s = 0.5 * (begin_s + end_s)
        acting = [p for p in params.disturbances if p.start_s <= middle_s < p.end_s]
        torque = torques_n_m[int(middle_s / SAMPLE_S)] + sum(p.motor_n_m for p in acting)
        load = sum(p.load_n_m for p in acting)

        def free(x, torque=torque, load=load):
            ripple = params.torque_ripple_n_m * math.sin(
                params.torque_ripple_cycles_per_rev * x[0] + params.torque_ripple_phase_rad
            )
            return a @ x + b @ [torque + ripple, load]

        def pull(x, free=free):
            return free(x)[1] * params.motor_inertia_kg_m2

        t_s = begin_s
        while t_s < end_s:
            if friction and direction == 0.0 and abs(pull(x)) > friction + tolerance:
                direction = math.copysign(1.0, pull(x))

            def motion(_, x, direction=direction, free=free):
                slides = direction or not friction
                return (
                    free(x) - b[:, 0] * direction * friction
                    if slides
                    else np.array([0.0, 0.0, *free(x)[2:]])
                )

            def guard(_, x, direction=direction, pull=pull):
                return (
                    x[1] * direction + tolerance
                    if direction
                    else friction + tolerance - abs(pull(x))
                )

            guard.terminal, guard.direction = True, -1.0
            guards = [guard] if friction else None
            leg = solve_ivp(
                motion,
                (t_s, end_s),
                x,
                "DOP853",
                rtol=1e-12,
                atol=1e-14,
                events=guards,
                max_step=step_s,
            )
            t_s, x = leg.t[-1], leg.y[:, -1]
            if leg.status == 1:
                switches += 1
                if direction:
                    x[1] = 0.0
                direction = (
                    0.0
                    if direction and abs(pull(x)) <= friction + tolerance
                    else math.copysign(1.0, pull(x))
                )
    return x, switches


PULSES = (
    DisturbancePulse(start_s=0.0312, end_s=0.1, motor_n_m=0.1, load_n_m=-3.0),
    DisturbancePulse(start_s=0.05, end_s=0.2, load_n_m=8.0),
)


@pytest.mark.parametrize(
    ("changes", "step_s", "switches"),
    [
        ({"disturbances": PULSES}, 1e-3, 0),
        # with steps of 50 us it misses a slip and is 5e-9 rad off
        ({"coulomb_torque_n_m": 0.05}, 2e-5, 18),
        ({"coulomb_torque_n_m": 0.1, "load_friction_n_m_s_rad": 4.9}, 1e-4, 16),
        (
            {
                "coulomb_torque_n_m": 0.08,
                "torque_ripple_n_m": 0.05,
                "torque_ripple_phase_rad": 2,
                "disturbances": PULSES,
            },
            1e-4,
            9,
        ),
    ],
)
def test_sticking_sliding_ripple_and_pulses_agree_with_an_independent_integrator(
    changes, step_s, switches
):
    params, torques = Joint(**changes), wiggle(350)
    expected, switched = events_by_scipy(params, torques, step_s)
    assert switched == switches
    truth = run(ElasticJoint(params), torques)[-1]
    assert np.all(np.abs(state(truth) - expected) < [2e-12, 1e-10, 2e-14, 1e-12])
    assert truth.integration_error_rad < 1e-11


def test_the_motion_under_held_commands_is_that_of_the_matrix_exponential():
    params, torques = Joint(**DATA["fitted"]), wiggle(400)
    a, b = linear(params)
    step = expm(np.block([[a, b[:, :1]], [np.zeros((1, 5))]]) * SAMPLE_S)
    x = np.zeros(5)
    for truth, x[4] in zip(run(ElasticJoint(params), torques), torques, strict=True):
        x = step @ x
        np.testing.assert_allclose(state(truth), x[:4], rtol=1e-9, atol=1e-11)


def test_the_motion_does_not_depend_on_the_sample_time():
    params = Joint(coulomb_torque_n_m=0.05, torque_ripple_n_m=0.03, disturbances=PULSES)
    whole, parts = ElasticJoint(params), ElasticJoint(params)
    for torque_n_m in wiggle(60):
        whole.advance(torque_n_m, 5e-3)
        run(parts, [torque_n_m] * 7, 5e-3 / 7)
        assert whole.truth().motor_angle_rad == pytest.approx(
            parts.truth().motor_angle_rad, abs=1e-12
        )


def test_the_work_equals_kinetic_elastic_and_ripple_energy_and_friction_losses():
    p = Joint(
        **DATA["fitted"],
        torque_ripple_n_m=0.05,
        torque_ripple_phase_rad=0.7,
        coulomb_torque_n_m=0.1,
    )
    torque_n_m, sample_s = 0.6, 1e-4
    x = np.array(
        [
            np.zeros(4),
            *(state(truth) for truth in run(ElasticJoint(p), [torque_n_m] * 2000, sample_s)),
        ]
    )
    (q, w, ql, wl), n = x.T, p.gear_ratio
    assert np.all(np.diff(q) > 0.0)
    stored = 0.5 * p.motor_inertia_kg_m2 * w[-1] ** 2 + 0.5 * p.load_inertia_kg_m2 * wl[-1] ** 2
    stored += 0.5 * p.stiffness_n_m_rad * (q[-1] - n * ql[-1]) ** 2
    stored += p.torque_ripple_n_m / 2.0 * (math.cos(2.0 * q[-1] + 0.7) - math.cos(0.7))
    power = p.motor_friction_n_m_s_rad * w**2 + p.load_friction_n_m_s_rad * wl**2
    lost = (
        simpson(power + p.elastic_damping_n_m_s_rad * (w - n * wl) ** 2, dx=sample_s)
        + p.coulomb_torque_n_m * q[-1]
    )
    assert stored + lost == pytest.approx(torque_n_m * q[-1], rel=1e-9)


@settings(max_examples=25)
@given(commands)
def test_the_momentum_without_outer_friction_is_the_impulse(torques):
    p = Joint(motor_friction_n_m_s_rad=0.0)
    truth = run(ElasticJoint(p), torques)[-1]
    momentum = (
        p.motor_inertia_kg_m2 * truth.motor_speed_rad_s
        + p.load_inertia_kg_m2 / p.gear_ratio * truth.load_speed_rad_s
    )
    assert momentum == pytest.approx(math.fsum(torques) * SAMPLE_S, abs=1e-15)


def test_an_undamped_joint_keeps_its_energy_for_a_thousand_oscillations():
    p = Joint(
        motor_friction_n_m_s_rad=0.0,
        elastic_damping_n_m_s_rad=0.0,
        gear_ratio=1.0,
        load_inertia_kg_m2=2.7e-4,
    )
    joint = ElasticJoint(p)

    def energy(truth):
        twist = truth.motor_angle_rad - truth.load_angle_rad
        moving = (
            p.motor_inertia_kg_m2 * truth.motor_speed_rad_s**2
            + p.load_inertia_kg_m2 * truth.load_speed_rad_s**2
        )
        return 0.5 * moving + 0.5 * p.stiffness_n_m_rad * twist**2

    first, *_, last = run(joint, [1.0] * 5) + run(joint, [0.0] * 7000, 5e-3)
    start = energy(run(ElasticJoint(p), [1.0] * 5)[-1])
    assert energy(last) == pytest.approx(start, rel=1e-10)
    assert energy(first) < start


@settings(max_examples=25)
@given(st.lists(st.floats(-0.2, 0.2), min_size=1, max_size=40))
def test_a_torque_up_to_the_dry_friction_moves_nothing(torques):
    for truth in run(ElasticJoint(Joint(coulomb_torque_n_m=0.2)), [*torques, 0.2, -0.2]):
        assert truth.sticking
        assert state(truth).tolist() == [0.0] * 4


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_torque_above_the_dry_friction_moves_the_motor_in_its_direction(sign):
    truth = run(ElasticJoint(Joint(coulomb_torque_n_m=0.2)), [sign * 0.2000001], 1e-5)[-1]
    assert not truth.sticking
    assert sign * truth.motor_speed_rad_s == pytest.approx(1e-7 / 1.5e-4 * 1e-5, rel=1e-3)


@settings(max_examples=25)
@given(commands)
def test_opposite_torques_give_the_opposite_motion(torques):
    params = Joint(coulomb_torque_n_m=0.1, torque_ripple_n_m=0.05, torque_limit_n_m=0.8)
    one, other = (
        run(ElasticJoint(params), torques),
        run(ElasticJoint(params), [-torque for torque in torques]),
    )
    for a, b in zip(one, other, strict=True):
        assert state(a).tolist() == (-state(b)).tolist()
        assert a.sticking == b.sticking


def test_a_motor_without_command_slides_to_rest_and_sticks_while_the_load_oscillates():
    joint = ElasticJoint(Joint(coulomb_torque_n_m=0.02))
    run(joint, [1.0] * 5)
    truths = run(joint, [0.0] * 300)
    speeds = np.array([truth.motor_speed_rad_s for truth in truths])
    last = max(k for k, truth in enumerate(truths) if not truth.sticking)
    assert speeds.min() < 0.0 < speeds.max()  # the load pulls it back in between
    assert np.all(speeds[last + 1 :] == 0.0)
    assert len({truth.motor_angle_rad for truth in truths[last + 1 :]}) == 1
    assert truths[last + 2].load_speed_rad_s != 0.0


def test_half_of_ratio_times_friction_on_the_load_turns_the_motor():
    """The torque of an undamped spring oscillates up to twice the step on the load."""

    def moved(load_n_m):
        pulse = (DisturbancePulse(start_s=0.0, end_s=10.0, load_n_m=load_n_m),)
        undamped = Joint(coulomb_torque_n_m=0.1, elastic_damping_n_m_s_rad=0.0, disturbances=pulse)
        return run(ElasticJoint(undamped), [0.0] * 50)[-1].motor_angle_rad

    assert moved(5.0 - 1e-6) == 0.0
    assert moved(5.0 + 1e-6) > 0.0
    assert moved(-5.0 - 1e-6) < 0.0


@settings(max_examples=20)
@given(commands, commands)
def test_the_energy_of_the_difference_of_two_motions_never_increases(first, second):
    p = Joint(coulomb_torque_n_m=0.1)
    one, other = ElasticJoint(p), ElasticJoint(p)
    run(one, first)
    run(other, second)
    before = math.inf
    for torque_n_m in wiggle(40, 0.4):
        (q, w, ql, wl) = state(run(one, [torque_n_m])[0]) - state(run(other, [torque_n_m])[0])
        twist = q - p.gear_ratio * ql
        energy = (
            p.motor_inertia_kg_m2 * w**2
            + p.load_inertia_kg_m2 * wl**2
            + p.stiffness_n_m_rad * twist**2
        )
        assert energy <= before * (1.0 + 1e-12) + 1e-25
        before = energy


@pytest.mark.parametrize(("cycles", "phase_rad"), [(2.0, 0.3), (5.0, -1.0)])
def test_ripple_holds_the_motor_at_the_torque_balance_and_a_period_further(cycles, phase_rad):
    params = Joint(
        motor_friction_n_m_s_rad=0.05,
        torque_ripple_n_m=0.2,
        torque_ripple_cycles_per_rev=cycles,
        torque_ripple_phase_rad=phase_rad,
    )
    joint = ElasticJoint(params)

    def rest(torque_n_m):
        return run(joint, [torque_n_m] * 60, 0.1)[-1].motor_angle_rad

    first, balanced = rest(0.0), rest(0.1)
    assert math.remainder(cycles * first + phase_rad - math.pi, 2.0 * math.pi) == pytest.approx(
        0.0, abs=1e-9
    )
    assert cycles * (balanced - first) == pytest.approx(math.asin(0.1 / 0.2), abs=1e-9)
    run(joint, [0.5] * 10, 0.1)
    turns = (rest(0.0) - first) * cycles / (2.0 * math.pi)
    assert turns >= 1.0 - 1e-9
    assert turns == pytest.approx(round(turns), abs=1e-9)


@settings(max_examples=25)
@given(commands, st.integers(1, 2**20))
def test_the_encoder_reading_is_the_last_count_passed(torques, counts):
    joint, count_rad = ElasticJoint(Joint(encoder_counts_per_rev=counts)), 2.0 * math.pi / counts
    for torque_n_m in torques:
        joint.advance(torque_n_m, SAMPLE_S)
        read_rad, angle_rad = joint.read().motor_angle_rad, joint.truth().motor_angle_rad
        assert read_rad - 1e-12 <= angle_rad < read_rad + count_rad + 1e-12
        assert math.remainder(read_rad, count_rad) == pytest.approx(0.0, abs=1e-12)


def test_a_turn_has_as_many_readings_as_the_encoder_counts():
    joint, seen = ElasticJoint(Joint(encoder_counts_per_rev=48)), set()
    while joint.truth().motor_angle_rad < 2.0 * math.pi:
        seen.add(joint.read().motor_angle_rad)
        joint.advance(0.2, SAMPLE_S)
    assert sorted(seen) == pytest.approx([k * 2.0 * math.pi / 48 for k in range(48)])


def test_an_encoder_without_steps_reads_the_angle_and_its_ripple():
    params = Joint(
        encoder_counts_per_rev=0, encoder_ripple_rad=2e-3, encoder_ripple_cycles_per_rev=3.0
    )
    joint, errors, angles = ElasticJoint(params), [], []
    for truth in (run(joint, [0.3])[0] for _ in range(200)):
        angles.append(truth.motor_angle_rad)
        errors.append(joint.read().motor_angle_rad - truth.motor_angle_rad)
    np.testing.assert_allclose(errors, 2e-3 * np.sin(3.0 * np.array(angles)), atol=1e-14)
    assert max(angles) > 2.0 * math.pi / 3.0


def test_the_drive_limits_the_command():
    limited, plain = ElasticJoint(Joint(torque_limit_n_m=0.5)), ElasticJoint(Joint())
    for commanded_n_m, applied_n_m in ((2.0, 0.5), (-9.0, -0.5), (0.3, 0.3)):
        truth = run(limited, [commanded_n_m])[0]
        assert truth.applied_torque_n_m == applied_n_m
        assert state(truth).tolist() == state(run(plain, [applied_n_m])[0]).tolist()


def test_a_pulse_on_the_motor_acts_as_a_command_between_its_edges():
    disturbed = ElasticJoint(
        Joint(disturbances=(DisturbancePulse(start_s=0.0013, end_s=0.0047, motor_n_m=0.4),))
    )
    commanded = ElasticJoint(Joint())
    run(disturbed, [0.1] * 8)
    for torque_n_m, duration_s in ((0.1, 0.0013), (0.5, 0.0034), (0.1, 0.0033)):
        commanded.advance(torque_n_m, duration_s)
    np.testing.assert_allclose(state(disturbed.truth()), state(commanded.truth()), rtol=1e-12)


def test_pulses_that_overlap_add_up_and_are_over_when_they_end():
    joint = ElasticJoint(
        Joint(
            disturbances=(
                DisturbancePulse(start_s=0.0, end_s=0.3, load_n_m=5.4),
                DisturbancePulse(start_s=0.1, end_s=0.2, load_n_m=2.7),
            )
        )
    )
    reads = [joint.read().load_acceleration_rad_s2]
    for _ in range(4):
        run(joint, [0.0] * 99)
        before = joint.read()
        joint.advance(0.0, SAMPLE_S)
        reads.append(joint.read().load_acceleration_rad_s2 - before.load_acceleration_rad_s2)
    assert reads[0] == pytest.approx(2.0, rel=1e-12)  # 5.4 N m on 2.7 kg m2
    # the tolerance covers the motion within the sample of the step
    assert reads[1:] == pytest.approx([1.0, -1.0, -2.0, 0.0], abs=0.2)


def test_the_accelerometer_reading_is_the_derivative_of_the_load_speed():
    joint = ElasticJoint(Joint(**DATA["fitted"], accelerometer_bias_rad_s2=0.25))
    step_s = 1e-5
    for torque_n_m in wiggle(20, 1.0):
        before = run(joint, [torque_n_m] * 20, step_s)[-1].load_speed_rad_s
        joint.advance(torque_n_m, step_s)
        read = joint.read().load_acceleration_rad_s2
        after = run(joint, [torque_n_m], step_s)[-1].load_speed_rad_s
        assert read - 0.25 == pytest.approx((after - before) / (2.0 * step_s), abs=1e-4)


def test_accelerometer_noise_is_white_gaussian_and_of_the_stated_size():
    joint = ElasticJoint(
        Joint(accelerometer_noise_rad_s2=0.3, accelerometer_bias_rad_s2=-1.0), seed=4
    )
    noise = []
    for _ in range(20_000):
        joint.advance(0.0, SAMPLE_S)
        noise.append(joint.read().load_acceleration_rad_s2 + 1.0)
    z = np.array(noise) / 0.3
    assert abs(z.mean()) < 4.0 / math.sqrt(z.size)
    assert z.std() == pytest.approx(1.0, abs=4.0 / math.sqrt(2.0 * z.size))
    assert abs(np.mean(z[1:] * z[:-1])) < 4.0 / math.sqrt(z.size)
    assert np.mean(np.abs(z) > 1.959964) == pytest.approx(
        0.05, abs=4.0 * math.sqrt(0.05 * 0.95 / z.size)
    )


def test_the_same_seed_gives_the_same_readings_however_often_they_are_read():
    params = Joint(accelerometer_noise_rad_s2=0.3)
    one, same, other = (
        ElasticJoint(params, seed=1),
        ElasticJoint(params, seed=1),
        ElasticJoint(params, seed=2),
    )
    for torque_n_m in wiggle(10):
        for joint in (one, same, other):
            joint.advance(torque_n_m, SAMPLE_S)
        first = one.read()
        assert one.read() == first == same.read()
        assert other.read().motor_angle_rad == first.motor_angle_rad
        assert other.read().load_acceleration_rad_s2 != first.load_acceleration_rad_s2


def test_a_ratio_of_one_is_the_same_joint_seen_from_the_motor():
    geared = Joint(**DATA["fitted"], coulomb_torque_n_m=0.05, torque_ripple_n_m=0.02)
    direct = Joint(
        **DATA["fitted"]
        | {
            "gear_ratio": 1.0,
            "load_inertia_kg_m2": 2.8736758e-4,
            "load_friction_n_m_s_rad": 4.9173636e-4,
        },
        coulomb_torque_n_m=0.05,
        torque_ripple_n_m=0.02,
    )
    scale = np.array([1.0, 1.0, 100.0, 100.0])
    for a, b in zip(
        run(ElasticJoint(geared), wiggle(200)), run(ElasticJoint(direct), wiggle(200)), strict=True
    ):
        np.testing.assert_allclose(state(a) * scale, state(b), atol=1e-11)


def test_a_stiff_joint_moves_as_one_body():
    p = Joint(stiffness_n_m_rad=4e5, motor_friction_n_m_s_rad=0.0)  # 64,000 rad/s
    truth = run(ElasticJoint(p), [0.42] * 5)[-1]
    angle_rad = 0.5 * 0.42 / (1.5e-4 + 2.7e-4) * 0.005**2
    assert truth.motor_angle_rad == pytest.approx(angle_rad, abs=2e-6)  # the twist is 7e-7 rad
    assert truth.motor_angle_rad == pytest.approx(100.0 * truth.load_angle_rad, abs=2e-6)


def test_a_sample_of_zero_duration_moves_nothing():
    joint = ElasticJoint(
        Joint(disturbances=(DisturbancePulse(start_s=0.0, end_s=1.0, motor_n_m=1.0),))
    )
    run(joint, [0.5] * 3)
    before = joint.truth()
    joint.advance(-0.7, 0.0)
    assert joint.truth() == before._replace(applied_torque_n_m=-0.7)


def test_many_samples_add_up_to_the_time_they_last():
    joint = ElasticJoint(Joint())
    for _ in range(30_000):
        joint.advance(0.0, 1e-4)
    assert joint.truth().t_s == math.fsum([1e-4] * 30_000)


@pytest.mark.parametrize("torque_n_m", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_not_finite_is_refused(torque_n_m):
    with pytest.raises(ValueError, match=r"torque_n_m = .*; must be finite: look for"):
        ElasticJoint(Joint()).advance(torque_n_m, SAMPLE_S)


@pytest.mark.parametrize("duration_s", [-1e-9, math.nan, math.inf])
def test_a_duration_that_is_negative_or_not_finite_is_refused(duration_s):
    with pytest.raises(ValueError, match=r"duration_s = .*; must be >= 0 and finite"):
        ElasticJoint(Joint()).advance(0.0, duration_s)


def test_a_motor_beyond_its_largest_speed_is_refused():
    joint = ElasticJoint(Joint(motor_friction_n_m_s_rad=0.0))
    message = r"motor_speed_rad_s = .*; must be <= 1e\+06: stabilise the controller"
    with pytest.raises(ValueError, match=message):
        run(joint, [1e5] * 100)


WRONG = {
    "motor_inertia_kg_m2": 0.0,
    "load_inertia_kg_m2": -2.7,
    "gear_ratio": 0.0,
    "motor_friction_n_m_s_rad": -1e-3,
    "load_friction_n_m_s_rad": math.inf,
    "stiffness_n_m_rad": 0.0,
    "elastic_damping_n_m_s_rad": math.nan,
    "torque_limit_n_m": 0.0,
    "torque_ripple_n_m": -0.1,
    "torque_ripple_cycles_per_rev": 0.0,
    "torque_ripple_phase_rad": math.inf,
    "coulomb_torque_n_m": -0.1,
    "encoder_ripple_rad": 2.0,
    "encoder_ripple_cycles_per_rev": -1.0,
    "encoder_counts_per_rev": 1.5,
    "accelerometer_noise_rad_s2": -1.0,
    "accelerometer_bias_rad_s2": math.nan,
    "disturbances": ("none",),
}


def test_every_parameter_has_a_wrong_value_here():
    assert set(WRONG) == set(Joint.__struct_fields__)


@pytest.mark.parametrize("key", WRONG)
def test_a_wrong_parameter_is_named_with_its_value_and_bound(key):
    with pytest.raises(ValueError, match=f"^{key} = .*: expected .*: [a-zA-Z0-9]"):
        Joint(**{key: WRONG[key]})


@settings(max_examples=50)
@given(st.sampled_from(sorted(set(WRONG) - {"disturbances"})), st.floats())
def test_a_joint_that_exists_can_be_advanced(key, number):
    try:
        joint = ElasticJoint(Joint(**{key: number}))
    except ValueError:
        return
    assert all(math.isfinite(x) for x in state(run(joint, [0.01], 1e-5)[0]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"stiffness_n_m_rad": 1e9},
            r"stiffness_n_m_rad = .* rad/s; must be <= 100000 rad/s: lower it",
        ),
        (
            {"elastic_damping_n_m_s_rad": 100.0},
            r"elastic_damping_n_m_s_rad = .* rad/s; must be <= 100000",
        ),
        ({"motor_inertia_kg_m2": 1e-9}, r"must be <= 100000 rad/s"),
        (
            {"encoder_ripple_rad": 0.5, "encoder_ripple_cycles_per_rev": 2.0},
            r"their product must be < 1",
        ),
    ],
)
def test_contradictory_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Joint(**changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start_s": 1.0, "end_s": 1.0}, r"end_s = 1.0 of a disturbance; must be > start_s = 1.0"),
        ({"start_s": -1.0, "end_s": 1.0}, r"start_s = -1.0: expected"),
        ({"start_s": 0.0, "end_s": math.nan}, r"end_s = nan: expected"),
        ({"start_s": 0.0, "end_s": 1.0, "load_n_m": math.inf}, r"load_n_m = inf: expected"),
        ({"start_s": 0.0, "end_s": 1.0, "motor_n_m": -1e9}, r"motor_n_m = -1000000000.0: expected"),
    ],
)
def test_an_invalid_pulse_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        DisturbancePulse(**changes)


def test_the_door_builds_the_joint_of_a_file_s_table():
    joint = bench.elastic_joint(
        {"gear_ratio": 50, "disturbances": [{"start_s": 0, "end_s": 1, "load_n_m": 2}]}, 3
    )
    assert joint.params == Joint(
        gear_ratio=50.0, disturbances=(DisturbancePulse(start_s=0.0, end_s=1.0, load_n_m=2.0),)
    )


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {"stifness_n_m_rad": 3.1},
            r"\[bench\] stifness_n_m_rad: unknown key, did you mean 'stiffness_n_m_rad'",
        ),
        ({"gear_ratio": -1}, r"\[bench\] gear_ratio = -1: expected"),
        (
            {"stiffness_n_m_rad": 1e9},
            r"\[bench\] stiffness_n_m_rad = 1000000000.0 gives a mode of .*must be <= 100000 rad/s",
        ),
        ({"disturbances": [{"start_s": 0, "end_s": -1}]}, r"\[bench.disturbances.0\] end_s = -1"),
    ],
)
def test_the_door_names_what_is_wrong_in_the_file(table, message):
    with pytest.raises(ConfigError, match=message):
        bench.elastic_joint(table, 0)


def test_a_dip_below_the_floor_is_found_however_short():
    dip = [0.25 - 1e-9, -1.0, 1.0]  # (t - 0.5)^2 - 1e-9
    assert first_below(dip, 0.0) == pytest.approx(0.5 - math.sqrt(1e-9), abs=1e-10)
    assert first_below([0.25 + 1e-9, -1.0, 1.0], 0.0) is None


@settings(max_examples=200)
@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=12))
def test_the_first_crossing_agrees_with_a_grid(terms):
    found, grid = first_below(terms, 0.0), np.linspace(0.0, 1.0, 501)
    below = grid[np.polynomial.polynomial.polyval(grid, terms) < -1e-12]
    if found is None:
        assert below.size == 0
    else:
        assert below.size == 0 or found <= below[0]
        assert (
            value(terms, found) == pytest.approx(min(terms[0], 0.0), abs=1e-12)
            or value(terms, found) > 0.0
        )
