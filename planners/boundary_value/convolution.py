"""Minimum-energy move by the convolution integral: the Gram matrix of the modes' impulse responses."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from planners.boundary_value.closed_form import refuse_nonlinear, spoilt, trajectory_of
from planners.boundary_value.linear import LinearProblem, Spectrum, linear_problem
from planners.errors import PlanError
from planners.problem import Problem
from planners.trajectories.pieces import ComplexArray, FloatArray
from planners.trajectories.trajectory import Trajectory

GAUSS_NODES = 20  # of Gauss-Legendre on 0..1: exact to rounding for exp(x s), |x| <= FEW
FEW = 8.0
REFINEMENTS = 2  # bring the end from 1e-9 to 1e-12 of the move where the responses are nearly alike


def plan_convolution(problem: Problem) -> Trajectory:
    """min 1/2 int u^2 dt between the problem's two states (source 004, 2.1.10 and 2.1.11 with its missing factor exp(A t)).

    Raises PlanError for state weights, which this solver does not know, and when rounding spoils the end.
    """
    refuse_nonlinear(problem, "convolution")
    if any(problem.state_weights.values()):
        raise PlanError(
            f"state_weights = {dict(problem.state_weights)}; must be 0 for convolution: "
            "take matrix_exponential or finite_differences"
        )
    linear = linear_problem(problem)
    try:
        shares = coefficients(linear)
    except np.linalg.LinAlgError as singular:
        raise spoilt(problem, "convolution", float("inf")) from singular
    return trajectory_of(problem, linear, shares, "convolution")


def coefficients(linear: LinearProblem) -> ComplexArray:
    """Shares of the modes' impulse responses in the input of least energy: (n,).

    Each mode asks for int s^k exp(rate s) u(T - s) ds = what the free motion leaves to do; of all inputs that do it, the
    one of least energy is a sum of those same functions, with the controllability Gramian in modes as their matrix.
    """
    gram, task = gramian(linear.system.spectrum, linear.time_s), _to_do(linear)
    scale = 1.0 / np.sqrt(gram.diagonal().real)
    inverse = np.multiply.outer(scale, scale)
    inverse = inverse * np.linalg.inv(gram * inverse)
    shares = inverse @ task
    for _ in range(REFINEMENTS):
        shares += inverse @ (task - gram @ shares)
    return np.asarray(shares)


def gramian(spectrum: Spectrum, time_s: float) -> ComplexArray:
    """W_ij = int_0^T s^(k_i + k_j) exp((rate_i + conj rate_j) s) ds: (n, n), Hermitian."""
    pairs = spectrum.pairs
    moments = _moments(pairs.eigenvalues_1_s * time_s)  # (m, m, 3)
    return np.asarray(
        moments[pairs.first, pairs.second, pairs.powers] * time_s ** (pairs.powers + 1.0)
    )


def _to_do(linear: LinearProblem) -> ComplexArray:
    """What the input must add to each mode by the end: (n,)."""
    spectrum, time_s = linear.system.spectrum, linear.time_s
    start = spectrum.rows @ linear.start
    start += (time_s * spectrum.powers) * start[spectrum.drivers]  # a driver's own power is 0
    return np.asarray(
        spectrum.rows @ linear.goal - np.exp(spectrum.eigenvalues_1_s * time_s) * start
    )


def _moments(x: ComplexArray) -> ComplexArray:
    """int_0^1 s^k exp(x s) ds for k = 0, 1, 2 in the last place: by quadrature for small |x|, by parts beyond; Re x <= 0."""
    nodes, weights = _gauss_legendre()
    out = np.asarray(
        np.exp(np.multiply.outer(x, nodes)) @ weights, dtype=np.complex128
    )  # (m, m, 3)
    far = np.abs(x) > FEW
    if far.any():
        z = x[far]
        e = np.exp(z)
        i0 = (e - 1.0) / z
        i1 = (e - i0) / z
        out[far] = np.stack([i0, i1, (e - 2.0 * i1) / z], axis=-1)
    return out


@lru_cache(maxsize=1)
def _gauss_legendre() -> tuple[FloatArray, FloatArray]:
    """Nodes (N,) on 0..1 and weights (N, 3) with the powers of s."""
    from numpy.polynomial.legendre import leggauss

    x, w = leggauss(GAUSS_NODES)
    s = (x + 1.0) / 2.0
    return s, (w / 2.0)[:, None] * s[:, None] ** np.arange(3)
