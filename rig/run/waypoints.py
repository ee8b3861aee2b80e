"""Waypoints: a CSV file in, times and positions out, and the plan through them."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from planners.errors import unknown_name
from planners.models.model import Model
from planners.problem import Limits, Plan, Problem
from planners.replay.metrics import measure
from planners.splines import SPLINES
from planners.splines.allocation import ALLOCATIONS, allocate
from planners.trajectories.motion import Motion
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory
from rig.errors import ConfigError
from rig.run.config import Experiment
from rig.run.toml_file import nearest, read_text

TIME = "t_s"
AXES = ("x_m", "y_m", "z_m")
COLUMNS = (TIME, *AXES)
START_TOLERANCE_M = 1e-6  # distance of the first point from the start, per axis
WAYPOINT_SAMPLE_S = 1e-3  # of the peaks over all axes


class Waypoints(NamedTuple):
    """Positions in the order of the path, with their times if the file has them."""

    times_s: FloatArray | None  # (N,) as in the file
    points_m: FloatArray  # (N, 3); an axis that the file leaves out is 0
    axes: tuple[str, ...]  # the columns the file has


def read_waypoints(path: Path) -> Waypoints:
    """Read a file with a header line and the column x_m; t_s, y_m, z_m are optional, in any order.

    Raises ConfigError naming file, line and column of an entry that is not a number, or an unknown
    column.
    """
    text = read_text(path, "waypoints").splitlines()
    kept = [k for k, line in enumerate(text) if line.strip() and not line.startswith("#")]
    rows = list(csv.reader(text[k] for k in kept))
    if len(rows) < 3:
        count = max(0, len(rows) - 1)
        raise ConfigError(
            f"waypoints '{path}': {count} points; "
            f"must be >= 2 below a header line {','.join(COLUMNS)}"
        )
    header = [name.strip() for name in rows[0]]
    _check_header(path, header)
    lines = [k + 1 for k in kept[1:]]
    entries = zip(rows[1:], lines, strict=True)
    table = np.array([_numbers(path, header, row, line) for row, line in entries])
    columns = dict(zip(header, table.T, strict=True))
    if TIME in columns:
        _check_times(path, columns[TIME], lines)
    points = np.column_stack([columns.get(axis, np.zeros(len(table))) for axis in AXES])
    return Waypoints(columns.get(TIME), points, tuple(axis for axis in AXES if axis in header))


def _check_header(path: Path, header: list[str]) -> None:
    for name in header:
        if name not in COLUMNS:
            raise ConfigError(
                f"waypoints '{path}': column {name!r}{nearest(name, COLUMNS)}; "
                f"must be of {', '.join(COLUMNS)}"
            )
    if "x_m" not in header or len(set(header)) < len(header):
        raise ConfigError(
            f"waypoints '{path}': columns {', '.join(header)}; must hold x_m, and each at most once"
        )


def _check_times(path: Path, times_s: FloatArray, lines: list[int]) -> None:
    falling = np.flatnonzero(np.diff(times_s) <= 0.0).tolist()
    if falling:
        k = falling[0]
        raise ConfigError(
            f"waypoints '{path}', line {lines[k + 1]}, {TIME}: "
            f"{times_s[k + 1]:g} after {times_s[k]:g}; must increase: correct that line"
        )


def plan_through(experiment: Experiment, waypoints: Waypoints, model: Model) -> Plan:
    """Plan a spline through the points on all axes.

    The swing of the plan is that along X, speed and acceleration are those in space. Raises
    ConfigError for a first point off the start, PlanError for points that no spline passes.
    """
    move = experiment.move
    limits = experiment.limits
    points = waypoints.points_m
    if move.spline not in SPLINES:
        raise unknown_name("spline", move.spline, SPLINES)
    offset_m = points[0] - [move.start_m, 0.0, 0.0]
    if np.abs(offset_m).max() > START_TOLERANCE_M:
        raise ConfigError(
            f"waypoints '{move.waypoints}': the first is at {points[0].tolist()} m; "
            f"must be at [{move.start_m}, 0, 0], where the robot stands ([move] start_m): "
            "begin there"
        )
    times = waypoints.times_s
    if times is None:
        durations = allocate(points, move.time_s, ALLOCATIONS[move.allocation])
        times = np.append(0.0, np.cumsum(durations))
    x, y, z = (_axis_trajectory(move.spline, times - times[0], column) for column in points.T)
    problem = Problem(
        start_m=move.start_m,
        distance_m=float(points[-1, 0]) - move.start_m,
        time_s=x.duration_s,
        model=model,
        limits=Limits(speed_m_s=limits.speed_m_s, acceleration_m_s2=limits.acceleration_m_s2),
    )
    motion = Motion(x, y, z)
    metrics = replace(
        measure(problem, x),
        peak_speed_m_s=_peak(motion, order=1),
        peak_acceleration_m_s2=_peak(motion, order=2),
    )
    return Plan(
        planner=move.spline, problem=problem, motion=motion, metrics=metrics, compute_s=None
    )


def _peak(motion: Motion, order: int) -> float:
    """Compute the largest magnitude in space of a derivative of the motion.

    The peak of a single axis is exact; that of the vector is taken from samples every 1 ms.
    """
    t = np.linspace(0.0, motion.duration_s, 2 + math.ceil(motion.duration_s / WAYPOINT_SAMPLE_S))
    single_axis = max(axis.peak(order).value for axis in (motion.x, motion.y, motion.z))
    return max(single_axis, float(np.linalg.norm(motion.at(t, order), axis=1).max()))


def _axis_trajectory(spline: str, times_s: FloatArray, points_m: FloatArray) -> Trajectory:
    if np.ptp(points_m) == 0.0:
        return Trajectory.hold(float(points_m[0]), float(times_s[-1] - times_s[0]))
    return SPLINES[spline](times_s, points_m)


def _numbers(path: Path, header: list[str], row: list[str], line: int) -> list[float]:
    if len(row) != len(header):
        raise ConfigError(
            f"waypoints '{path}', line {line}: {len(row)} entries; "
            f"must be {len(header)}, as in the header"
        )
    out = []
    for name, word in zip(header, row, strict=True):
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ConfigError(
                f"waypoints '{path}', line {line}, {name}: {word.strip()!r}; "
                "must be a finite number"
            )
        out.append(value)
    return out
