"""What a minimum-energy move must obey: z' = f(z) of z = [state; costate] between two states (Pontryagin's principle)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from planners.boundary_value.convolution import gramian
from planners.boundary_value.linear import LinearProblem, linear_problem
from planners.boundary_value.nonlinear import true_pendulum
from planners.problem import Problem
from planners.trajectories.pieces import ComplexArray, FloatArray

Field = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Conditions:
    """z' = slope(z) with n states and n costates; points stand in columns, as scipy's solve_bvp wants them.

    Positions count from origin_m, which is the start where no weight on the position says what zero is.
    """

    origin_m: float

    start: FloatArray  # (n,)
    goal: FloatArray  # (n,)
    time_s: float
    linear: bool
    slope: Field  # (2n, N) -> (2n, N)
    jacobian: Field  # (2n, N) -> (2n, 2n, N)
    input: Field  # (2n, N) -> (N,)
    acceleration: Field  # of the platform, (2n, N) -> (N,)
    sizes: FloatArray  # (2n,) of what z may become, to divide by
    eigenvalues_1_s: ComplexArray  # (2n,) eigenvalues of the linear problem's Hamiltonian
    way_out: str  # what helps where a numerical solver fails


def conditions(problem: Problem) -> Conditions:
    """The necessary conditions of a problem, linear or of the true pendulum.

    Raises PlanError for a nonlinear problem other than that of one link whose acceleration or jerk is the input.
    """
    pendulum = true_pendulum(problem) if problem.nonlinear else None
    linear = linear_conditions(linear_problem(problem))
    if pendulum is None:
        return linear
    return replace(
        linear,
        linear=False,
        slope=pendulum.slope,
        jacobian=pendulum.jacobian,
        input=pendulum.input,
        acceleration=pendulum.acceleration,
        way_out="give the move more time, or less distance and swing",
    )


def linear_conditions(linear: LinearProblem) -> Conditions:
    """z' = S z, source 004, (2.1.9)."""
    s, n = linear.hamiltonian, len(linear.start)
    row = np.concatenate([linear.a[1], -linear.b[1] / linear.r * linear.b])
    origin = np.eye(n)[0] * (0.0 if linear.q[0].any() else linear.start[0])
    start, goal = linear.start - origin, linear.goal - origin
    return Conditions(
        origin_m=float(origin[0]),
        start=start,
        goal=goal,
        time_s=linear.time_s,
        linear=True,
        slope=lambda z: s @ z,
        jacobian=lambda z: np.repeat(s[:, :, None], z.shape[1], axis=2),
        input=lambda z: -linear.b @ z[n:] / linear.r,
        acceleration=lambda z: row @ z,
        sizes=_sizes(linear, start, goal),
        eigenvalues_1_s=np.linalg.eigvals(s).astype(np.complex128),
        way_out="take matrix_exponential"
        if linear.q.any()
        else "take convolution or matrix_exponential",
    )


def _sizes(linear: LinearProblem, start: FloatArray, goal: FloatArray) -> FloatArray:
    """Each state against what an input of energy 1 makes of it, the root of the Gramian's diagonal; costates the inverse."""
    columns = linear.system.spectrum.columns
    squares = np.einsum(
        "ij,jk,ik->i", columns, gramian(linear.system.spectrum, linear.time_s), columns.conj()
    )
    reach = np.sqrt(np.abs(squares) / linear.r)
    asked = float(np.max(np.abs([start, goal]) / reach)) or 1.0
    return asked * np.concatenate([reach, 1.0 / reach])
