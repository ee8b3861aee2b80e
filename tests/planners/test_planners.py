"""Plans against the published tables, closed forms and an independent ODE solver."""

from __future__ import annotations

import itertools
import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from planners.catalog import BOUNDARY_VALUE, PLANNERS, plan
from planners.errors import Infeasible, PlanError
from planners.models.pendulum import PendulumModel
from planners.problem import Limits, Problem, Status
from planners.replay import replay
from planners.replay.metrics import swing_after
from planners.trajectories.pieces import polynomial
from planners.trajectories.trajectory import Trajectory

G = 9.81
METRE = PendulumModel(length_m=1.0)

# Source 004, tables 3.1 and 3.2, exact values: T, theta max (linear), travel, v max, v rms,
# a max, a rms.
TABLE = [
    (2.0, 0.0408949, 0.2, 0.138180, 0.104893, 0.771330, 0.278575),
    (1.5, 0.0706171, 0.2, 0.281278, 0.175108, 2.818870, 1.003660),
    (1.1, 0.129065, 0.2, 0.673190, 0.427937, 10.6208, 3.87092),
    (0.75, 0.274738, 0.39324, 2.06776, 1.45624, 51.7787, 19.2329),
    (0.5, 0.615101, 1.07120, 7.76939, 5.19428, 268.696, 100.771),
]
CLOSED = ("convolution", "matrix_exponential")
SHAPED = tuple(name for name in PLANNERS if name not in BOUNDARY_VALUE)
QUICK = (*CLOSED, *SHAPED)  # the numerical solvers have tests of their own
models = st.builds(
    lambda length, zeta: PendulumModel(length_m=length, damping_ratio=zeta),
    st.floats(0.2, 2.0),
    st.one_of(st.just(0.0), st.floats(1e-4, 0.6)),
)
phases = st.floats(1.2, 12.0)  # omega T
slow = st.floats(3.5, 12.0)  # beyond half a period, whatever the damping
LONG_S = 4.5  # more than two periods of a metre: room for every shaper


def problem_of(distance_m=0.2, time_s=1.5, model=METRE, **more):
    return Problem(distance_m=distance_m, time_s=time_s, model=model, **more)


def problem_for(name, **more):
    """Make a problem with enough time for that planner."""
    return problem_of(**({"time_s": 1.5 if name in (*CLOSED, "zv") else LONG_S} | more))


def amplitude(model, end):
    w, z = math.sqrt(G / model.length_m), model.damping_ratio
    return math.hypot(end[0], (end[1] + z * w * end[0]) / (w * math.sqrt(1.0 - z * z)))


def swing_by_dop853(motion, model, *, nonlinear, start=(0.0, 0.0), axis=0):
    """Compute the largest |angle|, and angle and rate at the end, by scipy.

    From theta'' = ..., restarted at every joint.
    """
    w2, damping = G / model.length_m, 2 * model.damping_ratio * math.sqrt(G / model.length_m)
    sin, cos = (math.sin, math.cos) if nonlinear else ((lambda x: x), (lambda x: 1.0))
    trajectory, peak, state = (motion.x, motion.y, motion.z)[axis], abs(start[0]), np.array(start)
    for begin, piece in zip(trajectory.breaks_s, trajectory.pieces, strict=False):

        def rates(t, x, piece=piece, begin=begin):
            push = float(piece.at(np.asarray(t - begin), 2)) / model.length_m
            return [x[1], -w2 * sin(x[0]) - damping * x[1] - push * cos(x[0])]

        span = (begin, begin + piece.duration_s)
        out = solve_ivp(
            rates, span, state, "DOP853", rtol=1e-11, atol=1e-13, events=lambda t, x: x[1]
        )
        state = out.y[:, -1]
        peak = max(peak, abs(state[0]), *abs(out.y_events[0].reshape(-1, 2)[:, 0]))
    return peak, state


