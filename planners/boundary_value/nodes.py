"""A solution known at nodes: where the nodes must lie, and the trajectory through them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.boundary_value.conditions import Conditions
from planners.boundary_value.linear import LinearProblem
from planners.errors import NotConverged, PlanError
from planners.problem import Problem
from planners.replay import replay
from planners.trajectories.pieces import ExpPolynomial, FloatArray
from planners.trajectories.trajectory import Trajectory

MIN_INTERVALS = 200  # intervals of a move, the source's number
MOST = 20_000
RADIANS = 0.1  # of a mode's phase or decay in an interval: a quintic leaves 0.1^4/1920 = 5e-8 of its acceleration
NODE_ROUNDING_REL = 1e-9
FASTEST = 1e8  # time constants of the fastest mode in a move: its intervals must survive rounding
TINY_RAD = 1e-300  # a denormal swing has no digits left to meet END_SWING
END_SWING = (
    1e-6  # of what the platform's acceleration could swing the load by if it never cancelled
)


class Nodes(NamedTuple):
    """State, costate and input at instants of a move."""

    t_s: FloatArray  # (N+1,) from 0 to the end
    states: FloatArray  # (N+1, n)
    costates: FloatArray  # (N+1, n)
    input: FloatArray  # (N+1,)


class Budget:
    """Work that a solver may do before it refuses, counted and not timed, so that a machine's load changes no answer."""

    def __init__(self, planner: str, most: float, way_out: str) -> None:
        self._planner, self._most, self._way_out, self._spent = planner, most, way_out, 0.0

    def spend(self, work: float) -> None:
        """Count work about to be done. Raises NotConverged when that is more than the budget."""
        self._spent += work
        if not self._spent <= self._most:
            raise NotConverged(
                f"{self._planner} asks for {self._spent:.3g} units of work and is not done; must be <= {self._most:.3g}: "
                f"{self._way_out}"
            )


def input_from_costates(linear: LinearProblem, costates: FloatArray) -> FloatArray:
    """u = -b'p/r, which minimises the Hamiltonian: (..., n) -> (...); source 004, section 2.1."""
    return np.asarray(costates @ linear.b / -linear.r)


def graded_grid(conditions: Conditions) -> FloatArray:
    """Instants (N+1,) that resolve every mode: N = 200 equal intervals, or as many as the fastest asks for.

    A mode exp(rate t) with a real part lives near the ends only, and a quintic's error grows with the fourth power of
    an interval, so intervals may grow there as exp(|Re rate| t / 4): the jerk model's filter costs 30 of them, not T/tau of
    each. Raises PlanError beyond 20 000, or for a mode that ends within rounding of the move's ends.
    """
    out = (
        conditions.way_out
        if conditions.linear
        else "weigh the states less, or give the move less time"
    )
    fastest = float(np.abs(conditions.eigenvalues_1_s).max()) * conditions.time_s
    if not fastest <= FASTEST:
        raise PlanError(
            f"time_s = {conditions.time_s} is {fastest:.3g} time constants of the fastest motion that model, state_weights "
            f"and input_weight make; must be <= {FASTEST:g} for a numerical solver: {out}"
        )
    rates = conditions.eigenvalues_1_s[
        np.abs(conditions.eigenvalues_1_s) * conditions.time_s > MIN_INTERVALS * RADIANS
    ]
    fast = sorted(
        {(float(abs(rate.real)) / 4.0, float(abs(rate)) / RADIANS) for rate in rates.tolist()}
    )
    middle, t = conditions.time_s / 2.0, [0.0]
    while t[-1] < middle * (1.0 - NODE_ROUNDING_REL):
        density = MIN_INTERVALS / conditions.time_s
        for decay, most in fast:
            density = max(density, most * math.exp(-decay * t[-1]))
        t.append(t[-1] + 1.0 / density)
        if len(t) > MOST / 2:
            raise PlanError(
                f"time_s = {conditions.time_s} asks for more than {MOST} intervals; must be fewer for a numerical solver: {out}"
            )
    half = np.array(t) * (middle / t[-1])
    return np.concatenate([half[:-1], [middle], conditions.time_s - half[-2::-1]])


def through_nodes(
    t_s: FloatArray,
    position_m: FloatArray,
    speed_m_s: FloatArray,
    acceleration_m_s2: FloatArray,
    origin_m: float = 0.0,
) -> Trajectory:
    """Quintics that meet position (from origin_m), speed and acceleration at every node: (N+1,) each."""
    h = np.diff(t_s)
    y, v, a = position_m[:-1], speed_m_s[:-1], acceleration_m_s2[:-1]
    rise = (position_m[1:] - (y + h * (v + h * a / 2.0))) / h**3
    speed = (speed_m_s[1:] - (v + h * a)) / h**2
    push = (acceleration_m_s2[1:] - a) / h
    c3 = 10.0 * rise - 4.0 * speed + push / 2.0
    c4 = (-15.0 * rise + 7.0 * speed - push) / h
    c5 = (6.0 * rise - 3.0 * speed + push / 2.0) / h**2
    rows = np.column_stack([origin_m + y, v, a / 2.0, c3, c4, c5]).tolist()
    return Trajectory(
        tuple(ExpPolynomial(d, tuple(c)) for d, c in zip(h.tolist(), rows, strict=True))
    )


def checked_trajectory(
    problem: Problem, solved: Conditions, t_s: FloatArray, z: FloatArray, planner: str
) -> Trajectory:
    """The trajectory through z (2n, N+1), played on the load: it must bring it to the goal state.

    Raises NotConverged when it does not.
    """
    trajectory = through_nodes(t_s, z[0], z[1], solved.acceleration(z), solved.origin_m)
    model, n = problem.model, problem.model.links_count
    start, goal = solved.start[: 2 + 2 * n], solved.goal[: 2 + 2 * n]
    modes, left_s, pushes = model.modes(), *_pushes(trajectory)
    possible = float(np.abs(pushes).sum() + np.abs(modes.left_eigenvectors @ start[2:]).max())
    bound = (
        END_SWING * float(np.max(np.abs(modes.mode_shapes[:n]).sum(axis=1))) * possible + TINY_RAD
    )
    if problem.nonlinear:
        speeds = {"speed_before_m_s": float(start[1]), "speed_after_m_s": float(goal[1])}
        swing = replay(model, trajectory, angles_rad=start[2:3], rates_rad_s=start[3:4], **speeds)
        end = np.concatenate([swing.angle_rad[-1], swing.angular_velocity_rad_s[-1]])
    else:
        rates = modes.eigenvalues_1_s
        q = (
            np.exp(rates * solved.time_s) * (modes.left_eigenvectors @ start[2:])
            + np.exp(np.outer(rates, left_s)) @ pushes
        )
        end = (modes.mode_shapes @ q).real
    missed = model.amplitude_rad(*np.split(end - goal[2:], 2))
    if not missed <= bound:
        raise NotConverged(
            f"{planner} leaves the load {missed:.3g} rad beside its goal in time_s = {problem.time_s}; must be <= {bound:.3g} "
            f"rad: {solved.way_out}"
        )
    return trajectory


def _pushes(trajectory: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Time left and acceleration x time at four Gauss nodes a piece: (4 N,) each."""
    from numpy.polynomial.legendre import leggauss

    x, w = leggauss(4)
    halves = np.diff(trajectory.breaks_s)[:, None] / 2.0
    t = (trajectory.breaks_s[:-1, None] + halves * (1.0 + x)).ravel()
    return trajectory.duration_s - t, trajectory.at(t, 2) * (halves * w).ravel()
