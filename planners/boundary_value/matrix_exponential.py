"""Optimal move by the exponential of the Hamiltonian matrix, doubled from a short step so that nothing overflows."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.boundary_value.closed_form import checked_end, refuse_nonlinear, spoilt, trajectory_of
from planners.boundary_value.linear import LinearProblem, linear_problem
from planners.errors import PlanError
from planners.problem import Problem
from planners.trajectories.cells import Polynomials
from planners.trajectories.pieces import ComplexArray
from planners.trajectories.trajectory import Trajectory

TAYLOR = 1.0 / np.array([math.factorial(k) for k in range(20)]).reshape(
    5, 4
)  # 1/20! = 4e-19: enough for norm <= 1
DEGREE = 18  # of the polynomial pieces of a step of norm <= 1
REFINEMENTS = 2
MOST_CELLS = 16384  # polynomial pieces of a plan with state weights


def plan_matrix_exponential(problem: Problem) -> Trajectory:
    """min 1/2 int (x'Qx + r u^2) dt between the problem's two states (source 004, 2.1.9 to 2.1.14).

    State and costate obey z' = S z. The source takes exp(S T) as a whole, which overflows as soon as a filter is much
    faster than the move (T/tau = 126 in its tables); here a short exp(S h) is turned into what each end owes to the other
    and doubled.
    Raises PlanError when rounding spoils the end of the move.
    """
    refuse_nonlinear(problem, "matrix_exponential")
    linear = linear_problem(problem)
    rows = linear.system.spectrum.rows
    levels = _doubled(linear)
    whole = levels[-1]
    task = rows @ linear.goal - whole.phi @ (rows @ linear.start)
    scale = 1.0 / np.sqrt(np.abs(whole.g.diagonal()))
    try:
        inverse = scale[:, None] * np.linalg.inv(scale[:, None] * whole.g * scale) * scale
    except np.linalg.LinAlgError as singular:
        raise spoilt(problem, "matrix_exponential", math.inf) from singular
    costate = inverse @ task
    for _ in range(REFINEMENTS):
        costate += inverse @ (task - whole.g @ costate)
    if not linear.q.any():
        return trajectory_of(problem, linear, -costate / linear.r, "matrix_exponential")
    return _cells(problem, linear, levels, costate)


class _Reach(NamedTuple):
    """What two ends of an interval owe to each other: xi_end = phi xi + g costate_end, costate = h xi + phi* costate_end.

    In modes, where the numbers are all of one size.
    """

    phi: ComplexArray  # (n, n)
    g: ComplexArray  # (n, n), negative
    h: ComplexArray  # (n, n), positive; 0 without state weights


def _doubled(linear: LinearProblem) -> list[_Reach]:
    """Intervals of T/2^k up to T (structure-preserving doubling: Chu, Fan & Lin 2005).

    Without state weights g is minus the Gramian, and W(2h) = W + phi W phi*.
    """
    n, s = len(linear.start), linear.modal_hamiltonian
    size = float(np.abs(s).sum(axis=1).max()) * linear.time_s
    if linear.q.any():  # every interval becomes a piece: the sharper norm is worth its price
        size = float(np.linalg.norm(s, 2)) * linear.time_s
    if linear.q.any() and not size <= MOST_CELLS:
        raise PlanError(
            f"state_weights over input_weight = {linear.r:g} make a motion {size:.3g} times faster than "
            f"time_s = {linear.time_s}; must be <= {MOST_CELLS}: weigh the states less"
        )
    steps = max(0, math.frexp(size)[1])
    flow = _exponential(s * (linear.time_s / 2.0**steps))
    back = np.asarray(np.linalg.inv(flow[n:, n:]), dtype=np.complex128)
    levels = [_Reach(back.conj().T, flow[:n, n:] @ back, -back @ flow[n:, :n])]
    for _ in range(steps):
        phi, g, h = levels[-1]
        adjoint = phi.conj().T
        if linear.q.any():
            middle = np.linalg.inv(np.eye(n) - g @ h)
            through = phi @ middle
            levels.append(
                _Reach(through @ phi, g + through @ g @ adjoint, h + adjoint @ h @ middle @ phi)
            )
        else:
            levels.append(_Reach(phi @ phi, g + phi @ g @ adjoint, h))
    return levels


def _cells(
    problem: Problem, linear: LinearProblem, levels: list[_Reach], costate: ComplexArray
) -> Trajectory:
    """Modes and costates where intervals meet, by halving from the whole down; a Taylor polynomial on each."""
    spectrum = linear.system.spectrum
    x, p = (
        (spectrum.rows @ linear.start)[:, None],
        costate[:, None],
    )  # (n, intervals): modes left, costate right
    for phi, g, h in reversed(levels[:-1]):
        adjoint = phi.conj().T
        middle = np.linalg.solve(np.eye(len(x)) - g @ h, phi @ x + g @ adjoint @ p)
        met = h @ middle + adjoint @ p
        x, p = (np.stack(pair, axis=-1).reshape(len(x), -1) for pair in ((x, middle), (met, p)))
    z = np.vstack([x, levels[0].h @ x + levels[0].phi.conj().T @ p])  # (2n, intervals)
    s, duration_s = linear.modal_hamiltonian, problem.time_s / z.shape[1]
    row = np.concatenate(
        [linear.a[1] @ spectrum.columns, -linear.b[1] * linear.costate_unit / linear.r * spectrum.b]
    )  # the platform's acceleration
    coefficients = list((spectrum.columns[:2] @ x).real)
    for k in range(2, DEGREE + 1):
        coefficients.append((row @ z).real / (k * (k - 1)))
        z = s @ z / (k - 1)
    pieces = Polynomials(np.full(len(coefficients[0]), duration_s), np.transpose(coefficients))
    return Trajectory(
        checked_end(problem, "matrix_exponential", pieces, pieces[-1].value(duration_s))
    )


def _exponential(matrix: ComplexArray) -> ComplexArray:
    """exp(matrix) of a matrix of norm <= 1 by its Taylor series in blocks of four powers (Paterson & Stockmeyer 1973)."""
    square = matrix @ matrix
    powers = np.stack([np.eye(len(matrix)), matrix, square, square @ matrix])
    blocks = np.tensordot(TAYLOR, powers, 1)  # (5, n, n)
    fourth, out = square @ square, blocks[-1]
    for block in blocks[-2::-1]:
        out = block + fourth @ out
    return np.asarray(out, dtype=np.complex128)