@pytest.mark.parametrize(("time_s", "angle", "travel", "v_max", "v_rms", "a_max", "a_rms"), TABLE)
@pytest.mark.parametrize("name", CLOSED)
def test_the_least_energy_move_has_the_published_metrics(
    name, time_s, angle, travel, v_max, v_rms, a_max, a_rms
):
    made = plan(name, problem_of(time_s=time_s))
    m = made.metrics
    ours = (
        m.travel_m,
        m.peak_speed_m_s,
        m.rms_speed_m_s,
        m.peak_acceleration_m_s2,
        m.rms_acceleration_m_s2,
    )
    assert ours == pytest.approx((travel, v_max, v_rms, a_max, a_rms), rel=1e-5)
    peak, end = swing_by_dop853(made.motion, METRE, nonlinear=False)
    assert peak == pytest.approx(angle, rel=1e-5)
    assert abs(end).max() < 1e-9


@settings(max_examples=30, deadline=None)
@given(model=models, phase=phases, distance=st.floats(-1.0, 1.0))
def test_the_least_energy_move_ends_at_rest_with_damping_too(model, phase, distance):
    problem = problem_of(distance, phase / model.natural_frequency_rad_s, model, start_m=0.3)
    made = plan("matrix_exponential", problem)
    end = made.motion.x.pieces[0].at(np.array([problem.time_s]))
    scale = max(abs(distance), 1e-3)
    assert abs(end[0] - 0.3 - distance) <= 1e-9 * scale
    assert (
        abs(made.motion.x.pieces[0].at(np.array([problem.time_s]), 1)[0])
        <= 1e-9 * made.metrics.peak_speed_m_s + 1e-12
    )
    assert made.metrics.residual_swing_rad <= 1e-9 * max(made.metrics.peak_swing_rad, 1e-6)


def test_the_energy_of_a_minimum_energy_move_follows_from_the_gramian():
    model = PendulumModel(length_m=0.7, damping_ratio=0.05)
    space, time_s = model.state_space(), 1.2

    def spread(t, w):  # W' = A W + W A' + B B'
        w = w.reshape(4, 4)
        return (space.a @ w + w @ space.a.T + space.b @ space.b.T).ravel()

    gramian = (
        solve_ivp(spread, (0, time_s), np.zeros(16), "DOP853", rtol=1e-11, atol=1e-14)
        .y[:, -1]
        .reshape(4, 4)
    )
    goal = np.array([0.2, 0.0, 0.0, 0.0])
    made = plan("matrix_exponential", problem_of(0.2, time_s, model))
    assert made.metrics.rms_acceleration_m_s2**2 * time_s == pytest.approx(
        goal @ np.linalg.solve(gramian, goal), rel=1e-7
    )


def test_a_swinging_load_is_brought_to_rest():
    model = PendulumModel(length_m=0.8, damping_ratio=0.01)
    start = {"angle_rad": 0.1, "angular_velocity_rad_s": -0.2, "speed_m_s": 0.05}
    made = plan("matrix_exponential", problem_of(0.15, 1.4, model, start_state=start))
    _, end = swing_by_dop853(made.motion, model, nonlinear=False, start=(0.1, -0.2))
    assert abs(end).max() < 1e-9
    assert made.metrics.residual_swing_rad < 1e-12
    assert float(made.motion.x.at(0.0, 1)) == pytest.approx(0.05, abs=1e-12)


def test_a_load_at_rest_is_brought_to_a_wanted_swing():
    goal = {"angle_rad": -0.05, "angular_velocity_rad_s": 0.1, "speed_m_s": 0.2}
    made = plan("matrix_exponential", problem_of(0.3, 1.8, goal_state=goal))
    _, end = swing_by_dop853(made.motion, METRE, nonlinear=False)
    assert end == pytest.approx([-0.05, 0.1], abs=1e-9)
    assert float(made.motion.x.pieces[0].at(np.array([1.8]), 1)[0]) == pytest.approx(0.2, abs=1e-10)
    assert made.metrics.residual_swing_rad < 1e-12


@pytest.mark.parametrize("name", QUICK)
def test_an_undamped_move_run_backwards_is_the_move_back(name):
    there = plan(name, problem_for(name)).motion.x
    t = np.linspace(0.0, there.duration_s, 101)
    np.testing.assert_allclose(there.at(t) + there.at(there.duration_s - t), 0.2, atol=1e-11)


