"""Points to pass: a CSV file in, times and places out."""

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

TIME, AXES = "t_s", ("x_m", "y_m", "z_m")
COLUMNS = (TIME, *AXES)
SAME_PLACE_M = 1e-6
WAYPOINT_SAMPLE_S = 1e-3


class Waypoints(NamedTuple):
    """Places in the order they are passed, with their times when the file names them."""

    times_s: FloatArray | None  # (N,) as in the file
    points_m: FloatArray  # (N, 3); an axis the file leaves out stays at 0
    axes: tuple[str, ...]  # the columns the file has


def read_waypoints(path: Path) -> Waypoints:
    """A file with a header line and columns x_m, and if wanted t_s, y_m, z_m, in any order.

    Raises ConfigError naming file, line and column of what is no number, or a column that is unknown.
    """
    text = read_text(path, "waypoints").splitlines()
    kept = [k for k, line in enumerate(text) if line.strip() and not line.startswith("#")]
    rows = list(csv.reader(text[k] for k in kept))
    if len(rows) < 3:
        count = max(0, len(rows) - 1)
        raise ConfigError(
            f"waypoints '{path}': {count} points; must be >= 2 below a header line {','.join(COLUMNS)}"
        )
    header = [name.strip() for name in rows[0]]
    for name in header:
        if name not in COLUMNS:
            raise ConfigError(
                f"waypoints '{path}': column {name!r}{nearest(name, COLUMNS)}; must be of {', '.join(COLUMNS)}"
            )
    if "x_m" not in header or len(set(header)) < len(header):
        raise ConfigError(
            f"waypoints '{path}': columns {', '.join(header)}; must hold x_m, and each at most once"
        )
    lines = [k + 1 for k in kept[1:]]
    table = np.array(
        [_numbers(path, header, row, line) for row, line in zip(rows[1:], lines, strict=True)]
    )
    columns = dict(zip(header, table.T, strict=True))
    if TIME in columns:
        _check_times(path, columns[TIME], lines)
    points = np.column_stack([columns.get(axis, np.zeros(len(table))) for axis in AXES])
    return Waypoints(columns.get(TIME), points, tuple(axis for axis in AXES if axis in header))


def _check_times(path: Path, times_s: FloatArray, lines: list[int]) -> None:
    for k in np.flatnonzero(np.diff(times_s) <= 0.0).tolist():
        raise ConfigError(
            f"waypoints '{path}', line {lines[k + 1]}, {TIME}: {times_s[k + 1]:g} after {times_s[k]:g}; must increase: mend it"
        )


def plan_through(experiment: Experiment, waypoints: Waypoints, model: Model) -> Plan:
    """A spline through the points, all axes at once; swing is measured along X, speed and acceleration in space.

    Raises ConfigError for a first point away from the start, PlanError for points no spline passes.
    """
    move, limits, points = experiment.move, experiment.limits, waypoints.points_m
    if move.spline not in SPLINES:
        raise unknown_name("spline", move.spline, SPLINES)
    away = points[0] - [move.start_m, 0.0, 0.0]
    if np.abs(away).max() > SAME_PLACE_M:
        raise ConfigError(
            f"waypoints '{move.waypoints}': the first is at {points[0].tolist()} m; must be at [{move.start_m}, 0, 0], "
            "where the robot stands ([move] start_m): begin there"
        )
    times = waypoints.times_s
    if times is None:
        durations = allocate(points, move.time_s, ALLOCATIONS[move.allocation])
        times = np.append(0.0, np.cumsum(durations))
    x, y, z = (_axis(move.spline, times - times[0], column) for column in points.T)
    problem = Problem(
        start_m=move.start_m,
        distance_m=float(points[-1, 0]) - move.start_m,
        time_s=x.duration_s,
        model=model,
        limits=Limits(speed_m_s=limits.speed_m_s, acceleration_m_s2=limits.acceleration_m_s2),
    )
    motion = Motion(x, y, z)
    speed, acceleration = (_peak(motion, order) for order in (1, 2))
    metrics = replace(
        measure(problem, x), peak_speed_m_s=speed, peak_acceleration_m_s2=acceleration
    )
    return Plan(
        planner=move.spline, problem=problem, motion=motion, metrics=metrics, compute_s=None
    )


def _peak(motion: Motion, order: int) -> float:
    """Largest size in space: that of each axis is exact, that of all together is read every millisecond."""
    t = np.linspace(0.0, motion.duration_s, 2 + math.ceil(motion.duration_s / WAYPOINT_SAMPLE_S))
    alone = max(axis.peak(order).value for axis in (motion.x, motion.y, motion.z))
    return max(alone, float(np.linalg.norm(motion.at(t, order), axis=1).max()))


def _axis(spline: str, times_s: FloatArray, points_m: FloatArray) -> Trajectory:
    if np.ptp(points_m) == 0.0:
        return Trajectory.hold(float(points_m[0]), float(times_s[-1] - times_s[0]))
    return SPLINES[spline](times_s, points_m)


def _numbers(path: Path, header: list[str], row: list[str], line: int) -> list[float]:
    if len(row) != len(header):
        raise ConfigError(
            f"waypoints '{path}', line {line}: {len(row)} entries; must be {len(header)}, as in the header"
        )
    out = []
    for name, word in zip(header, row, strict=True):
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ConfigError(
                f"waypoints '{path}', line {line}, {name}: {word.strip()!r}; must be a finite number"
            )
        out.append(value)
    return out
