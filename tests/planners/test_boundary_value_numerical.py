"""Finite differences, shooting and collocation against closed forms and each other.

Also against Riccati's equation and an ODE solver.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are

from planners.boundary_value.collocation import plan_collocation
from planners.boundary_value.conditions import boundary_value_problem
from planners.boundary_value.convolution import plan_convolution
from planners.boundary_value.finite_differences import plan_finite_differences, solve_trapezoidal
from planners.boundary_value.linear import linear_problem
from planners.boundary_value.matrix_exponential import plan_matrix_exponential
from planners.boundary_value.nodes import (
    Nodes,
    WorkBudget,
    checked_trajectory,
    graded_grid,
    input_from_costates,
    through_nodes,
)
from planners.boundary_value.nonlinear import NonlinearPendulum
from planners.boundary_value.shooting import plan_shooting
from planners.errors import NotConverged, PlanError
from planners.models.chain import ChainModel, Link
from planners.models.pendulum import PendulumModel
from planners.problem import Problem
from planners.trajectories.cells import resolve

METRE = PendulumModel(length_m=1.0)
BARS = ChainModel(  # source 004, chapter 4
    links=(Link(0.5, 3.375), Link(0.5, 3.375)),
    stiffness_n_m_rad=(10.0,),
    joint_damping_n_m_s_rad=(2.214e-4,),
)
TWENTY = ChainModel(links=tuple(Link(0.5, 1.0) for _ in range(20)))
PLANNERS = {
    "collocation": plan_collocation,
    "finite_differences": plan_finite_differences,
    "shooting": plan_shooting,
}
ONE_LENGTH, TWO_LENGTHS = ("length",), ("length_2",)
TABLE = [  # model, input, robust, times: every problem of source 004's tables
    (METRE, "acceleration", (), (2.0, 1.5, 1.1, 0.75, 0.5)),
    (METRE, "force", (), (2.0, 1.5)),
    (METRE, "acceleration", ONE_LENGTH, (2.5, 2.0, 1.5)),
    (METRE, "jerk", (), (2.0, 1.5, 0.75)),
    (METRE, "jerk", ONE_LENGTH, (2.0, 1.5)),
    (BARS, "acceleration", (), (2.5, 2.0, 1.5)),
    (BARS, "force", (), (2.0, 1.5)),
    (BARS, "acceleration", TWO_LENGTHS, (2.5, 2.0, 1.5)),
    (BARS, "jerk", (), (2.0, 1.5)),
    (BARS, "jerk", TWO_LENGTHS, (2.0, 1.5)),
]
CASES = [
    (model, input, robust, time_s) for model, input, robust, times in TABLE for time_s in times
]
SLOWEST = [
    case for case in CASES if case[0] is BARS and case[2] and case[3] > 1.5
]  # half a second each by collocation


def problem_of(model=METRE, input="acceleration", robust=(), time_s=1.5, **more):
    return Problem(
        **{
            "distance_m": 0.2,
            "time_s": time_s,
            "model": model,
            "input": input,
            "robust": robust,
            **more,
        }
    )


def apart(a, b, order=2):
    """Compute the largest difference of two derivatives, relative to the second one's peak."""
    t = np.linspace(0.0, b.duration_s, 2001)
    return np.abs(a.at(t, order) - b.at(t, order)).max() / b.peak(order).value


def label(case):
    model, input, robust, time_s = case
    return f"{model.links_count + 1}dof-{input}-{'robust-' if robust else ''}{time_s}"


@cache
def exact(case):
    return plan_convolution(problem_of(*case))


@pytest.mark.parametrize("case", CASES, ids=label)
def test_finite_differences_meet_the_convolution(case):
    made = plan_finite_differences(problem_of(*case))
    assert apart(made, exact(case)) < 1e-6
    assert apart(made, exact(case), 0) < 1e-9


@pytest.mark.parametrize("case", [case for case in CASES if case not in SLOWEST[:-1]], ids=label)
def test_collocation_meets_the_convolution(case):
    made = plan_collocation(problem_of(*case))
    assert apart(made, exact(case)) < 1e-6
    assert apart(made, exact(case), 0) < 1e-7


