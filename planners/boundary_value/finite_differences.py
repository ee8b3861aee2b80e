"""Minimum-energy move by finite differences: trapezoidal rule on state and costate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planners.boundary_value.conditions import (
    BoundaryValueProblem,
    boundary_value_problem,
    linear_boundary_value_problem,
)
from planners.boundary_value.linear import LinearProblem, linear_problem
from planners.boundary_value.nodes import Nodes, WorkBudget, checked_trajectory, graded_grid
from planners.errors import NotConverged
from planners.problem import Problem
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

# Change of the acceleration by one more level of extrapolation, relative to its peak; the error of
# the last level is smaller.
AGREEMENT_REL = 3e-7
MAX_LEVELS = 6  # parts an interval may be cut into
MAX_NEWTON_STEPS = 30
NEWTON_STEP_REL = 1e-9  # last step, relative to the largest nondimensional unknown; quadratic
MIN_STEP_SHARE = 1e-4  # share of a Newton step
MAX_WORK = 3e6  # nodes x states^2 over all Newton steps: 0.4 us each


def solve_trapezoidal(linear: LinearProblem, intervals: int = 200) -> Nodes:
    """Solve a linear problem by the trapezoidal (box, Crank-Nicolson) scheme: N+1 nodes.

    On [x; costate] over equal intervals, by one banded LU. Second order: the input's error falls
    with intervals^-2. This is the scheme behind the tables of source 004 (N = 200).
    """
    t_s = np.linspace(0.0, linear.time_s, intervals + 1)
    bvp, n = linear_boundary_value_problem(linear), len(linear.start)
    z = _solve(bvp, t_s, None, WorkBudget("the trapezoidal rule", MAX_WORK, bvp.hint))
    u = bvp.input(z)
    z[0] += bvp.origin_m
    return Nodes(t_s, z[:n].T, z[n:].T, u)


def plan_finite_differences(problem: Problem) -> Trajectory:
    """Minimise 1/2 int (x'Qx + r u^2) dt by the trapezoidal rule and Richardson extrapolation.

    At the nodes of any grid the error is a series in 1/m^2 when every interval is cut into m equal
    parts; m = 1 and 2 leave O(h^4), each further m two orders more, and m grows until the
    acceleration changes by less than 3e-7 of its peak (m = 2 or 3 as a rule). The intervals are
    equal, finer at the ends only where a filter or a weight makes the solution steep: 200 equal
    ones would leave an error of 1e-4 with the jerk model's 16 ms lag. The nonlinear pendulum is
    solved by a damped Newton iteration from the linear solution.

    Raises NotConverged when levels, iterations or work are exceeded, PlanError for a nonlinear
    problem that is not supported.
    """
    bvp = boundary_value_problem(problem)
    t_s = graded_grid(bvp)
    work = WorkBudget("finite_differences", MAX_WORK, bvp.hint)
    guess: FloatArray | None = None
    if not bvp.linear:
        linear = replace(linear_boundary_value_problem(linear_problem(problem)), hint=bvp.hint)
        guess = _solve(linear, t_s, None, work)
    table: list[FloatArray] = []  # last row of Neville's table: order 2, 4, ... of the finest level
    change = np.inf
    for m in range(1, MAX_LEVELS + 1):
        fine_s = _cut(t_s, m)
        fine_guess = None if guess is None else _interpolate(guess, t_s, fine_s)
        row = [_solve(bvp, fine_s, fine_guess, work)[:, ::m]]
        if not bvp.linear:
            guess = row[0]
        for j, coarser in enumerate(table):
            row.append(row[j] + (row[j] - coarser) / ((m / (m - 1 - j)) ** 2 - 1.0))
        if table:
            best, previous = bvp.acceleration(row[-1]), bvp.acceleration(table[-1])
            change = float(np.abs(best - previous).max()) / (float(np.abs(best).max()) or 1.0)
            if change <= AGREEMENT_REL:
                return checked_trajectory(problem, bvp, t_s, row[-1], "finite_differences")
        table = row
    raise NotConverged(
        f"finite_differences still changes the input by {change:.3g} of its peak at "
        f"{MAX_LEVELS * (len(t_s) - 1)} intervals; must be <= {AGREEMENT_REL:g}: {bvp.hint}"
    )


def _cut(t_s: FloatArray, parts: int) -> FloatArray:
    """Cut every interval into equal parts."""
    inner = t_s[:-1, None] + np.diff(t_s)[:, None] * (np.arange(parts) / parts)
    return np.append(inner.ravel(), t_s[-1])


def _interpolate(z: FloatArray, t_s: FloatArray, fine_s: FloatArray) -> FloatArray:
    """Interpolate the columns at t_s linearly at fine_s."""
    return np.array([np.interp(fine_s, t_s, row) for row in z])


def _solve(
    bvp: BoundaryValueProblem, t_s: FloatArray, guess: FloatArray | None, work: WorkBudget
) -> FloatArray:
    """Solve the trapezoidal rule by Newton's method: state and costate (2n, N+1).

    A linear problem takes one step.
    """
    scales = bvp.scales[:, None]
    z = np.zeros((len(scales), len(t_s))) if guess is None else guess / scales
    residual = _residual(bvp, t_s, z)
    share, step = 1.0, np.inf
    for _ in range(MAX_NEWTON_STEPS):
        work.spend(float(z.shape[1] * len(bvp.start) ** 2))
        try:
            correction = _newton_step(bvp, t_s, z, residual)
        except np.linalg.LinAlgError as singular:
            raise _not_converged(bvp, np.inf) from singular
        step = float(np.abs(correction).max() / max(1.0, np.abs(z).max()))
        converged = bvp.linear or step <= NEWTON_STEP_REL
        norm = float(np.linalg.norm(residual))
        share = min(1.0, 4.0 * share)
        while True:
            moved = z + share * correction
            residual = _residual(bvp, t_s, moved)
            if converged or np.linalg.norm(residual) <= (1.0 - share / 4.0) * norm:
                break
            share /= 2.0
            if share < MIN_STEP_SHARE:
                raise _not_converged(bvp, step)
        z = moved
        if converged:
            return z * scales
    raise _not_converged(bvp, step)


def _not_converged(bvp: BoundaryValueProblem, step: float) -> NotConverged:
    return NotConverged(
        f"finite_differences: Newton's step is still {step:.3g} of the solution in "
        f"time_s = {bvp.time_s}; must fall to {NEWTON_STEP_REL:g}: {bvp.hint}"
    )


def _residual(bvp: BoundaryValueProblem, t_s: FloatArray, z: FloatArray) -> FloatArray:
    """Compute the nondimensional residuals of start (n), intervals (2n each) and goal (n)."""
    scales, n = bvp.scales[:, None], len(bvp.start)
    slope = bvp.rhs(z * scales) / scales
    inner = np.diff(z) - np.diff(t_s) / 2.0 * (slope[:, :-1] + slope[:, 1:])
    state_scales = bvp.scales[:n]
    at_start = z[:n, 0] - bvp.start / state_scales
    at_goal = z[:n, -1] - bvp.goal / state_scales
    return np.concatenate([at_start, inner.T.ravel(), at_goal])


def _newton_step(
    bvp: BoundaryValueProblem, t_s: FloatArray, z: FloatArray, residual: FloatArray
) -> FloatArray:
    """Solve the linearised equations for Newton's step: (2n, N+1).

    Unknowns are ordered node by node, so that the matrix is a band of 3n - 1 on either side.
    """
    from scipy.linalg import solve_banded

    scales = bvp.scales
    rows, columns = z.shape
    n = rows // 2
    half = np.diff(t_s)[:, None, None] / 2.0
    jacobians = np.moveaxis(bvp.jacobian(z * scales[:, None]), 2, 0)
    jacobians = jacobians * (scales / scales[:, None])  # (N+1, 2n, 2n)
    left, right = -np.eye(rows) - half * jacobians[:-1], np.eye(rows) - half * jacobians[1:]
    blocks = np.concatenate([left, right], axis=2)  # (N, 2n, 4n)
    width = 3 * n - 1
    band = np.zeros((2 * width + 1, rows * columns))
    i, j = np.arange(rows)[:, None], np.arange(2 * rows)
    k = np.arange(columns - 1)[:, None, None]
    band[width + n + i - j, rows * k + j] = blocks
    ends = np.arange(n)
    band[width, ends] = 1.0
    band[width + n, rows * (columns - 1) + ends] = 1.0
    solution = solve_banded((width, width), band, residual, overwrite_ab=True, check_finite=False)
    return -solution.reshape(columns, rows).T