@pytest.mark.parametrize("name", [*CLOSED, "zv"])
@settings(max_examples=15, deadline=None)
@given(model=models, phase=slow, a=st.floats(-1.0, 1.0), b=st.floats(-1.0, 1.0))
def test_distances_add_up(name, model, phase, a, b):
    t = np.linspace(0.0, phase / model.natural_frequency_rad_s * 1.3, 33)
    moves = [PLANNERS[name](problem_of(d, float(t[-1]), model)).at(t) for d in (a, b, a + b)]
    np.testing.assert_allclose(moves[0] + moves[1], moves[2], atol=1e-10)


@settings(max_examples=20, deadline=None)
@given(model=models, phase=slow, distance=st.floats(-1.0, 1.0))
def test_a_zv_shaped_move_leaves_no_swing_on_the_linear_model(model, phase, distance):
    time_s = phase / model.natural_frequency_rad_s / math.sqrt(1 - model.damping_ratio**2)
    made = plan("zv", problem_of(distance, time_s, model))
    assert made.motion.duration_s == pytest.approx(time_s, rel=1e-12)
    assert made.motion.x.at([0.0, time_s]) == pytest.approx([0.0, distance], abs=1e-12)
    assert made.metrics.residual_swing_rad <= 1e-12 + 1e-12 * abs(distance) / model.length_m


@pytest.mark.parametrize("time_s", [1.3, 2.4])  # copies of the law apart, and overlapping
def test_a_zv_shaped_move_is_two_delayed_copies(time_s):
    model = PendulumModel(length_m=1.0, damping_ratio=0.1)
    made = plan("zv", problem_of(0.2, time_s, model)).motion.x
    half = math.pi / math.sqrt(G * (1 - 0.01))
    k = math.exp(-0.1 * math.pi / math.sqrt(1 - 0.01))
    t = np.linspace(0.0, time_s, 400)

    def law(t):
        return 0.5 - 0.5 * np.cos(math.pi * np.clip(t / (time_s - half), 0.0, 1.0))

    np.testing.assert_allclose(made.at(t), 0.2 * (law(t) + k * law(t - half)) / (1 + k), atol=1e-14)


def test_a_mistuned_zv_leaves_the_swing_of_its_definition():
    made = plan("zv", problem_of(time_s=2.0))
    real = PendulumModel(length_m=0.9)
    _, end = swing_by_dop853(made.motion, real, nonlinear=False)
    assert amplitude(real, end) == pytest.approx(
        14.5e-3, abs=0.05e-3
    )  # source 004, sensitivity to length


def test_zv_in_too_short_a_time_names_the_least_time():
    with pytest.raises(Infeasible, match=r"time_s = 1\.0; must be > 1\.003033") as caught:
        plan("zv", problem_of(time_s=1.0))
    assert caught.value.minimum_time_s == pytest.approx(math.pi / math.sqrt(G), rel=1e-12)
    assert plan("zv", problem_of(time_s=1.01)).metrics.residual_swing_rad < 1e-12


@pytest.mark.parametrize("name", [*CLOSED, "zv", "zvd", "ei"])
@pytest.mark.parametrize(
    "model", [METRE, PendulumModel(length_m=0.15), PendulumModel(length_m=1.0, damping_ratio=0.2)]
)
def test_the_replay_agrees_with_an_independent_nonlinear_pendulum(name, model):
    made = plan(name, problem_for(name, model=model))
    peak, end = swing_by_dop853(made.motion, model, nonlinear=True)
    assert made.metrics.residual_swing_nonlinear_rad == pytest.approx(
        amplitude(model, end), abs=1e-7
    )
    assert made.metrics.peak_swing_rad == pytest.approx(peak, rel=1e-6)


@pytest.mark.parametrize(
    ("time_s", "left"), [(2.0, 4.2e-5), (1.5, 3.7e-4), (1.1, 3.0e-3), (0.75, 0.032)]
)
def test_the_nonlinear_pendulum_keeps_the_published_residual(time_s, left):
    assert plan(
        "matrix_exponential", problem_of(time_s=time_s)
    ).metrics.residual_swing_nonlinear_rad == pytest.approx(left, rel=0.02)


