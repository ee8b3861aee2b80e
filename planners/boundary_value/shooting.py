"""Minimum-energy move by single shooting.

Guess the costate at the start, integrate, correct it by the error at the end.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from planners.boundary_value.conditions import (
    BoundaryValueProblem,
    boundary_value_problem,
    linear_boundary_value_problem,
)
from planners.boundary_value.linear import linear_problem
from planners.boundary_value.nodes import WorkBudget, checked_trajectory, graded_grid
from planners.errors import NotConverged
from planners.problem import Problem
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

RTOL, ATOL = 1e-11, 1e-13  # of the integration, nondimensional
END_TOLERANCE = 1e-10  # of the nondimensional end state: Newton's method stops
MAX_END_ERROR = 1e-8  # of the nondimensional end state: error left by the integration
MAX_AMPLIFICATION = 1e8  # of rounding, 2e-16 of a scale, that still leaves a good end
MAX_NEWTON_STEPS = 10
DIVERGED_SCALES = 100.0  # a shot of the nonlinear pendulum that reaches them has diverged
MIN_STEP_SHARE = 0.2  # share of a Newton step; progress with shorter ones is too slow
MAX_WORK = 6e4  # evaluations of z' over all shots, 14 us each; the tables of source 004 take 5e3
NONLINEAR_COST = 4.0  # cost of an evaluation for the nonlinear pendulum, in linear ones
CUBIC_COST_STATES = 25  # states from which the cost of an evaluation grows with their cube


def plan_shooting(problem: Problem) -> Trajectory:
    """Minimise 1/2 int (x'Qx + r u^2) dt by Newton's method on the initial costate.

    Source 004, section 2.1. State, costate and their derivatives by the initial costate are
    integrated by DOP853; for a linear problem the first correction is exact. Rounding grows as
    exp(|Re mu| T), so single shooting fails if a filter or a damper is much faster than the move.

    Raises NotConverged where that growth exceeds 1e8 (jerk model beyond T/lag = 18), where Newton's
    method does not reach the goal (nonlinear pendulum in less than half its period), or where the
    work is exceeded (a move of 80 periods). Raises PlanError for a nonlinear problem that is not
    supported.
    """
    bvp = boundary_value_problem(problem)
    if not bvp.linear:
        bvp = replace(bvp, hint=f"{bvp.hint}, or try finite_differences")
    _check_growth(bvp)
    t_s, n = graded_grid(bvp), len(bvp.start)
    costate = np.zeros(n)
    work = WorkBudget("shooting", MAX_WORK, bvp.hint)
    if not bvp.linear:
        linear = replace(linear_boundary_value_problem(linear_problem(problem)), hint=bvp.hint)
        costate = _solve_initial_costate(linear, costate, work)
    costate = _solve_initial_costate(bvp, costate, work)
    begin = np.concatenate([bvp.start, costate])
    z = _integrate(bvp, begin / bvp.scales, t_s, work) * bvp.scales[:, None]
    z[:n, -1] = bvp.goal  # differs by MAX_END_ERROR at most
    return checked_trajectory(problem, bvp, t_s, z, "shooting")


def _check_growth(bvp: BoundaryValueProblem) -> None:
    exponent = float(np.abs(bvp.eigenvalues_1_s.real).max()) * bvp.time_s
    if exponent > math.log(MAX_AMPLIFICATION):
        raise NotConverged(
            f"shooting amplifies rounding exp({exponent:.4g}) times in time_s = {bvp.time_s}; must "
            f"be <= {MAX_AMPLIFICATION:g}, or no initial costate reaches the goal: {bvp.hint}"
        )


def _solve_initial_costate(
    bvp: BoundaryValueProblem, costate: FloatArray, work: WorkBudget
) -> FloatArray:
    """Solve for the initial costate (n,) that ends in the goal: Newton's method, step halving."""
    n, scales = len(bvp.start), bvp.scales
    begin = np.concatenate([bvp.start, costate]) / scales
    error, jacobian = _shoot(bvp, begin, work)
    for _ in range(MAX_NEWTON_STEPS):
        if np.abs(error).max() <= END_TOLERANCE or not np.isfinite(error).all():
            break
        try:
            step = np.concatenate([np.zeros(n), np.linalg.solve(jacobian, -error)])
        except np.linalg.LinAlgError:
            break
        share = 1.0
        new_error, jacobian = _shoot(bvp, begin + step, work)
        while (
            not np.linalg.norm(new_error) <= (1.0 - share / 4.0) * np.linalg.norm(error)
            and share > MIN_STEP_SHARE
        ):
            share /= 2.0
            new_error, jacobian = _shoot(bvp, begin + share * step, work)
        if share <= MIN_STEP_SHARE:
            break
        begin = begin + share * step
        error = new_error
    if np.abs(error).max() <= MAX_END_ERROR:
        return begin[n:] * scales[n:]
    raise NotConverged(
        f"shooting misses the goal by {np.abs(error).max():.3g} of its scale in "
        f"time_s = {bvp.time_s}; must be <= {MAX_END_ERROR:g}: {bvp.hint}"
    )


def _shoot(
    bvp: BoundaryValueProblem, begin: FloatArray, work: WorkBudget
) -> tuple[FloatArray, FloatArray]:
    """Integrate from begin (2n,) to the end, nondimensional.

    Returns the error against the goal (n,) and its derivative by the initial costate (n, n).
    """
    from scipy.integrate import solve_ivp

    n, scales = len(bvp.start), bvp.scales
    ratio = scales / scales[:, None]
    cost = 1.0 + (n / CUBIC_COST_STATES) ** 3 if bvp.linear else NONLINEAR_COST

    def rhs(_: float, flat: FloatArray) -> FloatArray:
        work.spend(cost)
        columns = flat.reshape(2 * n, n + 1)  # z and its derivatives by the costate
        z = columns[:, :1] * scales[:, None]
        derivatives = (bvp.jacobian(z)[:, :, 0] * ratio) @ columns[:, 1:]
        return np.hstack([bvp.rhs(z) / scales[:, None], derivatives]).ravel()

    def distance_to_divergence(_: float, flat: FloatArray) -> float:
        return DIVERGED_SCALES - float(np.abs(flat[: n * (n + 1) : n + 1]).max())

    distance_to_divergence.terminal = True  # type: ignore[attr-defined]
    first = np.column_stack([begin, np.eye(2 * n)[:, n:]]).ravel()
    done = solve_ivp(
        rhs,
        (0.0, bvp.time_s),
        first,
        "DOP853",
        rtol=RTOL,
        atol=ATOL,
        events=None if bvp.linear else distance_to_divergence,
    )
    if done.status != 0:
        return np.full(n, np.inf), np.eye(n)
    last = done.y[:, -1].reshape(2 * n, n + 1)[:n]
    return last[:, 0] - bvp.goal / scales[:n], last[:, 1:]


def _integrate(
    bvp: BoundaryValueProblem, begin: FloatArray, t_s: FloatArray, work: WorkBudget
) -> FloatArray:
    """Integrate state and costate at the instants t_s: (2n, N+1), nondimensional."""
    from scipy.integrate import solve_ivp

    scales = bvp.scales

    def rhs(_: float, z: FloatArray) -> FloatArray:
        work.spend(1.0 if bvp.linear else NONLINEAR_COST)
        return bvp.rhs((z * scales)[:, None])[:, 0] / scales

    span = (0.0, bvp.time_s)
    return np.asarray(solve_ivp(rhs, span, begin, "DOP853", t_eval=t_s, rtol=RTOL, atol=ATOL).y)
