"""Minimum-energy move by collocation: scipy's solve_bvp, in sizes and in shares of the move's time."""

from __future__ import annotations

import numpy as np

from planners.boundary_value.conditions import conditions
from planners.boundary_value.nodes import Budget, checked_trajectory, graded_grid
from planners.errors import NotConverged
from planners.problem import Problem
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

TOLERANCE = 1e-6  # of solve_bvp: residual of the slope, relative to 1 + the slope, in sizes a move
END_ERROR = 1e-11  # of the states at both ends, in sizes
MOST_TIMES = 20  # the nodes of the first mesh; three links, robust, with a lag take 8 times
MOST_MESH = 1e6  # nodes x states^2 of one mesh: 300 MB
MOST_WORK = 5e6  # the same over all Jacobians: 0.5 to 1 us each


def plan_collocation(problem: Problem) -> Trajectory:
    """min 1/2 int (x'Qx + r u^2) dt by Lobatto collocation of order 4 on a mesh that fits itself (scipy's solve_bvp).

    State and costate are divided by what the move asks of each, time by time_s; Jacobians are analytic; the guess is zero.
    Raises NotConverged with solve_bvp's message when it fails or its work runs out, PlanError for a nonlinear problem these
    conditions do not cover.
    """
    from scipy.integrate import solve_bvp

    asked = conditions(problem)
    n, size, time_s = len(asked.start), asked.sizes[:, None], asked.time_s
    start, goal = asked.start / asked.sizes[:n], asked.goal / asked.sizes[:n]
    ratio = (size.T / size)[:, :, None] * time_s
    identity, nothing = np.eye(n, 2 * n), np.zeros((n, 2 * n))
    by_start, by_goal = np.vstack([identity, nothing]), np.vstack([nothing, identity])
    t_s = graded_grid(asked)
    most_nodes = int(min(MOST_TIMES * len(t_s), MOST_MESH / n**2))
    work = Budget("collocation", MOST_WORK, asked.way_out)
    work.spend(float(len(t_s) * n * n))

    def jacobian(s: FloatArray, z: FloatArray) -> FloatArray:
        work.spend(float(z.shape[1] * n * n))
        return np.asarray(asked.jacobian(z * size) * ratio)

    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # a trial step of Newton may go anywhere; it is then not taken
        found = solve_bvp(
            lambda s, z: asked.slope(z * size) / size * time_s,
            lambda a, b: np.concatenate([a[:n] - start, b[:n] - goal]),
            t_s / time_s,
            np.zeros((2 * n, len(t_s))),
            fun_jac=jacobian,
            bc_jac=lambda a, b: (by_start, by_goal),
            tol=TOLERANCE,
            bc_tol=END_ERROR,
            max_nodes=most_nodes,
        )
    if found.status != 0:
        raise NotConverged(
            f"collocation: {found.message} Residual {float(found.rms_residuals.max()):.3g} on {found.x.size} nodes; must be <= "
            f"{TOLERANCE:g} on {most_nodes} in time_s = {time_s}: {asked.way_out}"
        )
    return checked_trajectory(problem, asked, t_s, found.sol(t_s / time_s) * size, "collocation")