def test_the_replay_stays_within_a_ten_millionth_of_a_radian_for_three_seconds():
    for model in (METRE, PendulumModel(length_m=0.3, damping_ratio=0.05)):
        made = plan(
            "matrix_exponential", problem_of(1.0, 3.0, model, start_state={"angle_rad": 0.4})
        )
        swing = replay(model, made.motion.x, angles_rad=0.4)
        _, end = swing_by_dop853(made.motion, model, nonlinear=True, start=(0.4, 0.0))
        assert [swing.angle_rad[-1, 0], swing.angular_velocity_rad_s[-1, 0]] == pytest.approx(
            end, abs=1e-7
        )


def test_a_sudden_speed_kicks_the_load_by_speed_over_length():
    run = Trajectory(
        (polynomial(0.5, (0.0, 0.02)),)
    )  # 0.02 m/s from the first instant, and a dead stop
    swing, w = replay(METRE, run), math.sqrt(G)
    angle, rate = swing_after(METRE, run)
    assert rate == pytest.approx(-0.02 * math.cos(0.5 * w) + 0.02, rel=1e-12)
    assert angle == pytest.approx(-0.02 / w * math.sin(0.5 * w), rel=1e-12)
    assert [swing.angle_rad[-1, 0], swing.angular_velocity_rad_s[-1, 0]] == pytest.approx(
        [angle[0], rate[0]], abs=1e-6
    )


def test_zero_distance_stands_still():
    for name in PLANNERS:
        made = plan(name, problem_for(name, distance_m=0.0, start_m=0.1))
        assert made.metrics.peak_swing_rad == 0.0
        assert made.motion.at(0.7) == pytest.approx([0.1, 0.0, 0.0], abs=1e-15)
        assert made.metrics.acceleration_continuous


def test_a_move_goes_along_its_axis_only():
    made = plan("zv", problem_of(axis="y"))
    np.testing.assert_allclose(made.motion.at(9.0), [0.0, 0.2, 0.0])
    np.testing.assert_array_equal(made.motion.at(0.7)[[0, 2]], [0.0, 0.0])


def test_exceeded_limits_are_reported_with_value_and_bound():
    free = plan("zv", problem_of())
    assert (free.status, free.reasons) == (Status.OK, ())
    tight = plan(
        "zv",
        problem_of(
            limits=Limits(speed_m_s=0.25, acceleration_m_s2=free.metrics.peak_acceleration_m_s2)
        ),
    )
    assert tight.status is Status.OVER_LIMITS
    assert tight.reasons == (
        "peak speed = 0.316077 m/s; limit 0.25 m/s: give the move more than time_s = 1.5",
    )


def test_the_planner_alone_is_timed_by_the_clock_it_is_given():
    ticks = itertools.count(10.0, 0.25)
    assert plan("zv", problem_of(), timer=lambda: next(ticks)).compute_s == 0.25
    assert plan("zv", problem_of()).compute_s is None


def test_the_state_space_linearises_the_nonlinear_pendulum_at_rest():
    model = PendulumModel(length_m=0.6, damping_ratio=0.07)
    space, h, w = model.state_space(), 1e-6, math.sqrt(G / 0.6)
    assert space.states == ("position_m", "speed_m_s", "angle_rad", "angular_velocity_rad_s")

    def rates(x, u):
        pull = -w * w * math.sin(x[2]) - 2 * 0.07 * w * x[3] - u / 0.6 * math.cos(x[2])
        return np.array([x[1], u, x[3], pull])

    slopes = [(rates(h * e, 0.0) - rates(-h * e, 0.0)) / (2 * h) for e in np.eye(4)]
    np.testing.assert_allclose(space.a, np.array(slopes).T, atol=1e-9)
    np.testing.assert_allclose(
        space.b[:, 0], (rates(np.zeros(4), h) - rates(np.zeros(4), -h)) / (2 * h), atol=1e-9
    )
    assert space.b[3, 0] < 0.0  # the platform runs ahead of the load


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"time_s": 0.0}, r"time_s = 0\.0; must be > 0"),
        ({"time_s": math.nan}, "time_s = nan"),
        ({"time_s": 1e6}, "periods of the load's fastest mode; must be <= 1000"),
        ({"distance_m": math.inf}, "distance_m = inf; must be within"),
        ({"start_m": math.nan}, "start_m = nan"),
        ({"axis": "w"}, "axis = 'w'; must be one of x, y, z"),
        ({"input": "acceleraton"}, "did you mean 'acceleration'"),
        ({"law": "harmonics"}, "did you mean 'harmonic'"),
        ({"robust": ("lenght",)}, "parameter in robust = 'lenght'; did you mean 'length'"),
        (
            {"state_weights": {"angle_rad": -1.0}},
            r"angle_rad in state_weights = -1\.0; must be 0 to",
        ),
        ({"state_weights": {"angle": 1.0}}, "name in state_weights = 'angle'"),
        ({"input_weight": 0.0}, r"input_weight = 0\.0; must be 1e-12 to"),
        ({"input": "jerk", "lag_s": math.nan}, "lag_s = nan; must be 1e-06 to 1000"),
        (
            {"start_state": {"angle": 0.1}},
            "name in start_state = 'angle'; did you mean 'angle_rad'",
        ),
        ({"goal_state": {"angle_rad": math.nan}}, "angle_rad in goal_state = nan"),
    ],
)
def test_an_invalid_problem_is_refused_by_name(bad, words):
    with pytest.raises(PlanError, match=words):
        problem_of(**bad)


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"length_m": -0.2}, r"length_m = -0\.2; must be 0\.001 to"),
        ({"length_m": math.nan}, "length_m = nan"),
        ({"length_m": 1.0, "damping_ratio": 1.0}, r"damping_ratio = 1\.0; must be >= 0 and < 1"),
        ({"length_m": 1.0, "gravity_m_s2": 0.0}, r"gravity_m_s2 = 0\.0"),
    ],
)
def test_an_invalid_model_is_refused_by_name(bad, words):
    with pytest.raises(PlanError, match=words):
        PendulumModel(**bad)


