"""Solutions at nodes: the grid of nodes, the trajectory through them and its terminal error."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.boundary_value.conditions import BoundaryValueProblem
from planners.boundary_value.linear import LinearProblem
from planners.errors import NotConverged, PlanError
from planners.problem import Problem
from planners.replay import replay
from planners.trajectories.pieces import ExpPolynomial, FloatArray
from planners.trajectories.trajectory import Trajectory

MIN_INTERVALS = 200  # of a move, as in source 004
MAX_INTERVALS = 20_000
# Phase or decay of a mode in an interval [rad]; the quintic's error is then 0.1^4/1920 = 5e-8 of
# the mode's acceleration.
RADIANS_PER_INTERVAL = 0.1
NODE_ROUNDING_REL = 1e-9  # of half the duration
MAX_TIME_CONSTANTS = 1e8  # of the fastest mode in a move, so that intervals exceed rounding
# Terminal error relative to the swing that the platform's acceleration would cause if none of it
# cancelled.
MAX_TERMINAL_ERROR_REL = 1e-6
TINY_RAD = 1e-300  # a denormal swing has no digits left to meet MAX_TERMINAL_ERROR_REL


class Nodes(NamedTuple):
    """State, costate and input at instants of a move."""

    t_s: FloatArray  # (N+1,) from 0 to the end
    states: FloatArray  # (N+1, n)
    costates: FloatArray  # (N+1, n)
    input: FloatArray  # (N+1,)


class WorkBudget:
    """Upper bound of a solver's work, counted and not timed, so that results are reproducible."""

    def __init__(self, planner: str, most: float, hint: str) -> None:
        self._planner = planner
        self._most = most
        self._hint = hint
        self._spent = 0.0

    def spend(self, work: float) -> None:
        """Count work about to be done. Raises NotConverged when the sum exceeds the budget."""
        self._spent += work
        if not self._spent <= self._most:
            raise NotConverged(
                f"{self._planner} requires {self._spent:.3g} units of work and has not converged; "
                f"must be <= {self._most:.3g}: {self._hint}"
            )


def input_from_costates(linear: LinearProblem, costates: FloatArray) -> FloatArray:
    """Compute u = -b'p/r, which minimises the Hamiltonian: (..., n) -> (...).

    Source 004, section 2.1.
    """
    return np.asarray(costates @ linear.b / -linear.r)


def graded_grid(bvp: BoundaryValueProblem) -> FloatArray:
    """Place instants (N+1,) that resolve every mode: N = 200 equal intervals, or more as required.

    A mode exp(mu t) with a real part is significant near the ends only, and the error of a quintic
    grows with the fourth power of an interval, so intervals may grow as exp(|Re mu| t / 4) away
    from the ends: the jerk model's filter needs 30 more of them, not T/tau. Raises PlanError beyond
    20 000 intervals, or for a mode whose time constant is within rounding of the move.
    """
    hint = bvp.hint if bvp.linear else "weigh the states less, or give the move less time"
    magnitudes = np.abs(bvp.eigenvalues_1_s)
    time_constants = float(magnitudes.max()) * bvp.time_s
    if not time_constants <= MAX_TIME_CONSTANTS:
        raise PlanError(
            f"time_s = {bvp.time_s} is {time_constants:.3g} time constants of the fastest motion "
            f"that model, state_weights and input_weight cause; must be <= {MAX_TIME_CONSTANTS:g} "
            f"for a numerical solver: {hint}"
        )
    fast = set[tuple[float, float]]()  # decay of the density and density at the end [1/s]
    fast_modes = magnitudes * bvp.time_s > MIN_INTERVALS * RADIANS_PER_INTERVAL
    for eigenvalue in bvp.eigenvalues_1_s[fast_modes].tolist():
        density = float(abs(eigenvalue)) / RADIANS_PER_INTERVAL
        fast.add((float(abs(eigenvalue.real)) / 4.0, density))
    densities = sorted(fast)
    middle_s = bvp.time_s / 2.0
    t = [0.0]
    while t[-1] < middle_s * (1.0 - NODE_ROUNDING_REL):
        density = MIN_INTERVALS / bvp.time_s
        for decay, end_density in densities:
            density = max(density, end_density * math.exp(-decay * t[-1]))
        t.append(t[-1] + 1.0 / density)
        if len(t) > MAX_INTERVALS / 2:
            raise PlanError(
                f"time_s = {bvp.time_s} requires more than {MAX_INTERVALS} intervals; "
                f"must be fewer for a numerical solver: {hint}"
            )
    half = np.array(t) * (middle_s / t[-1])
    return np.concatenate([half[:-1], [middle_s], bvp.time_s - half[-2::-1]])