@pytest.mark.parametrize("case", [case for case in CASES if case[1] != "jerk"], ids=label)
def test_shooting_meets_the_convolution(case):
    made = plan_shooting(problem_of(*case))
    assert apart(made, exact(case)) < 1e-6
    assert apart(made, exact(case), 0) < 1e-9


@pytest.mark.parametrize("case", [case for case in CASES if case[1] == "jerk"], ids=label)
def test_shooting_through_a_fast_filter_is_refused_with_its_growth(case):
    growth = rf"exp\({case[3] * 20 * math.pi:.4g}\) times in time_s = {case[3]}; "
    bound = r"must be <= 1e\+08.*take convolution"
    with pytest.raises(NotConverged, match=growth + bound):
        plan_shooting(problem_of(*case))


def test_shooting_through_a_slow_filter_hits():
    problem = problem_of(input="jerk", lag_s=0.15)
    assert apart(plan_shooting(problem), plan_convolution(problem)) < 1e-6


@pytest.mark.parametrize("case", [case for case in CASES if case[1] != "jerk"], ids=label)
def test_the_raw_trapezoid_is_near_with_200_intervals(case):
    bound = (
        2e-3 if case[0] is METRE else 1e-2
    )  # the second mode of two links turns 0.2 rad an interval
    nodes = solve_trapezoidal(linear_problem(problem_of(*case)))
    if case[1] == "acceleration":
        truth = exact(case).at(nodes.t_s, 2)
        assert np.abs(nodes.input - truth).max() < bound * np.abs(truth).max()
    assert np.abs(nodes.states[:, 0] - exact(case).at(nodes.t_s)).max() < bound * 0.2


@pytest.mark.parametrize(
    ("robust", "time_s", "peak_m_s2"),
    [
        ((), 2.0, 0.708199),
        ((), 1.5, 2.39818),
        (ONE_LENGTH, 2.0, 6.17524),
        (ONE_LENGTH, 1.5, 35.206),
    ],
)
def test_the_raw_trapezoid_has_the_published_discretisation_of_the_jerk_model(
    robust, time_s, peak_m_s2
):
    """Source 004, tables 3.8 as recomputed with its N = 200: the exact peaks lie 2 % away."""
    nodes = solve_trapezoidal(linear_problem(problem_of(METRE, "jerk", robust, time_s)), 200)
    assert nodes.states[:, 4].max() == pytest.approx(peak_m_s2, rel=1e-5)


@pytest.mark.parametrize("case", [CASES[0], CASES[7], CASES[-3]], ids=label)
def test_the_trapezoid_is_of_second_order(case):
    linear = linear_problem(problem_of(*case))
    coarse, middle, fine = (solve_trapezoidal(linear, 400 * 2**k).states[:: 2**k] for k in range(3))
    ratio = np.abs(coarse - middle).max(axis=0) / np.abs(middle - fine).max(axis=0)
    np.testing.assert_allclose(ratio, 4.0, rtol=0.02)


def test_the_trapezoid_keeps_its_scheme_its_ends_and_its_input():
    linear = linear_problem(
        problem_of(METRE, "force", start_m=0.3, start_state={"angle_rad": 0.02})
    )
    nodes = solve_trapezoidal(linear, 150)
    assert nodes.t_s.shape == nodes.input.shape == (151,)
    np.testing.assert_allclose(nodes.states[[0, -1]], [linear.start, linear.goal], atol=1e-12)
    np.testing.assert_allclose(nodes.input, input_from_costates(linear, nodes.costates), rtol=1e-12)
    slope = nodes.states @ linear.a.T + np.outer(nodes.input, linear.b)
    steps = np.diff(nodes.t_s)[:, None] * (slope[1:] + slope[:-1]) / 2.0
    np.testing.assert_allclose(np.diff(nodes.states, axis=0), steps, atol=1e-12)


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("input", ["acceleration", "force"])
def test_a_swinging_load_is_caught_and_sent_off(planner, input):
    start = {"angle_1_rad": 0.05, "angular_velocity_2_rad_s": -0.3, "speed_m_s": 0.1}
    goal = {"angle_2_rad": -0.02, "speed_m_s": 0.2}
    problem = problem_of(BARS, input, (), 1.7, start_state=start, goal_state=goal, start_m=-0.4)
    made = PLANNERS[planner](problem)
    assert apart(made, plan_convolution(problem)) < 1e-6
    np.testing.assert_allclose(made.at([0.0, 1.7 - 1e-12]), [-0.4, -0.2], atol=1e-10)


