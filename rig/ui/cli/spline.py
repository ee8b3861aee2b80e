"""`rig spline`: motion through points, checked against limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from planners.errors import unknown_name
from planners.splines import SPLINES
from planners.splines.allocation import ALLOCATIONS, allocate
from planners.splines.analysis import analyse
from planners.splines.blends import parabolic_blends
from planners.splines.limits import LIMIT_NAMES, AxisLimits
from planners.splines.minimum_time import SHAPES, minimum_time
from planners.trajectories.operations import within_limits
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory
from rig.errors import REFUSED, ConfigError
from rig.run.waypoints import Waypoints, read_waypoints
from rig.ui.cli import spline_tables as tables
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json, working
from rig.ui.cli.page import print_table, print_written
from rig.ui.cli.spline_tables import PassageTimes, axis_positions
from rig.ui.plots import picture_file

BLENDS = "blends"
KINDS = (*SPLINES, BLENDS)
# value of --allocation: name of the planner's allocation
ALLOCATION_NAMES = {**{name: name for name in ALLOCATIONS}, "sqrt": "root"}
SLOW_POINTS = 10  # the search through fewer points takes less than 2 s
MAX_SEARCHED_POINTS = {  # of the search for the minimum time, which takes 30 s with so many
    "cubic": 80,
    "four_three_four": 80,
    "b_spline_4": 25,
    "b_spline_5": 25,
}


def spline(
    file: Annotated[
        Path,
        typer.Argument(
            help="CSV file of the points; columns t_s (optional), x_m, y_m, z_m.",
            metavar="POINTS.csv",
        ),
    ],
    kind: Annotated[str, typer.Option(help=f"Spline: {', '.join(KINDS)}.")] = "b_spline_5",
    allocation: Annotated[
        str,
        typer.Option(
            help="Division of the time into intervals, for a file without times: equal, "
            "proportional to the distance, or to its sqrt.",
        ),
    ] = "sqrt",
    time: Annotated[
        float | None, typer.Option(help="Total time \\[s], for a file without times.")
    ] = None,
    retime: Annotated[bool, typer.Option("--retime", help="Ignore the times in the file.")] = False,
    vmax: Annotated[
        float | None,
        typer.Option(help="Speed limit \\[m/s]; limits without times give the minimum total time."),
    ] = None,
    amax: Annotated[
        float | None,
        typer.Option(help="Acceleration limit \\[m/s²]; acceleration of --kind blends."),
    ] = None,
    jmax: Annotated[
        float | None, typer.Option(help="Jerk limit \\[m/s³]; unlimited by default.")
    ] = None,
    position_min: Annotated[
        float | None,
        typer.Option(help="Minimum position of every axis \\[m]; unlimited by default."),
    ] = None,
    position_max: Annotated[
        float | None,
        typer.Option(help="Maximum position of every axis \\[m]; unlimited by default."),
    ] = None,
    csv_file: Annotated[
        Path | None,
        typer.Option("--csv", help="CSV file: position to jerk of every axis every 10 ms."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Figure file of the motion: .svg, .png or .pdf.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Plan a motion through points along X, Y and Z and check it against limits.

    The motion is from rest to rest, except for natural, periodic and n_point. The times come
    from the file, or from --time and --allocation, or are the minimum within the limits.
    Exit code 3 when a limit is exceeded.
    """
    for what, name, known in (
        ("--kind", kind, KINDS),
        ("--allocation", allocation, ALLOCATION_NAMES),
    ):
        if name not in known:
            raise unknown_name(what, name, known)
    limits = AxisLimits(
        speed_m_s=math.inf if vmax is None else vmax,
        acceleration_m_s2=math.inf if amax is None else amax,
        jerk_m_s3=math.inf if jmax is None else jmax,
        position_min_m=-math.inf if position_min is None else position_min,
        position_max_m=math.inf if position_max is None else position_max,
    )
    if csv_file is not None:
        picture_file.check_folder("--csv", csv_file)
    if plot is not None:
        picture_file.check(plot)
    points = read_waypoints(file)
    interpolate = _interpolation(kind, limits)
    with working(
        f"minimum time through {len(points.points_m)} points",
        quiet=len(points.points_m) < SLOW_POINTS,
    ):
        timing = _timing(points, kind, allocation, limits, time, retime)
    paths = {axis: _path(interpolate, timing.times_s, row) for axis, row in axis_positions(points)}
    found = {axis: analyse(path, timing.times_s, limits) for axis, path in paths.items()}
    warnings: list[str] = []
    for axis, path in paths.items():
        texts = (*found[axis].warnings, *tables.step_violations(path, limits))
        warnings.extend(f"{axis}: {text}" for text in texts)
    if csv_file is not None:
        tables.write_csv(paths, csv_file)
    if plot is not None:
        from rig.ui.plots.laws import draw_motion  # matplotlib is slow to import

        count = timing.times_s.size
        title = f"{kind} through {count} points in {timing.times_s[-1]:.6g} s, {timing.how}"
        picture_file.save(draw_motion(paths, timing.times_s, limits, title), plot)
    if as_json:
        print_json(tables.document(kind, points, timing, paths, found, warnings))
    else:
        print_table(tables.range_table(kind, timing, found))
        tables.print_remarks(points, timing, paths, warnings, is_blended=kind == BLENDS)
        print_written(csv_file, plot)
    return REFUSED if warnings else 0


