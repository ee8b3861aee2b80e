"""Necessary conditions of a minimum-energy move (Pontryagin's principle).

z' = f(z) of z = [state; costate] between two given states: a two-point boundary value problem.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from planners.boundary_value.convolution import gramian
from planners.boundary_value.linear import LinearProblem, linear_problem
from planners.boundary_value.nonlinear import nonlinear_pendulum
from planners.problem import Problem
from planners.trajectories.pieces import ComplexArray, FloatArray

ArrayFunction: TypeAlias = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class BoundaryValueProblem:
    """Two-point boundary value problem z' = rhs(z) of n states and n costates.

    Points stand in columns, as in scipy's solve_bvp. Positions count from origin_m: the start
    position, or 0 where a state weight acts on the position.
    """

    origin_m: float

    start: FloatArray  # (n,)
    goal: FloatArray  # (n,)
    time_s: float
    linear: bool
    rhs: ArrayFunction  # (2n, N) -> (2n, N)
    jacobian: ArrayFunction  # (2n, N) -> (2n, 2n, N)
    input: ArrayFunction  # (2n, N) -> (N,)
    acceleration: ArrayFunction  # of the platform, (2n, N) -> (N,)
    scales: FloatArray  # (2n,) units of the nondimensional z
    eigenvalues_1_s: ComplexArray  # (2n,) of the linear problem's Hamiltonian matrix
    hint: str  # next step for the user where a numerical solver fails


def boundary_value_problem(problem: Problem) -> BoundaryValueProblem:
    """Derive the necessary conditions of a problem, linear or nonlinear.

    Raises PlanError for a nonlinear problem other than that of one link whose acceleration or jerk
    is the input.
    """
    pendulum = nonlinear_pendulum(problem) if problem.nonlinear else None
    linear = linear_boundary_value_problem(linear_problem(problem))
    if pendulum is None:
        return linear
    return replace(
        linear,
        linear=False,
        rhs=pendulum.rhs,
        jacobian=pendulum.jacobian,
        input=pendulum.input,
        acceleration=pendulum.acceleration,
        hint="give the move more time, or less distance and swing",
    )


def linear_boundary_value_problem(linear: LinearProblem) -> BoundaryValueProblem:
    """Derive the necessary conditions z' = S z of a linear problem: source 004, (2.1.9)."""
    s, n = linear.hamiltonian, len(linear.start)
    acceleration_row = np.concatenate([linear.a[1], -linear.b[1] / linear.r * linear.b])
    origin = np.eye(n)[0] * (0.0 if linear.q[0].any() else linear.start[0])
    start, goal = linear.start - origin, linear.goal - origin
    if linear.q.any():
        hint = "take matrix_exponential"
    else:
        hint = "take convolution or matrix_exponential"
    return BoundaryValueProblem(
        origin_m=float(origin[0]),
        start=start,
        goal=goal,
        time_s=linear.time_s,
        linear=True,
        rhs=lambda z: s @ z,
        jacobian=lambda z: np.repeat(s[:, :, None], z.shape[1], axis=2),
        input=lambda z: -linear.b @ z[n:] / linear.r,
        acceleration=lambda z: acceleration_row @ z,
        scales=_scales(linear, start, goal),
        eigenvalues_1_s=np.linalg.eigvals(s).astype(np.complex128),
        hint=hint,
    )


def _scales(linear: LinearProblem, start: FloatArray, goal: FloatArray) -> FloatArray:
    """Compute the scales of states and costates: (2n,).

    A state's scale is proportional to its amplitude under an input of unit energy, the root of the
    Gramian's diagonal; a costate's to the inverse.
    """
    modal = linear.system.modal
    eigenvectors = modal.eigenvectors
    squares = np.einsum(
        "ij,jk,ik->i", eigenvectors, gramian(modal, linear.time_s), eigenvectors.conj()
    )
    amplitudes = np.sqrt(np.abs(squares) / linear.r)
    required = float(np.max(np.abs([start, goal]) / amplitudes)) or 1.0
    return required * np.concatenate([amplitudes, 1.0 / amplitudes])