@pytest.mark.parametrize("planner", PLANNERS)
def test_weights_on_the_states_agree_with_the_matrix_exponential(planner):
    weights = {"angle_rad": 300.0, "speed_m_s": 5.0, "position_m": 2.0}
    problem = problem_of(state_weights=weights, start_m=0.1, input_weight=0.5)
    made = PLANNERS[planner](problem)
    assert apart(made, plan_matrix_exponential(problem)) < 1e-6
    assert apart(made, plan_convolution(problem_of())) > 0.01  # the weights matter


def test_a_long_horizon_with_weights_is_the_regulator_of_riccati():
    weights = {
        "position_m": 4.0,
        "speed_m_s": 1.0,
        "angle_rad": 20.0,
        "angular_velocity_rad_s": 3.0,
    }
    problem = problem_of(
        time_s=20.0,
        distance_m=0.3,
        start_m=-0.3,
        state_weights=weights,
        start_state={"angle_rad": 0.1},
    )
    linear = linear_problem(problem)
    gain = solve_continuous_are(linear.a, linear.b[:, None], linear.q, [[linear.r]])
    coarse, fine = (solve_trapezoidal(linear, n).costates[0] for n in (4000, 8000))
    np.testing.assert_allclose((4.0 * fine - coarse) / 3.0, gain @ linear.start, rtol=1e-6)


def test_a_cheap_input_makes_steep_ends_that_the_grid_follows():
    problem = problem_of(
        state_weights={"angle_rad": 1e3, "position_m": 1e3, "speed_m_s": 1e2},
        input_weight=0.01,
        start_m=0.2,
    )
    made = plan_finite_differences(problem)
    assert apart(made, plan_collocation(problem)) < 1e-6
    assert apart(made, plan_matrix_exponential(problem)) < 1e-6
    assert (
        np.abs(np.diff(graded_grid(boundary_value_problem(problem)))).min() < 1.5 / 400
    )  # twice as fine as equal intervals
    with pytest.raises(NotConverged, match="amplifies rounding"):
        plan_shooting(problem)


@settings(max_examples=6)
@given(
    distance=st.floats(0.05, 3.0),
    angle=st.floats(-0.2, 0.2),
    factor=st.floats(-4.0, 4.0).filter(lambda x: abs(x) > 0.1),
)
def test_moves_and_swings_superpose_and_scale(distance, angle, factor):
    swing = {"angle_rad": angle}
    both = plan_finite_differences(problem_of(distance_m=distance, start_state=swing))
    move = plan_finite_differences(problem_of(distance_m=factor * distance))
    stop = plan_finite_differences(problem_of(distance_m=0.0, start_state=swing))
    t = np.linspace(0.0, 1.5, 301)
    scale = move.peak(2).value + stop.peak(2).value
    np.testing.assert_allclose(
        both.at(t, 2),
        move.at(t, 2) / factor + stop.at(t, 2),
        atol=1e-7 * scale * (1 + 1 / abs(factor)),
    )


@pytest.mark.parametrize("planner", PLANNERS)
def test_an_undamped_move_is_its_own_reverse(planner):
    made, t = PLANNERS[planner](problem_of(time_s=1.1)), np.linspace(0.0, 1.1, 201)
    np.testing.assert_allclose(made.at(t) + made.at(1.1 - t), 0.2, atol=1e-8)


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_move_from_far_away_is_the_same_move(planner):
    near, far = (PLANNERS[planner](problem_of(start_m=start)) for start in (0.0, 900.0))
    assert apart(far, near) < 1e-9
    assert float(far.at(0.0)) == 900.0
    assert float(far.at(1.5)) == pytest.approx(900.2, abs=1e-11)


@pytest.mark.parametrize("planner", PLANNERS)
def test_no_move_stands_still(planner):
    made = PLANNERS[planner](problem_of(distance_m=0.0, start_m=0.3))
    assert made.extent() == (0.3, 0.3)


