"""Minimum-energy move by collocation: scipy's solve_bvp, in sizes and in shares of the move's time."""

from __future__ import annotations

import numpy as np

from planners.boundary_value.conditions import conditions
from planners.boundary_value.nodes import checked_trajectory, graded_grid
from planners.errors import NotConverged
from planners.problem import Problem
from planners.trajectory import Trajectory

TOLERANCE = 3e-6  # of solve_bvp: residual of the slope, relative to 1 + the slope, in sizes a move
END_ERROR = 1e-11  # of the states at both ends, in sizes
MOST_TIMES = 20  # the nodes of the first mesh; three links, robust, with a lag take 8 times


def plan_collocation(problem: Problem) -> Trajectory:
    """min 1/2 int (x'Qx + r u^2) dt by Lobatto collocation of order 4 on a mesh that fits itself (scipy's solve_bvp).

    State and costate are divided by what the move asks of each, time by time_s; Jacobians are analytic; the guess is zero.
    Raises NotConverged with solve_bvp's message when it fails, PlanError for a nonlinear problem these conditions do not cover.
    """
    from scipy.integrate import solve_bvp

    asked = conditions(problem)
    n, size, time_s = len(asked.start), asked.sizes[:, None], asked.time_s
    start, goal = asked.start / asked.sizes[:n], asked.goal / asked.sizes[:n]
    ratio = (size.T / size)[:, :, None] * time_s
    identity, nothing = np.eye(n, 2 * n), np.zeros((n, 2 * n))
    by_start, by_goal = np.vstack([identity, nothing]), np.vstack([nothing, identity])
    t_s = graded_grid(asked)
    found = solve_bvp(
        lambda s, z: asked.slope(z * size) / size * time_s,
        lambda a, b: np.concatenate([a[:n] - start, b[:n] - goal]),
        t_s / time_s,
        np.zeros((2 * n, len(t_s))),
        fun_jac=lambda s, z: asked.jacobian(z * size) * ratio,
        bc_jac=lambda a, b: (by_start, by_goal),
        tol=TOLERANCE,
        bc_tol=END_ERROR,
        max_nodes=MOST_TIMES * len(t_s),
    )
    if found.status != 0:
        raise NotConverged(
            f"collocation: {found.message} Residual {float(found.rms_residuals.max()):.3g} on {found.x.size} nodes; must be <= "
            f"{TOLERANCE:g} on {MOST_TIMES * len(t_s)}: give the move more than time_s = {time_s}, or take finite_differences"
        )
    return checked_trajectory(problem, asked, t_s, found.sol(t_s / time_s) * size, "collocation")
