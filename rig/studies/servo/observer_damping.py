"""Ranges of the filter time constant in which an observer excites or damps the joint."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.servo.loops import PolePair
from rig.studies.servo.observer import ObserverTask

# a filter this much faster or slower than 1 / omega_z has reached its limit
TIME_CONSTANT_SPREAD = 1e4
GRID_POINTS = 800  # time constants between those limits
Interval = tuple[float, float]  # of time constants [s]; from 0 or to inf at the limits


class TimeConstantRanges(NamedTuple):
    """Time constants at which the rigid nominal model excites, and the best one."""

    excited: tuple[Interval, ...]  # less damped than the joint and Q, unstable ones included
    unstable: tuple[Interval, ...]
    best_s: float  # time constant with the largest least damping ratio
    best: PolePair  # least damped pair there


def least_damping(task: ObserverTask, time_constant_s: float) -> float:
    """Compute the least damping ratio with the rigid nominal model, Q included.

    1 without oscillation.
    """
    return task.design(task.rigid, time_constant_s).least_damped(task.joint).damping


def time_constant_ranges(task: ObserverTask) -> TimeConstantRanges:
    """Find the ranges in which the observer excites or is unstable, and the best time constant.

    Within 1 / omega_z / TIME_CONSTANT_SPREAD to TIME_CONSTANT_SPREAD / omega_z.
    """
    from scipy.optimize import minimize_scalar

    centre = -math.log(task.joint.antiresonance_rad_s)
    grid = np.linspace(
        centre - math.log(TIME_CONSTANT_SPREAD),
        centre + math.log(TIME_CONSTANT_SPREAD),
        GRID_POINTS,
    )
    found = np.array([least_damping(task, float(np.exp(x))) for x in grid])
    top = int(found.argmax())
    ends = grid[max(top - 1, 0)], grid[min(top + 1, GRID_POINTS - 1)]

    def loss(x: float) -> float:
        return -least_damping(task, float(np.exp(x)))

    best_s = float(np.exp(minimize_scalar(loss, bounds=ends, method="bounded").x))
    return TimeConstantRanges(
        excited=_below(task, task.excitation_limit, grid, found),
        unstable=_below(task, 0.0, grid, found),
        best_s=best_s,
        best=task.design(task.rigid, best_s).least_damped(task.joint),
    )


def _below(
    task: ObserverTask, level: float, grid: FloatArray, found: FloatArray
) -> tuple[Interval, ...]:
    """Find the intervals with a damping ratio below level.

    Between its crossings of the level; from 0 or to inf at the limits.
    """
    from scipy.optimize import brentq

    def excess(x: float) -> float:
        return least_damping(task, float(np.exp(x))) - level

    below = found < level
    crossings = np.flatnonzero(below[1:] != below[:-1])
    ends = [float(np.exp(brentq(excess, grid[k], grid[k + 1]))) for k in crossings]
    if below[0]:
        ends.insert(0, 0.0)
    if below[-1]:
        ends.append(math.inf)
    return tuple(zip(ends[::2], ends[1::2], strict=True))