@pytest.mark.parametrize("planner", [plan_finite_differences, plan_collocation])
@pytest.mark.parametrize(("time_s", "energy"), [(1.1, None), (0.75, 607.0)])
def test_a_plan_for_the_nonlinear_pendulum_leaves_it_at_rest(planner, time_s, energy):
    made = planner(problem_of(time_s=time_s, nonlinear=True))
    assert np.abs(played(made, METRE)).max() < 1e-6
    if energy:
        assert made.rms(2) ** 2 * time_s == pytest.approx(energy, rel=2e-3)
        linear = plan_convolution(problem_of(time_s=time_s))
        assert linear.rms(2) ** 2 * time_s == pytest.approx(277.0, rel=3e-3)
        assert np.abs(played(linear, METRE)).max() > 0.03


def test_all_three_agree_on_the_nonlinear_pendulum_with_a_swing_damping_and_weights():
    load = PendulumModel(length_m=0.9, damping_ratio=0.02)
    problem = problem_of(
        load,
        time_s=1.3,
        nonlinear=True,
        start_state={"angle_rad": 0.3},
        goal_state={"angle_rad": -0.1},
        state_weights={"angle_rad": 5.0, "speed_m_s": 0.5},
    )
    made = [planner(problem) for planner in PLANNERS.values()]
    assert max(apart(made[0], made[1]), apart(made[2], made[1])) < 1e-6
    np.testing.assert_allclose(played(made[1], load, (0.3, 0.0)), [-0.1, 0.0], atol=1e-6)


def test_the_nonlinear_pendulum_through_a_filter_is_planned_twice_the_same():
    problem = problem_of(input="jerk", time_s=0.9, nonlinear=True)
    made = plan_finite_differences(problem)
    assert apart(plan_collocation(problem), made) < 1e-6
    assert np.abs(played(made, METRE)).max() < 1e-6
    assert abs(float(made.at(0.0, 2))) < 1e-9 * made.peak(2).value


def test_a_single_bar_is_the_pendulum_of_two_thirds_its_length():
    bar = ChainModel(links=(Link(0.9, 2.0),))
    a, b = (
        plan_finite_differences(problem_of(m, nonlinear=True))
        for m in (bar, PendulumModel(length_m=0.6))
    )
    assert apart(a, b) < 1e-7


def test_a_short_move_of_the_nonlinear_pendulum_is_the_linear_one():
    small = plan_collocation(problem_of(distance_m=1e-4, nonlinear=True))
    assert apart(small, plan_convolution(problem_of(distance_m=1e-4))) < 1e-6


@pytest.mark.parametrize("time_s", [0.75, 0.6])
def test_shooting_the_nonlinear_pendulum_below_half_a_period_is_refused(time_s):
    with pytest.raises(
        NotConverged,
        match=rf"misses the goal by .* in time_s = {time_s}; must be <= 1e-08: "
        "give the move more time.*try finite_diff",
    ):
        plan_shooting(problem_of(time_s=time_s, nonlinear=True))


def test_a_move_that_throws_the_load_round_is_refused():
    words = ("collocation: .*nodes; must be", "Newton's step", "misses the goal")
    for planner, word in zip(PLANNERS.values(), words, strict=True):
        with pytest.raises(
            NotConverged, match=f"{word}.*give the move more time, or less distance"
        ):
            planner(problem_of(time_s=0.3, nonlinear=True))


@pytest.mark.parametrize("name", ["finite_differences", "collocation"])
@pytest.mark.parametrize("nonlinear", [False, True])
def test_no_refusal_sends_the_reader_to_another_solver_of_its_kind(name, nonlinear):
    steep = {"state_weights": {"angle_rad": 1e12}, "input_weight": 1e-12}
    problem = problem_of(**({"time_s": 0.021, "nonlinear": True} if nonlinear else steep))
    with pytest.raises(NotConverged) as refused:
        PLANNERS[name](problem)
    advice = str(refused.value).rpartition(": ")[2]
    assert not any(other in advice for other in PLANNERS)
    assert ("more time" in advice) == nonlinear
    assert ("matrix_exponential" in advice) != nonlinear


