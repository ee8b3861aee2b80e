"""Minimum-energy move by finite differences: the trapezoidal rule on state and costate, all instants at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planners.boundary_value.conditions import Conditions, conditions, linear_conditions
from planners.boundary_value.linear import LinearProblem, linear_problem
from planners.boundary_value.nodes import Budget, Nodes, checked_trajectory, graded_grid
from planners.errors import NotConverged
from planners.problem import Problem
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

AGREED = 3e-7  # of the peak acceleration: what one more level of extrapolation may still change; what is left is less
LEVELS = 6  # parts an interval may be cut into
ROUNDS = 30  # of Newton
NEWTON_STEP_REL = (
    1e-9  # last step of Newton, of the largest unknown in sizes; it converges quadratically
)
SHORTEST_STEP = 1e-4  # share of a Newton step
MOST_WORK = 3e6  # nodes x states^2 over all steps of Newton: 0.4 us each


def solve_trapezoidal(linear: LinearProblem, intervals: int = 200) -> Nodes:
    """The trapezoidal (box, Crank-Nicolson) scheme on [x; costate] over equal intervals, by one banded LU: N+1 nodes.

    Second order: the input's error falls with intervals^-2. This is the scheme behind source 004's tables (N = 200).
    """
    t_s = np.linspace(0.0, linear.time_s, intervals + 1)
    asked, n = linear_conditions(linear), len(linear.start)
    z = _newton(asked, t_s, None, Budget("the trapezoidal rule", MOST_WORK, asked.way_out))
    push = asked.input(z)
    z[0] += asked.origin_m
    return Nodes(t_s, z[:n].T, z[n:].T, push)


def plan_finite_differences(problem: Problem) -> Trajectory:
    """min 1/2 int (x'Qx + r u^2) dt by the trapezoidal rule and Richardson's extrapolation.

    At the nodes of any grid the error is a series in 1/m^2 when every interval is cut into m equal parts; m = 1 and 2 leave
    O(h^4), each further m two orders more, and m grows until the acceleration stands still within 3e-7 of its peak (2 or 3
    as a rule). The grid is equal intervals, finer at the ends only where a filter or a weight makes the solution steep: 200
    equal ones would leave a quintic 1e-4 beside the jerk model's 16 ms lag. The true pendulum goes by a damped Newton
    iteration from the linear solution. Raises NotConverged when levels, iterations or work run out, PlanError for a nonlinear
    problem these conditions do not cover.
    """
    asked = conditions(problem)
    t_s = graded_grid(asked)
    work = Budget("finite_differences", MOST_WORK, asked.way_out)
    linear = replace(linear_conditions(linear_problem(problem)), way_out=asked.way_out)
    guess = None if asked.linear else _newton(linear, t_s, None, work)
    table: list[FloatArray] = []  # last row of Neville's table: order 2, 4, ... of the finest level
    change = np.inf
    for m in range(1, LEVELS + 1):
        fine = _cut(t_s, m)
        z = _newton(asked, fine, None if guess is None else _spread(guess, t_s, fine), work)
        row = [z[:, ::m]]
        guess = guess if asked.linear else row[0]
        for j, coarser in enumerate(table):
            row.append(row[j] + (row[j] - coarser) / ((m / (m - 1 - j)) ** 2 - 1.0))
        table, before = row, table
        if before:
            best, last = asked.acceleration(row[-1]), asked.acceleration(before[-1])
            change = float(np.abs(best - last).max()) / (float(np.abs(best).max()) or 1.0)
            if change <= AGREED:
                return checked_trajectory(problem, asked, t_s, row[-1], "finite_differences")
    raise NotConverged(
        f"finite_differences still changes the input by {change:.3g} of its peak at {LEVELS * (len(t_s) - 1)} intervals; "
        f"must be <= {AGREED:g}: {asked.way_out}"
    )


def _cut(t_s: FloatArray, parts: int) -> FloatArray:
    """Every interval in equal parts."""
    inner = t_s[:-1, None] + np.diff(t_s)[:, None] * (np.arange(parts) / parts)
    return np.append(inner.ravel(), t_s[-1])


def _spread(z: FloatArray, t_s: FloatArray, fine_s: FloatArray) -> FloatArray:
    """Columns at t_s, linear between, at fine_s."""
    return np.array([np.interp(fine_s, t_s, row) for row in z])


def _newton(
    asked: Conditions, t_s: FloatArray, guess: FloatArray | None, work: Budget
) -> FloatArray:
    """State and costate (2n, N+1) at which every interval's trapezoidal residual is zero; one step where all is linear."""
    size = asked.sizes[:, None]
    z = np.zeros((len(size), len(t_s))) if guess is None else guess / size
    residual = _residual(asked, t_s, z)
    share, step = 1.0, np.inf
    for _ in range(ROUNDS):
        work.spend(float(z.shape[1] * len(asked.start) ** 2))
        try:
            correction = _correction(asked, t_s, z, residual)
        except np.linalg.LinAlgError as singular:
            raise _stuck(asked, np.inf) from singular
        step = float(np.abs(correction).max() / max(1.0, np.abs(z).max()))
        norm, share = float(np.linalg.norm(residual)), min(1.0, 4.0 * share)
        while True:
            moved = z + share * correction
            residual = _residual(asked, t_s, moved)
            if (
                asked.linear
                or step <= NEWTON_STEP_REL
                or np.linalg.norm(residual) <= (1.0 - share / 4.0) * norm
            ):
                break
            share /= 2.0
            if share < SHORTEST_STEP:
                raise _stuck(asked, step)
        z = moved
        if asked.linear or step <= NEWTON_STEP_REL:
            return z * size
    raise _stuck(asked, step)


def _stuck(asked: Conditions, step: float) -> NotConverged:
    return NotConverged(
        f"finite_differences: Newton's step is still {step:.3g} of the solution in time_s = {asked.time_s}; must fall to "
        f"{NEWTON_STEP_REL:g}: {asked.way_out}"
    )


def _residual(asked: Conditions, t_s: FloatArray, z: FloatArray) -> FloatArray:
    """Of the start (n), of every interval (2n each) and of the goal (n), in sizes."""
    size, n = asked.sizes[:, None], len(asked.start)
    slope = asked.slope(z * size) / size
    inner = np.diff(z) - np.diff(t_s) / 2.0 * (slope[:, :-1] + slope[:, 1:])
    state = asked.sizes[:n]
    return np.concatenate(
        [z[:n, 0] - asked.start / state, inner.T.ravel(), z[:n, -1] - asked.goal / state]
    )


def _correction(
    asked: Conditions, t_s: FloatArray, z: FloatArray, residual: FloatArray
) -> FloatArray:
    """Newton's step: unknowns node by node, so that the matrix is a band of 3n - 1 on either side."""
    from scipy.linalg import solve_banded

    size, (rows, columns) = asked.sizes, z.shape
    n, half = rows // 2, np.diff(t_s)[:, None, None] / 2.0
    slopes = np.moveaxis(asked.jacobian(z * size[:, None]), 2, 0) * (
        size / size[:, None]
    )  # (N+1, 2n, 2n)
    blocks = np.concatenate(
        [-np.eye(rows) - half * slopes[:-1], np.eye(rows) - half * slopes[1:]], axis=2
    )  # (N, 2n, 4n)
    width = 3 * n - 1
    band = np.zeros((2 * width + 1, rows * columns))
    i, j, k = np.arange(rows)[:, None], np.arange(2 * rows), np.arange(columns - 1)[:, None, None]
    band[width + n + i - j, rows * k + j] = blocks
    ends = np.arange(n)
    band[width, ends] = 1.0
    band[width + n, rows * (columns - 1) + ends] = 1.0
    return (
        -solve_banded((width, width), band, residual, overwrite_ab=True, check_finite=False)
        .reshape(columns, rows)
        .T
    )