def _interpolation(kind: str, limits: AxisLimits) -> Callable[[FloatArray, FloatArray], Trajectory]:
    """Look up the function (times_s, points_m) -> trajectory of a kind; raises ConfigError."""
    if kind != BLENDS:
        return SPLINES[kind]
    if not math.isfinite(limits.acceleration_m_s2):
        raise ConfigError(
            "--kind blends without --amax; must be with the acceleration of its parabolas: "
            "give it in m/s²"
        )
    return lambda times, points: (
        parabolic_blends(times, points, limits.acceleration_m_s2).trajectory
    )


def _path(
    interpolate: Callable[[FloatArray, FloatArray], Trajectory],
    times_s: FloatArray,
    points_m: FloatArray,
) -> Trajectory:
    """Compute the trajectory of one axis through its points, which may all be equal."""
    if np.ptp(points_m) == 0.0:
        return Trajectory.hold(float(points_m[0]), float(times_s[-1]))
    return interpolate(times_s, points_m)


def _timing(
    points: Waypoints,
    kind: str,
    allocation: str,
    limits: AxisLimits,
    total_s: float | None,
    retime: bool,
) -> PassageTimes:
    """Take the times of the file, divide the total time, or find the minimum time.

    Raises ConfigError for times that are given twice or not at all.
    """
    if points.times_s is not None and not retime:
        if total_s is not None:
            raise ConfigError(
                f"--time {total_s:g} with a column t_s; must be one of the two: "
                "add --retime to ignore the column"
            )
        return PassageTimes(points.times_s - points.times_s[0], "at the file's times")
    start = ALLOCATION_NAMES[allocation]
    if total_s is not None:
        durations_s = allocate(points.points_m, total_s, ALLOCATIONS[start])
        return PassageTimes(_from_zero(durations_s), f"{allocation} shares")
    bounds = {name: getattr(limits, name) for name in LIMIT_NAMES.values()}
    if kind == BLENDS or not any(map(math.isfinite, bounds.values())):
        other = (
            "" if kind == BLENDS else ", or a limit for the minimum time: --vmax, --amax, --jmax"
        )
        raise ConfigError(
            f"the points have no times for --kind {kind}; "
            f"must be given by t_s in the file, or --time{other}: give one"
        )
    shares = _from_zero(allocate(points.points_m, 1.0, ALLOCATIONS[start]))
    searched = kind in SHAPES and shares.size > 2
    if searched and shares.size > MAX_SEARCHED_POINTS[kind]:
        raise ConfigError(
            f"minimum time through {shares.size} points by --kind {kind}; "
            f"must be <= {MAX_SEARCHED_POINTS[kind]} points, more take minutes: "
            "give --time, or take cubic or four_three_four"
        )
    least = minimum_time(kind, points.points_m, limits, starts=(start,)) if searched else None
    moving = [row for row in points.points_m.T if np.ptp(row)]
    scaled = [within_limits(SPLINES[kind](shares, row), **bounds) for row in moving]
    allocated_s = max((path.duration_s for path in scaled), default=1.0)
    if least is None:
        return PassageTimes(
            shares * allocated_s, f"{allocation} shares, as fast as the limits allow"
        )
    return PassageTimes(
        least.times_s, "the least time within the limits", allocated_s, least.reached
    )


def _from_zero(durations_s: FloatArray) -> FloatArray:
    """Add up durations to instants from 0 on."""
    return np.concatenate([[0.0], np.cumsum(durations_s)])