def test_no_refusal_of_the_nonlinear_pendulum_names_a_solver_of_the_linear_one():
    for time_s in (0.0201, 0.3, 0.6):
        with pytest.raises(
            NotConverged,
            match=r"give the move more time, or less distance and swing, "
            r"or try finite_differences$",
        ):
            plan_shooting(problem_of(time_s=time_s, nonlinear=True))


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize(
    ("case", "words"),
    [
        ((BARS, "acceleration", ()), "2 links; must be 1 link"),
        ((METRE, "force", ()), "input = 'force'; must be one of acceleration, jerk"),
        ((METRE, "acceleration", ONE_LENGTH), "robust = .*must be"),
    ],
)
def test_nonlinear_problems_beyond_one_driven_link_are_refused(planner, case, words):
    with pytest.raises(PlanError, match=words):
        PLANNERS[planner](problem_of(*case, nonlinear=True))


@pytest.mark.parametrize("lag_s", [None, 0.05])
def test_the_nonlinear_pendulum_obeys_pontryagin(lag_s):
    """Check x' = dH/dp, p' = -dH/dx, dH/du = 0 and the Jacobian.

    By central differences at random points.
    """
    n, rng = 4 if lag_s is None else 5, np.random.default_rng(5)
    load = NonlinearPendulum(1.3, 9.0, 0.2, lag_s, rng.uniform(0.0, 2.0, n), 0.7)
    z = rng.uniform(-1.0, 1.0, (2 * n, 20))

    def hamiltonian(z, u):
        x, p, a = z[:n], z[n:], u if lag_s is None else z[4]
        fall = -9.0 * np.sin(x[2]) - 0.2 * x[3] - 1.3 * np.cos(x[2]) * a
        rates = [x[1], a, x[3], fall] + ([] if lag_s is None else [(u - a) / lag_s])
        return (load.q @ x**2 + 0.7 * u**2) / 2.0 + np.sum(p * np.array(rates), axis=0)

    u, h = load.input(z), 1e-5
    gradient, jacobian = np.zeros_like(z), np.zeros((2 * n, 2 * n, 20))
    for k in range(2 * n):
        e = np.eye(2 * n)[k][:, None] * h
        gradient[k] = (hamiltonian(z + e, u) - hamiltonian(z - e, u)) / (2 * h)
        jacobian[:, k] = (load.rhs(z + e) - load.rhs(z - e)) / (2 * h)
    np.testing.assert_allclose(load.rhs(z), np.vstack([gradient[n:], -gradient[:n]]), atol=1e-7)
    np.testing.assert_allclose(load.jacobian(z), jacobian, atol=1e-6)
    np.testing.assert_allclose(hamiltonian(z, u + h), hamiltonian(z, u - h), atol=1e-12)


def test_quintics_through_nodes_meet_all_three_derivatives():
    rng = np.random.default_rng(2)
    t = np.cumsum(np.append(0.0, rng.uniform(0.01, 0.2, 40)))
    values = rng.normal(size=(3, 41))
    path = through_nodes(t, *values)
    for order in range(3):
        np.testing.assert_allclose(path.at(t[:-1], order), values[order, :-1], atol=1e-12)
        np.testing.assert_allclose(path.at(t[1:] - 1e-12, order), values[order, 1:], atol=1e-4)
    exact_t = np.linspace(0.0, 2.0, 30)
    smooth = through_nodes(exact_t, exact_t**5, 5 * exact_t**4, 20 * exact_t**3)
    np.testing.assert_allclose(
        smooth.at(np.linspace(0, 2, 99), 2), 20 * np.linspace(0, 2, 99) ** 3, atol=1e-9
    )


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_a_trajectory_of_many_quintics_is_summed_up_as_each_by_itself(order):
    rng = np.random.default_rng(order)
    t = np.cumsum(np.append(0.0, rng.uniform(0.01, 0.2, 60)))
    path = through_nodes(t, *rng.normal(size=(3, 61)))
    cells = [resolve(piece, order) for piece in path.pieces]
    values = np.concatenate(
        [p.at(c.candidates_s(), order) for p, c in zip(path.pieces, cells, strict=True)]
    )
    assert path.extent(order) == pytest.approx((values.min(), values.max()), rel=1e-11)
    assert path.peak(order).value == pytest.approx(np.abs(values).max(), rel=1e-11)
    assert abs(float(path.at(path.peak(order).t_s, order))) == pytest.approx(
        path.peak(order).value, rel=1e-9
    )
    assert path.rms(order) ** 2 * path.duration_s == pytest.approx(
        sum(c.square_integral() for c in cells), rel=1e-11
    )
    times = rng.uniform(-0.5, path.duration_s + 0.5, 300)
    k = np.clip(np.searchsorted(path.breaks_s, times, side="right") - 1, 0, 59)
    inside = (times >= 0) & (times <= path.duration_s)
    one_by_one = [
        float(path.pieces[i].at(np.asarray(s - path.breaks_s[i]), order))
        for i, s in zip(k, times, strict=True)
    ]
    np.testing.assert_allclose(
        path.at(times, order)[inside], np.array(one_by_one)[inside], rtol=1e-12
    )


