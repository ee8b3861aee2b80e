"""Minimum-energy move by collocation: scipy's solve_bvp on nondimensional states and time."""

from __future__ import annotations

import numpy as np

from planners.boundary_value.conditions import boundary_value_problem
from planners.boundary_value.nodes import WorkBudget, checked_trajectory, graded_grid
from planners.errors import NotConverged
from planners.problem import Problem
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

TOLERANCE = 1e-6  # of solve_bvp: nondimensional residual of z', relative to 1 + |z'|
END_TOLERANCE = 1e-11  # of the nondimensional states at both ends
MAX_MESH_GROWTH = 20  # nodes over those of the first mesh; three links, robust, with a lag take 8
MAX_MESH_ENTRIES = 1e6  # nodes x states^2 of one mesh: 300 MB
MAX_WORK = 5e6  # nodes x states^2 over all Jacobians: 0.5 to 1 us each


def plan_collocation(problem: Problem) -> Trajectory:
    """Minimise 1/2 int (x'Qx + r u^2) dt by Lobatto collocation of order 4 (scipy's solve_bvp).

    The mesh is adaptive. State and costate are divided by their scales, time by time_s; Jacobians
    are analytic; the initial guess is zero. Raises NotConverged with solve_bvp's message when it
    fails or exceeds its work, PlanError for a nonlinear problem that is not supported.
    """
    from scipy.integrate import solve_bvp

    bvp = boundary_value_problem(problem)
    n, time_s = len(bvp.start), bvp.time_s
    scales = bvp.scales[:, None]
    start, goal = bvp.start / bvp.scales[:n], bvp.goal / bvp.scales[:n]
    ratio = (scales.T / scales)[:, :, None] * time_s
    identity, zeros = np.eye(n, 2 * n), np.zeros((n, 2 * n))
    by_start, by_goal = np.vstack([identity, zeros]), np.vstack([zeros, identity])
    t_s = graded_grid(bvp)
    max_nodes = int(min(MAX_MESH_GROWTH * len(t_s), MAX_MESH_ENTRIES / n**2))
    work = WorkBudget("collocation", MAX_WORK, bvp.hint)
    work.spend(float(len(t_s) * n * n))

    def rhs(_: FloatArray, z: FloatArray) -> FloatArray:
        return bvp.rhs(z * scales) / scales * time_s

    def jacobian(_: FloatArray, z: FloatArray) -> FloatArray:
        work.spend(float(z.shape[1] * n * n))
        return np.asarray(bvp.jacobian(z * scales) * ratio)

    def end_errors(at_start: FloatArray, at_goal: FloatArray) -> FloatArray:
        return np.concatenate([at_start[:n] - start, at_goal[:n] - goal])

    def end_jacobians(_: FloatArray, __: FloatArray) -> tuple[FloatArray, FloatArray]:
        return by_start, by_goal

    # A trial step of Newton's method may overflow; it is then rejected.
    with np.errstate(over="ignore", invalid="ignore"):
        found = solve_bvp(
            rhs,
            end_errors,
            t_s / time_s,
            np.zeros((2 * n, len(t_s))),
            fun_jac=jacobian,
            bc_jac=end_jacobians,
            tol=TOLERANCE,
            bc_tol=END_TOLERANCE,
            max_nodes=max_nodes,
        )
    if found.status != 0:
        residual = float(found.rms_residuals.max())
        raise NotConverged(
            f"collocation: {found.message} Residual {residual:.3g} on {found.x.size} nodes; must "
            f"be <= {TOLERANCE:g} on {max_nodes} in time_s = {time_s}: {bvp.hint}"
        )
    return checked_trajectory(problem, bvp, t_s, found.sol(t_s / time_s) * scales, "collocation")
