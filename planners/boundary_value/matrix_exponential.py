"""Optimal move by the exponential of the Hamiltonian matrix, by structure-preserving doubling."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.boundary_value.closed_form import (
    checked_end,
    end_error,
    platform_trajectory,
    refuse_nonlinear,
)
from planners.boundary_value.linear import LinearProblem, linear_problem
from planners.errors import PlanError
from planners.problem import Problem
from planners.trajectories.cells import Polynomials
from planners.trajectories.pieces import ComplexArray
from planners.trajectories.trajectory import Trajectory

# Taylor series of exp in blocks of four powers; 1/20! = 4e-19 is enough for norm <= 1.
TAYLOR = 1.0 / np.array([math.factorial(k) for k in range(20)]).reshape(5, 4)
CELL_DEGREE = 18  # of the polynomial pieces of a step of norm <= 1
REFINEMENTS = 2  # of the costate at the end
MAX_CELLS = 16384  # polynomial pieces of a plan with state weights


def plan_matrix_exponential(problem: Problem) -> Trajectory:
    """Minimise 1/2 int (x'Qx + r u^2) dt between the problem's two states.

    Source 004, 2.1.9 to 2.1.14. State and costate obey z' = S z. The source takes exp(S T) as a
    whole, which overflows as soon as a filter is much faster than the move (T/tau = 126 in its
    tables); here a short exp(S h) is converted into a map between the two ends of the interval, and
    the interval is doubled. Raises PlanError when rounding displaces the end of the move.
    """
    refuse_nonlinear(problem, "matrix_exponential")
    linear = linear_problem(problem)
    left_eigenvectors = linear.system.modal.left_eigenvectors
    levels = _double_intervals(linear)
    whole = levels[-1]
    goal = left_eigenvectors @ linear.goal
    required = goal - whole.phi @ (left_eigenvectors @ linear.start)
    scale = 1.0 / np.sqrt(np.abs(whole.g.diagonal()))
    try:
        inverse = scale[:, None] * np.linalg.inv(scale[:, None] * whole.g * scale) * scale
    except np.linalg.LinAlgError as singular:
        raise end_error(problem, "matrix_exponential", math.inf) from singular
    costate = inverse @ required
    for _ in range(REFINEMENTS):
        costate += inverse @ (required - whole.g @ costate)
    if not linear.q.any():
        return platform_trajectory(problem, linear, -costate / linear.r, "matrix_exponential")
    return _polynomial_trajectory(problem, linear, levels, costate)


class _IntervalMap(NamedTuple):
    """Map between the ends of an interval, in modal coordinates xi.

    xi_end = phi xi + g costate_end, costate = h xi + phi* costate_end.
    """

    phi: ComplexArray  # (n, n)
    g: ComplexArray  # (n, n), negative
    h: ComplexArray  # (n, n), positive; 0 without state weights


def _double_intervals(linear: LinearProblem) -> list[_IntervalMap]:
    """Compute the maps of intervals of T/2^k up to T.

    Structure-preserving doubling: Chu, Fan & Lin 2005. Without state weights g is minus the
    Gramian, and W(2h) = W + phi W phi*. Raises PlanError for state weights that are too large.
    """
    n, s = len(linear.start), linear.modal_hamiltonian
    if linear.q.any():  # every interval becomes a piece, so the sharper norm pays
        norm = float(np.linalg.norm(s, 2)) * linear.time_s
    else:
        norm = float(np.abs(s).sum(axis=1).max()) * linear.time_s
    if linear.q.any() and not norm <= MAX_CELLS:
        raise PlanError(
            f"state_weights over input_weight = {linear.r:g} cause a motion {norm:.3g} times "
            f"faster than time_s = {linear.time_s}; must be <= {MAX_CELLS}: weigh the states less"
        )
    steps = max(0, math.frexp(norm)[1])
    flow = _exponential(s * (linear.time_s / 2.0**steps))
    inverse = np.asarray(np.linalg.inv(flow[n:, n:]), dtype=np.complex128)
    first = _IntervalMap(inverse.conj().T, flow[:n, n:] @ inverse, -inverse @ flow[n:, :n])
    levels = [first]
    for _ in range(steps):
        phi, g, h = levels[-1]
        adjoint = phi.conj().T
        if linear.q.any():
            middle = np.linalg.inv(np.eye(n) - g @ h)
            through = phi @ middle
            doubled = _IntervalMap(
                through @ phi, g + through @ g @ adjoint, h + adjoint @ h @ middle @ phi
            )
        else:
            doubled = _IntervalMap(phi @ phi, g + phi @ g @ adjoint, h)
        levels.append(doubled)
    return levels


def _polynomial_trajectory(
    problem: Problem, linear: LinearProblem, levels: list[_IntervalMap], costate: ComplexArray
) -> Trajectory:
    """Halve the intervals down to the shortest; a Taylor polynomial of the position on each."""
    modal = linear.system.modal
    x = (modal.left_eigenvectors @ linear.start)[:, None]  # (n, intervals) at their left ends
    p = costate[:, None]  # (n, intervals) at their right ends
    for phi, g, h in reversed(levels[:-1]):
        adjoint = phi.conj().T
        middle = np.linalg.solve(np.eye(len(x)) - g @ h, phi @ x + g @ adjoint @ p)
        middle_costate = h @ middle + adjoint @ p
        x = np.stack((x, middle), axis=-1).reshape(len(x), -1)
        p = np.stack((middle_costate, p), axis=-1).reshape(len(x), -1)
    z = np.vstack([x, levels[0].h @ x + levels[0].phi.conj().T @ p])  # (2n, intervals)
    s, duration_s = linear.modal_hamiltonian, problem.time_s / z.shape[1]
    from_state = linear.a[1] @ modal.eigenvectors
    from_costate = -linear.b[1] * linear.costate_unit / linear.r * modal.b
    acceleration_row = np.concatenate([from_state, from_costate])
    coefficients = list((modal.eigenvectors[:2] @ x).real)
    for k in range(2, CELL_DEGREE + 1):
        coefficients.append((acceleration_row @ z).real / (k * (k - 1)))
        z = s @ z / (k - 1)
    pieces = Polynomials(np.full(len(coefficients[0]), duration_s), np.transpose(coefficients))
    return Trajectory(
        checked_end(problem, "matrix_exponential", pieces, pieces[-1].value(duration_s))
    )


def _exponential(matrix: ComplexArray) -> ComplexArray:
    """Compute exp(matrix) of a matrix of norm <= 1 by its Taylor series in blocks of four powers.

    Paterson & Stockmeyer 1973.
    """
    square = matrix @ matrix
    powers = np.stack([np.eye(len(matrix)), matrix, square, square @ matrix])
    blocks = np.tensordot(TAYLOR, powers, 1)  # (5, n, n)
    fourth, out = square @ square, blocks[-1]
    for block in blocks[-2::-1]:
        out = block + fourth @ out
    return np.asarray(out, dtype=np.complex128)