def test_the_grid_is_fine_where_the_filter_is_steep_only():
    t = graded_grid(boundary_value_problem(problem_of(input="jerk", time_s=2.0)))
    h, lag = np.diff(t), 1.0 / (20.0 * math.pi)
    assert t[0] == 0.0
    assert t[-1] == 2.0
    assert h[0] <= 0.101 * lag
    assert h.max() <= 0.0101
    assert len(h) < 260
    np.testing.assert_allclose(h, h[::-1], rtol=1e-9)
    assert len(graded_grid(boundary_value_problem(problem_of()))) == 201


def test_a_move_too_long_for_nodes_is_refused():
    with pytest.raises(
        PlanError, match=r"more than 20000 intervals.*take convolution or matrix_exponential"
    ):
        plan_finite_differences(problem_of(PendulumModel(length_m=0.1), time_s=400.0))


WILD = [  # within every bound of a problem, beyond what a laboratory asks
    {"start_state": {"angle_rad": 1e3}, "nonlinear": True},
    {"goal_state": {"angular_velocity_rad_s": -1e3}, "time_s": 0.021},
    {"state_weights": {"angle_rad": 1e12}, "input_weight": 1e-12},
    {"state_weights": {"angle_rad": 1e12}, "nonlinear": True},
    {"distance_m": 0.0, "start_state": {"angle_rad": 5e-324}},
    {"distance_m": 1e-310, "goal_state": {"speed_m_s": 1e-320}, "nonlinear": True},
    {"state_weights": {"angular_velocity_rad_s": 1e12}, "input_weight": 1e-12},
    {"input": "jerk", "lag_s": 1e3},
    {"input": "jerk", "lag_s": 1.5e-5, "nonlinear": True},
    {
        "model": PendulumModel(length_m=1e-3, mass_kg=1.0, cart_mass_kg=0.01),
        "input": "force",
        "time_s": 0.05,
    },
    {"model": PendulumModel(length_m=1e4), "robust": ONE_LENGTH, "time_s": 5.0},
    {"model": ChainModel(links=(Link(1e3, 1e-6), Link(10.0, 1e9))), "time_s": 3.0},
]


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("wild", WILD, ids=lambda wild: "-".join(wild))
def test_a_wild_problem_is_planned_or_refused_by_name(planner, wild):
    problem = problem_of(**wild)
    made = answer(planner, problem)
    if isinstance(made, PlanError):
        assert re.search(r"must (be|fall) .*: (take|give|weigh) ", str(made))
    else:
        assert float(made.at(made.duration_s)) == pytest.approx(problem.distance_m, abs=1e-6)


def answer(planner, problem):
    """Plan a trajectory, or return the error."""
    try:
        return PLANNERS[planner](problem)
    except PlanError as refusal:
        return refusal


def test_a_mode_faster_than_rounding_can_follow_is_refused():
    steep = problem_of(state_weights={"angular_velocity_rad_s": 1e12}, input_weight=1e-12)
    with pytest.raises(
        PlanError,
        match=r"time constants of the fastest motion.*must be <= 1e\+08.*take matrix_exponential",
    ):
        graded_grid(boundary_value_problem(steep))


def test_a_budget_permits_its_work_and_not_more():
    work = WorkBudget("a planner", 10.0, "take another")
    work.spend(4.0)
    work.spend(6.0)
    with pytest.raises(
        NotConverged, match=r"a planner requires 10.5 units of work.*must be <= 10: take another"
    ):
        work.spend(0.5)