def through_nodes(
    t_s: FloatArray,
    position_m: FloatArray,
    speed_m_s: FloatArray,
    acceleration_m_s2: FloatArray,
    origin_m: float = 0.0,
) -> Trajectory:
    """Interpolate position (from origin_m), speed and acceleration by quintics: (N+1,) each."""
    h = np.diff(t_s)
    y, v, a = position_m[:-1], speed_m_s[:-1], acceleration_m_s2[:-1]
    d0 = (position_m[1:] - (y + h * (v + h * a / 2.0))) / h**3
    d1 = (speed_m_s[1:] - (v + h * a)) / h**2
    d2 = (acceleration_m_s2[1:] - a) / h
    c3 = 10.0 * d0 - 4.0 * d1 + d2 / 2.0
    c4 = (-15.0 * d0 + 7.0 * d1 - d2) / h
    c5 = (6.0 * d0 - 3.0 * d1 + d2 / 2.0) / h**2
    rows = np.column_stack([origin_m + y, v, a / 2.0, c3, c4, c5]).tolist()
    return Trajectory(
        tuple(ExpPolynomial(d, tuple(c)) for d, c in zip(h.tolist(), rows, strict=True))
    )


def checked_trajectory(
    problem: Problem, bvp: BoundaryValueProblem, t_s: FloatArray, z: FloatArray, planner: str
) -> Trajectory:
    """Interpolate z (2n, N+1) by a trajectory and check its terminal error on the load.

    Raises NotConverged when the error is too large.
    """
    trajectory = through_nodes(t_s, z[0], z[1], bvp.acceleration(z), bvp.origin_m)
    model, n = problem.model, problem.model.links_count
    start, goal = bvp.start[: 2 + 2 * n], bvp.goal[: 2 + 2 * n]
    modes = model.modes()
    left_s, speed_steps = _speed_steps(trajectory)
    start_modes = modes.left_eigenvectors @ start[2:]
    largest_mode = float(np.abs(speed_steps).sum() + np.abs(start_modes).max())
    largest_shape = float(np.max(np.abs(modes.mode_shapes[:n]).sum(axis=1)))
    bound_rad = MAX_TERMINAL_ERROR_REL * largest_shape * largest_mode + TINY_RAD
    if problem.nonlinear:
        swing = replay(
            model,
            trajectory,
            angles_rad=start[2:3],
            rates_rad_s=start[3:4],
            speed_before_m_s=float(start[1]),
            speed_after_m_s=float(goal[1]),
        )
        end = np.concatenate([swing.angle_rad[-1], swing.angular_velocity_rad_s[-1]])
    else:
        mu = modes.eigenvalues_1_s
        q = np.exp(mu * bvp.time_s) * start_modes + np.exp(np.outer(mu, left_s)) @ speed_steps
        end = (modes.mode_shapes @ q).real
    error_rad = model.amplitude_rad(*np.split(end - goal[2:], 2))
    if not error_rad <= bound_rad:
        raise NotConverged(
            f"{planner}: terminal error {error_rad:.3g} rad in time_s = {problem.time_s}; must be "
            f"<= {bound_rad:.3g} rad: {bvp.hint}"
        )
    return trajectory


def _speed_steps(trajectory: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Compute time left [s] and acceleration x weight [m/s] at four Gauss nodes a piece: (4 N,)."""
    from numpy.polynomial.legendre import leggauss

    x, w = leggauss(4)
    halves = np.diff(trajectory.breaks_s)[:, None] / 2.0
    t = (trajectory.breaks_s[:-1, None] + halves * (1.0 + x)).ravel()
    return trajectory.duration_s - t, trajectory.at(t, 2) * (halves * w).ravel()
