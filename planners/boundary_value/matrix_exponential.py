"""Minimum-energy move by the exponential of the Hamiltonian matrix, as exact pieces."""

from __future__ import annotations

import math

import numpy as np

from planners.errors import PlanError
from planners.pieces import ExpPolynomial, FloatArray, Mode
from planners.problem import Problem
from planners.trajectory import Trajectory

TAYLOR = 1.0 / np.array([math.factorial(k) for k in range(20)]).reshape(5, 4)  # 1/20! = 4e-19: enough for norm <= 1
ZERO_RATE = 1e-6  # of the fastest eigenvalue; a rigid body's double zero comes out this small
END_ERROR = 1e-9  # of the move
SHORT_MOVE_M = 1e-3  # a shorter one is judged as this one


def plan_matrix_exponential(problem: Problem) -> Trajectory:
    """min 1/2 int u^2 dt between the problem's two states (source 004, section 2.1.2; Q = 0, R = 1).

    State and costate obey z' = S z, S = [[A, -B B'], [0, -A']]; the first costate is S12^-1 (xf - S11 x0) with the
    blocks of exp(S T), and u = -B' exp(-A' t) lambda0. Raises PlanError when rounding spoils the end of the move.
    """
    model = problem.model.state_space()
    x0, xf, n = problem.start(), problem.goal(), len(model.states)
    s = np.zeros((2 * n, 2 * n))
    s[:n, :n], s[:n, n:], s[n:, n:] = model.a, -model.b @ model.b.T, -model.a.T
    flow = _exponential(s * problem.time_s)
    if not np.isfinite(flow).all():
        raise _spoilt(problem, math.inf)
    try:
        costate = np.asarray(np.linalg.solve(flow[:n, n:], xf - flow[:n, :n] @ x0), dtype=np.float64)
    except np.linalg.LinAlgError as singular:
        raise _spoilt(problem, math.inf) from singular
    acceleration = _output(-model.b[:, 0], -model.a.T, costate, problem.time_s)
    move = acceleration.integral(float(x0[1])).integral(float(x0[0]))
    error = abs(float(move.at(np.asarray(problem.time_s))) - float(xf[0]))
    if not error <= END_ERROR * max(abs(problem.distance_m), SHORT_MOVE_M):
        raise _spoilt(problem, error)
    return Trajectory((move,))


def _exponential(matrix: FloatArray) -> FloatArray:
    """exp(matrix) by scaling, Taylor series and squaring; the series in blocks of four powers (Paterson & Stockmeyer)."""
    squarings = max(0, math.frexp(float(np.abs(matrix).sum(axis=1).max()))[1])
    step = matrix / 2.0**squarings
    square = step @ step
    powers = np.stack([np.eye(len(matrix)), step, square, square @ step])
    blocks = np.tensordot(TAYLOR, powers, 1)  # (5, n, n)
    fourth, out = square @ square, np.asarray(blocks[-1], dtype=np.float64)
    for block in blocks[-2::-1]:
        out = block + fourth @ out
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused by the caller
        for _ in range(squarings):
            out = out @ out
    return out


def _output(row: FloatArray, matrix: FloatArray, start: FloatArray, duration_s: float) -> ExpPolynomial:
    """row' exp(matrix t) start in closed form: distinct eigenvalues, and a double zero (the platform moves freely).

    matrix^2 start has no part along the double zero, so the eigenvectors that move span it.
    """
    rates, right = np.linalg.eig(matrix)
    moving = np.abs(rates) > ZERO_RATE * np.abs(rates).max()
    rates, right = rates[moving], right[:, moving]
    shares = np.linalg.lstsq(right, matrix @ (matrix @ start), rcond=None)[0] / rates**2
    drift = (start - right @ shares).real
    modes = (
        Mode(rate, (size if rate.imag == 0.0 else 2.0 * size,))  # a conjugate doubles the real part
        for rate, size in zip(rates.tolist(), ((row @ right) * shares).tolist(), strict=True)
        if rate.imag >= 0.0
    )
    return ExpPolynomial(duration_s, (float(row @ drift), float(row @ matrix @ drift)), tuple(modes))


def _spoilt(problem: Problem, error_m: float) -> PlanError:
    return PlanError(
        f"matrix_exponential misses the end by {error_m:.3g} m in time_s = {problem.time_s}; must be within {END_ERROR:g} of "
        f"distance_m = {problem.distance_m}: choose a time nearer to the load's period"
    )
