"""Tables, JSON document and CSV file of `rig spline`."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.table import Table

from planners.splines.analysis import NAMES, SplineAnalysis
from planners.splines.limits import LIMIT_NAMES, AxisLimits
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory
from rig.errors import ConfigError
from rig.run.waypoints import AXES, Waypoints
from rig.ui.cli.page import Column, plain_table, print_paragraph

UNBOUNDED = {  # by continuity: derivative that is not bounded, which the table does not show
    "C0": ", steps in speed, perhaps at an end: acceleration not bounded",
    "C1": ", steps in acceleration, perhaps at an end: jerk not bounded",
}
COLUMNS = (
    "axis",
    "quantity",
    "minimum",
    "maximum",
    "peak",
    Column("at [s]", drop=2),
    Column("interval", drop=1),
    Column("rms", drop=3),
)
UNITS = ("m", "m/s", "m/s²", "m/s³")
TABLE_SAMPLE_S = 0.01
MAX_ROWS = 1_000_000  # of a CSV file
MAX_INTERVALS_SHOWN = 12
SAMPLE_ROUNDING_REL = 1e-9  # of a sample
SHOWN_AS_ZERO_REL = 1e-12  # of a peak: rounding, shown as 0
MAX_CONTINUITY = 4  # highest continuous derivative that is determined


class PassageTimes(NamedTuple):
    """Instants at which the points are passed, and their origin."""

    times_s: FloatArray  # (N,) from 0
    how: str
    # duration of the scaled allocation, when a shorter one was searched
    allocated_s: float | None = None
    reached: dict[str, float] | None = None  # used share of each limit


def axis_positions(points: Waypoints) -> Iterator[tuple[str, FloatArray]]:
    """Iterate over name and positions (N,) [m] of every axis of the file."""
    for column in points.axes:
        yield column.removesuffix("_m"), points.points_m[:, AXES.index(column)]


def _continuity(path: Trajectory) -> str:
    """Determine the continuity class Cn: derivatives up to n have no step, at the ends either.

    A speed other than 0 at an end gives C0.
    """
    order = 0
    while order < MAX_CONTINUITY and path.continuous(order + 1):
        order += 1
    return f"C{order}"


def step_violations(path: Trajectory, limits: AxisLimits) -> Iterator[str]:
    """Describe limits exceeded by a step of the derivative below, not visible in a range."""
    for order, name in LIMIT_NAMES.items():
        if math.isfinite(limits.peak_limit(order)) and not path.continuous(order - 1):
            yield (
                f"|{name}| is without bound where {NAMES[order - 1]} steps, perhaps at an end; "
                f"must be <= {limits.peak_limit(order):.6g}: take a smoother kind, b_spline_5 say"
            )


def _largest_deviation_m(path: Trajectory, times_s: FloatArray, points_m: FloatArray) -> float:
    """Compute the largest distance of a point from the path at the instant of the point [m]."""
    return float(np.abs(path.at(times_s) - points_m).max())


def document(
    kind: str,
    points: Waypoints,
    timing: PassageTimes,
    paths: Mapping[str, Trajectory],
    found: Mapping[str, SplineAnalysis],
    warnings: Sequence[str],
) -> dict[str, object]:
    """Create the JSON document of a motion through points."""
    axes = {}
    for axis, row in axis_positions(points):
        axes[axis] = {
            "continuity": _continuity(paths[axis]),
            "largest_miss_m": _largest_deviation_m(paths[axis], timing.times_s, row),
            **{name: getattr(found[axis], name)._asdict() for name in NAMES},
        }
    return {
        "kind": kind,
        "points": timing.times_s.size,
        "duration_s": float(timing.times_s[-1]),
        "timing": timing.how,
        "times_s": timing.times_s.tolist(),
        "intervals_s": np.diff(timing.times_s).tolist(),
        "allocated_duration_s": timing.allocated_s,
        "limits_reached": timing.reached,
        "axes": axes,
        "warnings": warnings,
    }


def range_table(kind: str, timing: PassageTimes, found: Mapping[str, SplineAnalysis]) -> Table:
    """Create the table of minimum, maximum, peak and rms of position to jerk."""
    count = timing.times_s.size
    title = f"{kind} through {count} points in {timing.times_s[-1]:.6f} s, {timing.how}"
    view = plain_table(title, COLUMNS, left=2)
    for axis, analysis in found.items():
        for name, unit in zip(NAMES, UNITS, strict=True):
            r = getattr(analysis, name)
            word = name.split("_")[0]
            view.add_row(
                axis,
                f"{word} [{unit}]",
                _number(r.low, r.peak),
                _number(r.high, r.peak),
                _number(r.peak, r.peak),
                f"{r.peak_t_s:.6g}",
                str(r.interval),
                f"{r.rms:.6g}",
                end_section=word == "jerk",
            )
    return view


def _number(value: float, peak: float) -> str:
    shown = value if abs(value) > SHOWN_AS_ZERO_REL * peak else 0.0
    return f"{shown:.6g}"


def print_remarks(
    points: Waypoints,
    timing: PassageTimes,
    paths: Mapping[str, Trajectory],
    warnings: Sequence[str],
    *,
    is_blended: bool,
) -> None:
    """Print intervals, used limits, continuity and exceeded limits."""
    intervals_s = np.diff(timing.times_s)[:MAX_INTERVALS_SHOWN].tolist()
    intervals = ", ".join(f"{interval_s:.6g}" for interval_s in intervals_s)
    more = ", ..." if timing.times_s.size > MAX_INTERVALS_SHOWN + 1 else ""
    print_paragraph(f"intervals: {intervals}{more} s", indent="  ")
    if timing.allocated_s is not None and timing.reached is not None:
        shares = ", ".join(
            f"{share:.2%} of {name.split('_')[0]}" for name, share in timing.reached.items()
        )
        print_paragraph(
            f"used share of the limits: {shares}; "
            f"duration of the scaled allocation: {timing.allocated_s:.6f} s",
            indent="  ",
        )
    for axis, row in axis_positions(points):
        continuity = _continuity(paths[axis])
        deviation = ""
        if is_blended:
            deviation_m = _largest_deviation_m(paths[axis], timing.times_s, row)
            deviation = f"; largest deviation from a point {deviation_m:.6g} m"
        line = f"{axis}: {continuity}{UNBOUNDED.get(continuity, '')}{deviation}"
        print_paragraph(line, indent="  ")
    for warning in warnings:
        print_paragraph(f"over limits: {warning}", "yellow", "  ")


def write_csv(paths: Mapping[str, Trajectory], file: Path) -> None:
    """Write position to jerk of every axis every TABLE_SAMPLE_S; raises ConfigError, OSError."""
    end_s = max(path.duration_s for path in paths.values())
    if end_s > MAX_ROWS * TABLE_SAMPLE_S:
        raise ConfigError(
            f"--csv of {end_s:g} s every {TABLE_SAMPLE_S:g} s; must be <= {MAX_ROWS} rows: "
            "give a shorter --time"
        )
    count = math.ceil(end_s / TABLE_SAMPLE_S - SAMPLE_ROUNDING_REL) + 1
    t = np.minimum(TABLE_SAMPLE_S * np.arange(count), end_s)
    head = [f"{axis}_{unit}" for axis in paths for unit in ("m", "m_s", "m_s2", "m_s3")]
    columns = [t]
    for path in paths.values():
        columns.extend(path.at(t, order) for order in range(4))
    with file.open("w", newline="") as target:
        rows = csv.writer(target)
        rows.writerow(["t_s", *head])
        for row in np.column_stack(columns):
            rows.writerow([f"{value:.9g}" for value in row])