@pytest.mark.parametrize(
    ("planner", "unsolvable", "hint"),
    [
        (
            "shooting",
            {"distance_m": 100.0, "time_s": 5.0, "nonlinear": True},
            "more time.*or try finite_differences",
        ),
        ("shooting", {"time_s": 500.0}, "take convolution"),
        ("finite_differences", {"model": TWENTY, "time_s": 3.0}, "take convolution"),
        ("collocation", {"model": TWENTY, "time_s": 3.0}, "take convolution"),
    ],
)
def test_a_problem_that_does_not_converge_is_refused_after_bounded_work(planner, unsolvable, hint):
    with pytest.raises(NotConverged, match=f"{planner} requires .* units of work.*{hint}"):
        PLANNERS[planner](problem_of(**unsolvable))


@pytest.mark.parametrize("nonlinear", [False, True])
def test_a_solution_for_another_load_is_refused(nonlinear):
    """The same nodes are accepted for the load they were computed for."""
    problem, other = (
        problem_of(nonlinear=nonlinear),
        problem_of(PendulumModel(length_m=1.001), nonlinear=nonlinear),
    )
    t_s, z = solved(problem)
    assert (
        checked_trajectory(problem, boundary_value_problem(problem), t_s, z, "a planner").duration_s
        == 1.5
    )
    with pytest.raises(
        NotConverged,
        match=r"a planner: terminal error .* rad in time_s = 1\.5; must be <= .*e-0",
    ):
        checked_trajectory(other, boundary_value_problem(other), t_s, z, "a planner")


def test_a_solution_that_is_not_a_number_is_refused():
    problem = problem_of(BARS)
    t_s, z = solved(problem)
    with pytest.raises(NotConverged, match="terminal error nan rad"):
        checked_trajectory(
            problem, boundary_value_problem(problem), t_s, np.full_like(z, np.nan), "a planner"
        )


@pytest.mark.parametrize("seed", [0, 2])
def test_random_chains_of_three_links_agree_with_the_matrix_exponential(seed):
    rng = np.random.default_rng(seed)
    links = tuple(
        Link(length, mass)
        for length, mass in zip(rng.uniform(0.15, 1.0, 3), rng.uniform(0.2, 5.0, 3), strict=True)
    )
    joints = {
        "stiffness_n_m_rad": tuple(rng.uniform(0, 20, 2)),
        "joint_damping_n_m_s_rad": tuple(rng.uniform(0, 0.1, 2)),
    }
    input = ("acceleration", "force", "jerk")[seed % 3]
    problem = problem_of(ChainModel(links=links, **joints), input, (), rng.uniform(1.2, 3.0))
    truth = plan_matrix_exponential(problem)
    assert apart(plan_finite_differences(problem), truth) < 1e-6
    assert apart(plan_collocation(problem), truth) < 1e-6


def test_nodes_name_their_columns():
    assert Nodes._fields == ("t_s", "states", "costates", "input")


def test_importing_the_planners_leaves_scipy_alone():
    names = ", ".join(f"planners.boundary_value.{name}" for name in PLANNERS)
    code = f"import sys, {names}; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def solved(problem):
    """Compute instants and an accepted z (2n, N+1) by finite differences."""
    caught = {}

    def keep(problem, bvp, t_s, z, planner):
        caught.update(t_s=t_s, z=z)
        return checked_trajectory(problem, bvp, t_s, z, planner)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("planners.boundary_value.finite_differences.checked_trajectory", keep)
        plan_finite_differences(problem)
    return caught["t_s"], caught["z"]


def played(trajectory, model, start=(0.0, 0.0)):
    """Compute angle and rate at the end on the nonlinear pendulum.

    By scipy's DOP853 on theta'' = ..., in one sweep over the quintics.
    """
    w2, damping = 9.81 / model.length_m, 2 * model.damping_ratio * math.sqrt(9.81 / model.length_m)

    def rates(t, x):
        push = float(trajectory.at(t, 2)) / model.length_m
        return [x[1], -w2 * math.sin(x[0]) - damping * x[1] - push * math.cos(x[0])]

    inside = trajectory.duration_s * (1.0 - 1e-12)  # at the end itself a trajectory stands
    return solve_ivp(
        rates, (0.0, inside), start, "DOP853", rtol=1e-9, atol=1e-11, max_step=inside / 50
    ).y[:, -1]
