"""Input shaping: a motion law convolved with a few impulses, timed so that their swings cancel."""

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

MOST_IMPULSES = 600  # every copy of the law is a piece of every interval: this takes about a second
SLIVER = 1e-12  # of the duration; breaks closer than this are one
JOINT = {"zv_joint": 0, "zvd_joint": 1}  # derivatives of the swing by frequency that are 0 too
SHAPED = (*SHAPERS, *JOINT)  # every name that plan_shaped knows


def plan_shaped(name: str, problem: Problem) -> Trajectory:
    """The problem's law, shortened by the shaper's length and shaped: done at time_s, rest to rest.

    The shaper cancels the swing under a driven platform: one of SHAPERS for each mode, one after the other, or one of
    JOINT for all modes at once. Raises Infeasible with the minimum time when time_s leaves the law no time, PlanError for
    an unknown name and for what a shaper cannot do: ends that are not rest, robust, nonlinear, a force, an overdamped mode.
    """
    if name not in SHAPED:
        raise unknown_name("shaper", name, SHAPED)
    _check(name, problem)
    rates = problem.model.oscillatory_eigenvalues_1_s
    shaper = joint(rates, JOINT[name]) if name in JOINT else _cascade(name, rates)
    length_s = float(shaper.times_s[-1])
    if problem.time_s <= length_s:
        raise Infeasible(
            f"time_s = {problem.time_s}; must be > {length_s:.6f}, the length of shaper {name}{_half_periods(rates)}: "
            "lengthen the move",
            minimum_time_s=length_s,
        )
    law = LAWS[problem.law](problem.time_s - length_s)
    if problem.input == "jerk" and not law.continuous(2):
        raise PlanError(
            f"law = {problem.law!r} with input jerk; its acceleration must be continuous, as a shaped move is as smooth as "
            "its law: take cycloidal, quintic, modified_sine or another of class C2"
        )
    return shape(law, shaper).scaled(problem.distance_m).shifted(problem.start_m)


def _cascade(name: str, eigenvalues_1_s: Sequence[complex]) -> Shaper:
    each = [SHAPERS[name](rate) for rate in eigenvalues_1_s]
    impulses = math.prod(len(shaper.times_s) for shaper in each)
    if impulses > MOST_IMPULSES:
        raise PlanError(
            f"planner {name} on {len(each)} modes makes {impulses} impulses; must be <= {MOST_IMPULSES}: take zv_joint, "
            "or convolution with robust parameters"
        )
    return convolve(*each)


def _check(name: str, problem: Problem) -> None:
    if not problem.rest_to_rest:
        raise PlanError(f"planner {name} from {problem.start_state} to {problem.goal_state}; must be rest to rest: "
                        "take matrix_exponential")  # fmt: skip
    if problem.robust:
        raise PlanError(
            f"planner {name} with robust = {problem.robust}; must be (), as a shaper forgives errors of the frequency by "
            "itself: leave it out and take zvd, zvdd or ei"
        )
    if problem.nonlinear:
        raise PlanError(
            f"planner {name} with nonlinear = True; must be False, as shapers add up small swings: take collocation"
        )
    if problem.input == "force":
        raise PlanError(
            f"planner {name} with input force; must be acceleration or jerk, as a shaper acts on the position: "
            "leave --model at acceleration"
        )
    swinging, links = len(problem.model.oscillatory_eigenvalues_1_s), problem.model.links_count
    if swinging < links:
        raise PlanError(
            f"planner {name} for {links} modes of which {swinging} swing; all must, as no shaper cancels an overdamped one: "
            "take matrix_exponential"
        )


def _half_periods(eigenvalues_1_s: Sequence[complex]) -> str:
    """What explains the length when there are several modes."""
    if len(eigenvalues_1_s) == 1:
        return ""
    halves = [f"{math.pi / rate.imag:.6f}" for rate in eigenvalues_1_s]
    return f" (half periods {', '.join(halves[:-1])} and {halves[-1]} s)"


def shape(trajectory: Trajectory, shaper: Shaper) -> Trajectory:
    """Sum of delayed, scaled copies, as exact pieces; lasts the shaper's length longer."""
    starts = np.add.outer(shaper.times_s, trajectory.breaks_s)
    breaks = np.unique(starts)
    breaks = breaks[np.append(True, np.diff(breaks) > SLIVER * breaks[-1])]
    return Trajectory(
        tuple(_sum(_copies(trajectory, shaper, a, b)) for a, b in pairwise(breaks.tolist()))
    )


def _copies(
    trajectory: Trajectory, shaper: Shaper, start_s: float, end_s: float
) -> Iterable[Piece]:
    """Each copy's part of start_s..end_s, in which no copy has a joint."""
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