def test_other_mistakes_are_named():
    with pytest.raises(
        PlanError,
        match=r"planner = 'zw'; did you mean 'zv'\? must be one of collocation, convolution",
    ):
        plan("zw", problem_of())
    with pytest.raises(PlanError, match="must be rest to rest"):
        plan("zv", problem_of(start_state={"angle_rad": 0.1}))
    with pytest.raises(PlanError, match=r"speed_m_s = 0\.0 in limits; must be > 0"):
        Limits(speed_m_s=0.0)


@pytest.mark.parametrize("name", CLOSED)
def test_a_time_too_short_for_rounding_is_refused(name):
    with pytest.raises(
        PlanError, match=f"{name} misses the end by .* m in time_s = 0.03; must be within 1e-09 of"
    ):
        plan(name, problem_of(time_s=0.03))


@pytest.mark.parametrize("time_s", [1e-300, 1e-9, 1e-3])
def test_a_time_far_below_a_modal_period_is_refused(time_s):
    with pytest.raises(
        PlanError, match=r"periods of the load; must be >= 0\.01: give it more time"
    ):
        problem_of(time_s=time_s)


def test_a_filter_far_faster_than_the_move_is_refused():
    with pytest.raises(PlanError, match=r"lag_s = 1e-06; must be >= time_s / 100000 = 2e-05"):
        problem_of(time_s=2.0, input="jerk", lag_s=1e-6)


def test_a_load_that_goes_over_the_top_is_not_ok():
    made = plan("convolution", problem_of(time_s=0.4))
    assert made.status is Status.OVER_LIMITS
    assert "peak swing = 2.066" in made.reasons[0]
    assert "limit 1.5708 rad" in made.reasons[0]


def test_a_time_that_is_the_end_but_for_rounding_is_the_end():
    made = plan("zvd", problem_of(time_s=3.1)).motion.x
    end = made.at(made.duration_s, 2)
    assert made.at(made.duration_s * (1 + 4e-16), 2) == end
    assert made.at(made.duration_s * (1 + 1e-9), 2) == 0.0


@pytest.mark.parametrize("name", CLOSED)
def test_a_long_time_with_heavy_damping_does_not_overflow(name):
    model = PendulumModel(length_m=1.0, damping_ratio=0.9)
    made = plan(name, problem_of(time_s=350.0, model=model))
    assert float(made.motion.x.at(350.0)) == pytest.approx(0.2, abs=1e-10)
    assert made.metrics.residual_swing_rad < 1e-12


def test_a_planner_starts_without_scipy():
    code = (
        "import sys, planners.catalog; "
        "sys.exit(any(name.startswith('scipy') for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
