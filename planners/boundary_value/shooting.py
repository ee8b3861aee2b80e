"""Minimum-energy move by single shooting: guess the costate at the start, integrate, correct by where it ends."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from planners.boundary_value.conditions import Conditions, conditions, linear_conditions
from planners.boundary_value.linear import linear_problem
from planners.boundary_value.nodes import Budget, checked_trajectory, graded_grid
from planners.errors import NotConverged
from planners.problem import Problem
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

RELATIVE, ABSOLUTE = 1e-11, 1e-13  # of the integration, in sizes
AIM = 1e-10  # of the end state, in sizes
MISS = 1e-8  # what the integration's own error may leave of it
AMPLIFIED = 1e8  # times rounding, 2e-16 of a size, is still a good end
ROUNDS = 10  # of Newton
DIVERGED_SCALES = 100.0  # sizes: a shot at the true pendulum that gets there has missed
SHORTEST_STEP = 0.2  # share of a Newton step: shorter ones only crawl
MOST_WORK = 6e4  # evaluations of the slope over all shots, 14 us each; the source's tables take 5e3
TRUE = 4.0  # times dearer is the true pendulum's
DEAR = 25  # states from which an evaluation costs the cube of their number


def plan_shooting(problem: Problem) -> Trajectory:
    """min 1/2 int (x'Qx + r u^2) dt as source 004, section 2.1, shoots it: Newton on the initial costate.

    State, costate and their derivatives by the initial costate run through DOP853; a linear problem is met by the first
    correction. Rounding grows with the flow, as exp(|Re rate| T), so no single shot hits with a filter or a damper much
    faster than the move. Raises NotConverged where that exceeds 1e8, as for a jerk model beyond T/lag = 18, or where Newton
    misses the goal, as for the true pendulum in moves below half its period, or where its work runs out, as for a move of 80
    periods; PlanError for a nonlinear problem these conditions do not cover.
    """
    asked = conditions(problem)
    _check_growth(asked)
    t_s, n = graded_grid(asked), len(asked.start)
    costate, work = np.zeros(n), Budget("shooting", MOST_WORK, _way_out(asked))
    if not asked.linear:
        linear = replace(linear_conditions(linear_problem(problem)), way_out=_way_out(asked))
        costate = _aim(linear, costate, work)
    costate = _aim(asked, costate, work)
    begin = np.concatenate([asked.start, costate])
    z = _integrate(asked, begin / asked.sizes, t_s, work) * asked.sizes[:, None]
    z[:n, -1] = asked.goal  # MISS is left of it
    return checked_trajectory(problem, asked, t_s, z, "shooting")


def _check_growth(asked: Conditions) -> None:
    exponent = float(np.abs(asked.eigenvalues_1_s.real).max()) * asked.time_s
    if exponent > math.log(AMPLIFIED):
        raise NotConverged(
            f"shooting amplifies rounding exp({exponent:.4g}) times in time_s = {asked.time_s}; must be <= {AMPLIFIED:g}, or "
            f"no initial costate hits the goal: {_way_out(asked)}"
        )


def _aim(asked: Conditions, costate: FloatArray, work: Budget) -> FloatArray:
    """The initial costate (n,) that ends in the goal, by Newton with halved steps from a guess."""
    n, size = len(asked.start), asked.sizes
    begin = np.concatenate([asked.start, costate]) / size
    miss, slope = _shot(asked, begin, work)
    for _ in range(ROUNDS):
        if np.abs(miss).max() <= AIM or not np.isfinite(miss).all():
            break
        try:
            step, share = np.concatenate([np.zeros(n), np.linalg.solve(slope, -miss)]), 1.0
        except np.linalg.LinAlgError:
            break
        there, slope = _shot(asked, begin + step, work)
        while (
            not np.linalg.norm(there) <= (1.0 - share / 4.0) * np.linalg.norm(miss)
            and share > SHORTEST_STEP
        ):
            share /= 2.0
            there, slope = _shot(asked, begin + share * step, work)
        if share <= SHORTEST_STEP:
            break
        begin, miss = begin + share * step, there
    if np.abs(miss).max() <= MISS:
        return begin[n:] * size[n:]
    raise NotConverged(
        f"shooting still misses the goal by {np.abs(miss).max():.3g} of its size in time_s = {asked.time_s}; must be <= "
        f"{MISS:g}: {_way_out(asked)}"
    )


def _way_out(asked: Conditions) -> str:
    return asked.way_out if asked.linear else f"{asked.way_out}, or try finite_differences"


def _shot(asked: Conditions, begin: FloatArray, work: Budget) -> tuple[FloatArray, FloatArray]:
    """By how much the shot from begin (2n,) misses the goal, (n,), and its slope by the initial costate, (n, n); in sizes."""
    from scipy.integrate import solve_ivp

    n, size = len(asked.start), asked.sizes
    ratio = size / size[:, None]
    cost = 1.0 + (n / DEAR) ** 3 if asked.linear else TRUE

    def slope(_: float, flat: FloatArray) -> FloatArray:
        work.spend(cost)
        columns = flat.reshape(2 * n, n + 1)
        z = columns[:, :1] * size[:, None]
        return np.hstack(
            [asked.slope(z) / size[:, None], (asked.jacobian(z)[:, :, 0] * ratio) @ columns[:, 1:]]
        ).ravel()

    def lost(_: float, flat: FloatArray) -> float:
        return DIVERGED_SCALES - float(np.abs(flat[: n * (n + 1) : n + 1]).max())

    lost.terminal = True  # type: ignore[attr-defined]
    first = np.column_stack([begin, np.eye(2 * n)[:, n:]]).ravel()
    done = solve_ivp(
        slope,
        (0.0, asked.time_s),
        first,
        "DOP853",
        rtol=RELATIVE,
        atol=ABSOLUTE,
        events=None if asked.linear else lost,
    )
    if done.status != 0:
        return np.full(n, np.inf), np.eye(n)
    last = done.y[:, -1].reshape(2 * n, n + 1)[:n]
    return last[:, 0] - asked.goal / size[:n], last[:, 1:]


def _integrate(asked: Conditions, begin: FloatArray, t_s: FloatArray, work: Budget) -> FloatArray:
    """State and costate along the way: (2n, N+1), in sizes."""
    from scipy.integrate import solve_ivp

    size = asked.sizes

    def slope(_: float, z: FloatArray) -> FloatArray:
        work.spend(1.0 if asked.linear else TRUE)
        return asked.slope((z * size)[:, None])[:, 0] / size

    span = (0.0, asked.time_s)
    return np.asarray(
        solve_ivp(slope, span, begin, "DOP853", t_eval=t_s, rtol=RELATIVE, atol=ABSOLUTE).y
    )
