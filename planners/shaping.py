"""Input shaping: a motion law convolved with a few impulses, timed so that their swings cancel."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import reduce
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from planners.errors import Infeasible, PlanError
from planners.laws import LAWS
from planners.models.pendulum import PendulumModel
from planners.pieces import FloatArray, Piece, add, polynomial
from planners.problem import Problem
from planners.trajectory import Trajectory

SLIVER = 1e-12  # of the duration; breaks closer than this are one


class Shaper(NamedTuple):
    """Impulses: amplitudes that sum to 1, and when they come."""

    amplitudes: FloatArray  # (n,)
    times_s: FloatArray  # (n,) from 0, increasing


def zv(model: PendulumModel) -> Shaper:
    """Zero vibration: two impulses half a damped period apart (Singer & Seering 1990)."""
    swing = model.swing_rate_1_s
    decay = math.exp(math.pi * swing.real / swing.imag)  # over half a period
    return Shaper(np.array([1.0, decay]) / (1.0 + decay), np.array([0.0, math.pi / swing.imag]))


SHAPERS: dict[str, Callable[[PendulumModel], Shaper]] = {"zv": zv}


def plan_shaped(name: str, problem: Problem) -> Trajectory:
    """The problem's law, shortened by the shaper's length and shaped: done at time_s, rest to rest.

    Raises Infeasible with the minimum time when time_s leaves the law no time, PlanError for ends that are not rest.
    """
    if not problem.rest_to_rest:
        raise PlanError(f"planner {name} from {problem.start_state} to {problem.goal_state}; must be rest to rest: "
                        "take matrix_exponential")  # fmt: skip
    shaper = SHAPERS[name](problem.model)
    length_s = float(shaper.times_s[-1])
    if problem.time_s <= length_s:
        raise Infeasible(
            f"time_s = {problem.time_s}; must be > {length_s:.6f}, the length of shaper {name}: lengthen the move",
            minimum_time_s=length_s,
        )
    law = LAWS[problem.law](problem.time_s - length_s)
    return shape(law, shaper).scaled(problem.distance_m).shifted(problem.start_m)


def shape(trajectory: Trajectory, shaper: Shaper) -> Trajectory:
    """Sum of delayed, scaled copies, as exact pieces; lasts the shaper's length longer."""
    starts = np.add.outer(shaper.times_s, trajectory.breaks_s)
    breaks = np.unique(starts)
    breaks = breaks[np.append(True, np.diff(breaks) > SLIVER * breaks[-1])]
    return Trajectory(tuple(_sum(_copies(trajectory, shaper, a, b)) for a, b in pairwise(breaks.tolist())))


def _copies(trajectory: Trajectory, shaper: Shaper, start_s: float, end_s: float) -> Iterable[Piece]:
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
