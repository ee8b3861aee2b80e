"""Input shaping: a motion law convolved with the impulses of a shaper."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import reduce
from itertools import pairwise

import numpy as np

from planners.errors import Infeasible, PlanError, unknown_name
from planners.laws import LAWS
from planners.problem import Problem
from planners.shapers import SHAPERS, Shaper, convolve, joint
from planners.trajectories.pieces import Piece, add, polynomial
from planners.trajectories.trajectory import Trajectory

MAX_IMPULSES = 600  # every copy of the law adds a piece to every interval: takes about a second
MIN_INTERVAL_REL = 1e-12  # of the duration; breaks closer than this are merged
JOINT = {"zv_joint": 0, "zvd_joint": 1}  # derivatives of V by frequency that are 0 too
SHAPED = (*SHAPERS, *JOINT)  # all names of plan_shaped


def plan_shaped(name: str, problem: Problem) -> Trajectory:
    """Convolve the problem's law with a shaper: from rest to rest in time_s.

    The law is shorter than time_s by the length of the shaper. The shaper cancels the swing under a
    driven platform: one of SHAPERS for each mode, convolved, or one of JOINT for all modes at once.
    Raises Infeasible with the minimum time when time_s leaves no time for the law, PlanError for an
    unknown name and for problems that a shaper does not solve: ends that are not at rest, robust,
    nonlinear, a force as input, an overdamped mode.
    """
    if name not in SHAPED:
        raise unknown_name("shaper", name, SHAPED)
    _check(name, problem)
    eigenvalues = problem.model.oscillatory_eigenvalues_1_s
    shaper = joint(eigenvalues, JOINT[name]) if name in JOINT else _cascade(name, eigenvalues)
    length_s = float(shaper.times_s[-1])
    if problem.time_s <= length_s:
        raise Infeasible(
            f"time_s = {problem.time_s}; must be > {length_s:.6f}, the length of shaper "
            f"{name}{_half_periods(eigenvalues)}: lengthen the move",
            minimum_time_s=length_s,
        )
    law = LAWS[problem.law](problem.time_s - length_s)
    if problem.input == "jerk" and not law.continuous(2):
        raise PlanError(
            f"law = {problem.law!r} with input jerk; its acceleration must be continuous, as a "
            "shaped move is as smooth as its law: "
            "take cycloidal, quintic, modified_sine or another of class C2"
        )
    return shape(law, shaper).scaled(problem.distance_m).shifted(problem.start_m)


def _cascade(name: str, eigenvalues_1_s: Sequence[complex]) -> Shaper:
    each = [SHAPERS[name](eigenvalue) for eigenvalue in eigenvalues_1_s]
    impulses = math.prod(len(shaper.times_s) for shaper in each)
    if impulses > MAX_IMPULSES:
        raise PlanError(
            f"planner {name} on {len(each)} modes makes {impulses} impulses; "
            f"must be <= {MAX_IMPULSES}: take zv_joint, or convolution with robust parameters"
        )
    return convolve(*each)


def _check(name: str, problem: Problem) -> None:
    if not problem.rest_to_rest:
        raise PlanError(
            f"planner {name} from {problem.start_state} to {problem.goal_state}; "
            "must be rest to rest: take matrix_exponential"
        )
    if problem.robust:
        raise PlanError(
            f"planner {name} with robust = {problem.robust}; must be (), as the insensitivity of a "
            "shaper to frequency errors follows from its name: "
            "leave it out and take zvd, zvdd or ei"
        )
    if problem.nonlinear:
        raise PlanError(
            f"planner {name} with nonlinear = True; must be False, as shapers superpose small "
            "swings: take collocation"
        )
    if problem.input == "force":
        raise PlanError(
            f"planner {name} with input = 'force'; must be acceleration or jerk, as a shaper acts "
            "on the position: take acceleration as input"
        )
    oscillatory = len(problem.model.oscillatory_eigenvalues_1_s)
    links = problem.model.links_count
    if oscillatory < links:
        raise PlanError(
            f"planner {name} for {links} modes of which {oscillatory} oscillate; all must, as no "
            "shaper cancels an overdamped one: take matrix_exponential"
        )


def _half_periods(eigenvalues_1_s: Sequence[complex]) -> str:
    """List the half periods of several modes, which explain the length of the shaper."""
    if len(eigenvalues_1_s) == 1:
        return ""
    halves = [f"{math.pi / eigenvalue.imag:.6f}" for eigenvalue in eigenvalues_1_s]
    return f" (half periods {', '.join(halves[:-1])} and {halves[-1]} s)"


def shape(trajectory: Trajectory, shaper: Shaper) -> Trajectory:
    """Convolve a trajectory with a shaper: the exact sum of delayed, scaled copies.

    It lasts longer by the length of the shaper.
    """
    starts = np.add.outer(shaper.times_s, trajectory.breaks_s)
    breaks = np.unique(starts)
    breaks = breaks[np.append(True, np.diff(breaks) > MIN_INTERVAL_REL * breaks[-1])]
    return Trajectory(
        tuple(_sum(_copies(trajectory, shaper, a, b)) for a, b in pairwise(breaks.tolist()))
    )


def _copies(
    trajectory: Trajectory, shaper: Shaper, start_s: float, end_s: float
) -> Iterable[Piece]:
    """Cut each copy's part of start_s..end_s, an interval without a joint of any copy."""
    for amplitude, delay in zip(shaper.amplitudes.tolist(), shaper.times_s.tolist(), strict=True):
        k = int(np.searchsorted(trajectory.breaks_s, (start_s + end_s) / 2 - delay)) - 1
        if 0 <= k < len(trajectory.pieces):
            begin = max(0.0, start_s - delay - float(trajectory.breaks_s[k]))
            yield trajectory.pieces[k].window(begin, end_s - start_s).scaled(amplitude)
        else:
            held = float(trajectory.at(start_s - delay if k < 0 else end_s - delay))
            yield polynomial(end_s - start_s, (amplitude * held,))


def _sum(pieces: Iterable[Piece]) -> Piece:
    return reduce(add, pieces)
