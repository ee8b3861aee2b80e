"""Minimum-energy move by the convolution integral: Gram matrix of the modes' impulse responses."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from planners.boundary_value.closed_form import end_error, platform_trajectory, refuse_nonlinear
from planners.boundary_value.linear import LinearProblem, linear_problem
from planners.boundary_value.modal_form import ModalForm
from planners.errors import PlanError
from planners.problem import Problem
from planners.trajectories.pieces import ComplexArray, FloatArray
from planners.trajectories.trajectory import Trajectory

GAUSS_NODES = 20  # on 0..1: exact to rounding for exp(x s), |x| <= MAX_GAUSS_EXPONENT
MAX_GAUSS_EXPONENT = 8.0
REFINEMENTS = 2  # reduce the end error from 1e-9 to 1e-12 of the move for responses nearly alike


def plan_convolution(problem: Problem) -> Trajectory:
    """Minimise 1/2 int u^2 dt between the problem's two states.

    Source 004, 2.1.10 and 2.1.11 with its missing factor exp(A t). Raises PlanError for state
    weights, which this planner does not support, and when rounding displaces the end.
    """
    refuse_nonlinear(problem, "convolution")
    if any(problem.state_weights.values()):
        raise PlanError(
            f"state_weights = {dict(problem.state_weights)}; must be 0 for convolution: "
            "take matrix_exponential or finite_differences"
        )
    linear = linear_problem(problem)
    try:
        solution = coefficients(linear)
    except np.linalg.LinAlgError as singular:
        raise end_error(problem, "convolution", float("inf")) from singular
    return platform_trajectory(problem, linear, solution, "convolution")


def coefficients(linear: LinearProblem) -> ComplexArray:
    """Solve for the coefficients of the modes' impulse responses in the optimal input: (n,).

    Each mode requires int s^k exp(mu s) u(T - s) ds = goal - free motion. Of all inputs that
    satisfy this, the one of least energy is a sum of those same functions, whose Gram matrix is
    the modal controllability Gramian.
    """
    gram = gramian(linear.system.modal, linear.time_s)
    required = _required_change(linear)
    scale = 1.0 / np.sqrt(gram.diagonal().real)
    inverse = np.multiply.outer(scale, scale)
    inverse = inverse * np.linalg.inv(gram * inverse)
    solution = inverse @ required
    for _ in range(REFINEMENTS):
        solution += inverse @ (required - gram @ solution)
    return np.asarray(solution)


def gramian(modal: ModalForm, time_s: float) -> ComplexArray:
    """Compute W_ij = int_0^T s^(k_i + k_j) exp((mu_i + conj mu_j) s) ds: (n, n), Hermitian."""
    pairs = modal.pairs
    moments = _moments(pairs.eigenvalues_1_s * time_s)  # (m, m, 3)
    return np.asarray(
        moments[pairs.first, pairs.second, pairs.powers] * time_s ** (pairs.powers + 1.0)
    )


def _required_change(linear: LinearProblem) -> ComplexArray:
    """Compute the change that the input must cause in each mode by the end: (n,)."""
    modal, time_s = linear.system.modal, linear.time_s
    start = modal.left_eigenvectors @ linear.start
    start += (time_s * modal.powers) * start[modal.drivers]  # a driver's own power is 0
    goal = modal.left_eigenvectors @ linear.goal
    return np.asarray(goal - np.exp(modal.eigenvalues_1_s * time_s) * start)


def _moments(x: ComplexArray) -> ComplexArray:
    """Compute int_0^1 s^k exp(x s) ds for k = 0, 1, 2 to rounding; Re x <= 0.

    By Gauss quadrature for small |x|, by integration by parts beyond.
    """
    nodes, weights = _gauss_legendre()
    exponentials = np.exp(np.multiply.outer(x, nodes))
    out = np.asarray(exponentials @ weights, dtype=np.complex128)  # (m, m, 3)
    far = np.abs(x) > MAX_GAUSS_EXPONENT
    if far.any():
        z = x[far]
        e = np.exp(z)
        i0 = (e - 1.0) / z
        i1 = (e - i0) / z
        out[far] = np.stack([i0, i1, (e - 2.0 * i1) / z], axis=-1)
    return out


@lru_cache(maxsize=1)
def _gauss_legendre() -> tuple[FloatArray, FloatArray]:
    """Compute Gauss nodes (N,) on 0..1 and their weights times s^k: (N, 3)."""
    from numpy.polynomial.legendre import leggauss

    x, w = leggauss(GAUSS_NODES)
    s = (x + 1.0) / 2.0
    return s, (w / 2.0)[:, None] * s[:, None] ** np.arange(3)
