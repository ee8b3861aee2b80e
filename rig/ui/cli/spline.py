"""`rig spline`: a motion through points: its times, what it asks of every axis, and the limits it breaks."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from rich.table import Table

from planners.errors import unknown_name
from planners.splines import SPLINES
from planners.splines.allocation import ALLOCATIONS, allocate
from planners.splines.analysis import NAMES, SplineAnalysis, analyse
from planners.splines.blends import parabolic_blends
from planners.splines.limits import LIMIT_NAMES, AxisLimits
from planners.splines.minimum_time import SHAPES, minimum_time
from planners.trajectories.operations import within_limits
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory
from rig.errors import REFUSED, ConfigError
from rig.run.waypoints import AXES, Waypoints, read_waypoints
from rig.ui.cli.output import out, print_json, wide, working
from rig.ui.plots import picture_file

BLENDS = "blends"
KINDS = (*SPLINES, BLENDS)
SHARES = {
    **{name: name for name in ALLOCATIONS},
    "sqrt": "root",
}  # what may be said: planners' name
STEPS = {  # what the rows of a table leave out
    "C0": ", its speed steps, at an end perhaps: an acceleration without bound",
    "C1": ", its acceleration steps, at an end perhaps: a jerk without bound",
}
TABLE_SAMPLE_S = 0.01
MOST_ROWS = 1_000_000
SLOW_POINTS = 10  # a search through fewer takes no two seconds
MOST_SEARCHED = {
    "cubic": 80,
    "four_three_four": 80,
    "b_spline_4": 25,
    "b_spline_5": 25,
}  # half a minute
MOST_INTERVALS = 12  # told one by one
SAMPLE_ROUNDING_REL = 1e-9  # of a sample
SHOWN_AS_ZERO_REL = 1e-12  # of a peak: rounding, shown as 0
SMOOTHEST = 4  # highest continuous derivative that is looked for
UNITS = ("m", "m/s", "m/s²", "m/s³")


class PassageTimes(NamedTuple):
    """When the points are passed, and how that was found."""

    times_s: FloatArray  # (N,) from 0
    how: str
    allocated_s: float | None = (
        None  # duration with the shares of the allocation, when a shorter one was looked for
    )
    reached: dict[str, float] | None = None  # share used of each limit


def spline(
    file: Annotated[
        Path,
        typer.Argument(
            help="CSV whose first line names columns: t_s (optional), x_m, y_m, z_m.",
            metavar="POINTS.csv",
        ),
    ],
    kind: Annotated[str, typer.Option(help=f"One of: {', '.join(KINDS)}.")] = "b_spline_5",
    allocation: Annotated[
        str,
        typer.Option(
            help="How intervals share the time when the file has none: equal, proportional to the distance, or its sqrt."
        ),
    ] = "sqrt",
    time: Annotated[
        float | None, typer.Option(help="Total time in s, for a file without times.")
    ] = None,
    retime: Annotated[bool, typer.Option("--retime", help="Leave the file's times aside.")] = False,
    vmax: Annotated[
        float | None,
        typer.Option(
            help="Limit on speed in m/s. Limits without times: the least total time is found."
        ),
    ] = None,
    amax: Annotated[
        float | None, typer.Option(help="Limit on acceleration in m/s²; that of blends.")
    ] = None,
    jmax: Annotated[float | None, typer.Option(help="Limit on jerk in m/s³.")] = None,
    position_min: Annotated[
        float | None, typer.Option(help="Lowest position of any axis in m.")
    ] = None,
    position_max: Annotated[
        float | None, typer.Option(help="Highest position of any axis in m.")
    ] = None,
    csv_file: Annotated[
        Path | None, typer.Option("--csv", help="Write position to jerk of every axis every 10 ms.")
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw the motion: .svg, .png or .pdf.")] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
) -> int:
    """Pass points along X, Y and Z, from rest to rest but for natural, periodic and n_point; exit 3 when a limit is broken.

    Times come from the file, or --time shared by --allocation, or are the least that keep the limits (from that allocation).
    """
    for what, name, known in (("--kind", kind, KINDS), ("--allocation", allocation, SHARES)):
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
    through = _through(kind, limits)
    with working(
        f"least time through {len(points.points_m)} points",
        quiet=len(points.points_m) < SLOW_POINTS,
    ):
        timing = _timing(points, kind, allocation, limits, time, retime)
    paths = {axis: _path(through, timing.times_s, row) for axis, row in _rows(points)}
    found = {axis: analyse(path, timing.times_s, limits) for axis, path in paths.items()}
    warnings = [
        f"{axis}: {text}"
        for axis, path in paths.items()
        for text in (*found[axis].warnings, *_steps(path, limits))
    ]
    if csv_file is not None:
        _write_csv(paths, csv_file)
    if plot is not None:
        from rig.ui.plots.laws import draw_motion  # matplotlib takes its time

        title = f"{kind} through {timing.times_s.size} points in {timing.times_s[-1]:.6g} s, {timing.how}"
        picture_file.save(draw_motion(paths, timing.times_s, limits, title), plot)
    if as_json:
        print_json(_document(kind, points, timing, paths, found, warnings))
    else:
        wide.print(_table(kind, timing, found))
        _tell(kind, points, timing, paths, warnings)
    return REFUSED if warnings else 0


def _through(kind: str, limits: AxisLimits) -> Callable[[FloatArray, FloatArray], Trajectory]:
    """spline(times, points) of a kind."""
    if kind != BLENDS:
        return SPLINES[kind]
    if not math.isfinite(limits.acceleration_m_s2):
        raise ConfigError(
            "--kind blends without --amax; must have the acceleration of its parabolas: give it in m/s²"
        )
    return lambda times, points: (
        parabolic_blends(times, points, limits.acceleration_m_s2).trajectory
    )


def _path(
    through: Callable[[FloatArray, FloatArray], Trajectory],
    times_s: FloatArray,
    points_m: FloatArray,
) -> Trajectory:
    if np.ptp(points_m) == 0.0:
        return Trajectory.hold(float(points_m[0]), float(times_s[-1]))
    return through(times_s, points_m)


def _timing(
    points: Waypoints,
    kind: str,
    allocation: str,
    limits: AxisLimits,
    total_s: float | None,
    retime: bool,
) -> PassageTimes:
    """The file's times, the total time shared, or the least time within the limits."""
    if points.times_s is not None and not retime:
        if total_s is not None:
            raise ConfigError(
                f"--time {total_s:g} with a column t_s; must be one of the two: add --retime to drop the column"
            )
        return PassageTimes(points.times_s - points.times_s[0], "at the file's times")
    start = SHARES[allocation]
    if total_s is not None:
        return PassageTimes(
            _from_zero(allocate(points.points_m, total_s, ALLOCATIONS[start])),
            f"{allocation} shares",
        )
    bounds = {name: getattr(limits, name) for name in LIMIT_NAMES.values()}
    if kind == BLENDS or not any(map(math.isfinite, bounds.values())):
        other = "" if kind == BLENDS else ", or a limit for the least time: --vmax, --amax, --jmax"
        raise ConfigError(
            f"the points have no times for --kind {kind}; must have t_s in the file, or --time{other}: give one"
        )
    shares = _from_zero(allocate(points.points_m, 1.0, ALLOCATIONS[start]))
    searched = kind in SHAPES and shares.size > 2
    if searched and shares.size > MOST_SEARCHED[kind]:
        raise ConfigError(
            f"the least time through {shares.size} points by --kind {kind}; must be <= {MOST_SEARCHED[kind]} points, as the "
            "search takes minutes beyond: give --time, or take cubic or four_three_four"
        )
    least = minimum_time(kind, points.points_m, limits, starts=(start,)) if searched else None
    moving = [row for row in points.points_m.T if np.ptp(row)]
    allocated_s = max(
        (within_limits(SPLINES[kind](shares, row), **bounds).duration_s for row in moving),
        default=1.0,
    )
    if least is None:
        return PassageTimes(
            shares * allocated_s, f"{allocation} shares, as fast as the limits allow"
        )
    return PassageTimes(
        least.times_s, "the least time within the limits", allocated_s, least.reached
    )


def _rows(points: Waypoints) -> Iterator[tuple[str, FloatArray]]:
    """Name and positions (N,) of every axis that the file has."""
    return (
        (column.removesuffix("_m"), points.points_m[:, AXES.index(column)])
        for column in points.axes
    )


def _from_zero(durations_s: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(durations_s)])


def _continuity(path: Trajectory) -> str:
    """The highest derivative without a step, at the ends too: Cn; speed at an end is C0."""
    return (
        f"C{next(k for k in range(SMOOTHEST + 1) if k == SMOOTHEST or not path.continuous(k + 1))}"
    )


def _steps(path: Trajectory, limits: AxisLimits) -> Iterator[str]:
    """Sentences for limits that a step of the derivative below breaks, which no range of values shows."""
    for order, name in LIMIT_NAMES.items():
        if math.isfinite(limits.peak_limit(order)) and not path.continuous(order - 1):
            yield (
                f"|{name}| is without bound where {NAMES[order - 1]} steps, perhaps at an end; "
                f"must be <= {limits.peak_limit(order):.6g}: take a smoother kind, b_spline_5 say"
            )


def _miss_m(path: Trajectory, times_s: FloatArray, points_m: FloatArray) -> float:
    """By how much a point is passed by, at its time."""
    return float(np.abs(path.at(times_s) - points_m).max())


def _document(
    kind: str,
    points: Waypoints,
    timing: PassageTimes,
    paths: dict[str, Trajectory],
    found: dict[str, SplineAnalysis],
    warnings: list[str],
) -> dict[str, object]:
    axes = {
        axis: {
            "continuity": _continuity(paths[axis]),
            "largest_miss_m": _miss_m(paths[axis], timing.times_s, row),
            **{name: getattr(found[axis], name)._asdict() for name in NAMES},
        }
        for axis, row in _rows(points)
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


def _table(kind: str, timing: PassageTimes, found: dict[str, SplineAnalysis]) -> Table:
    title = (
        f"{kind} through {timing.times_s.size} points in {timing.times_s[-1]:.6f} s, {timing.how}"
    )
    view = Table(title=title, title_justify="left", box=None, padding=(0, 2, 0, 0))
    for header in ("", "", "lowest", "highest", "peak", "at [s]", "interval", "rms"):
        view.add_column(header, justify="right" if header else "left", no_wrap=True)
    for axis, analysis in found.items():
        for name, unit in zip(NAMES, UNITS, strict=True):
            r = getattr(analysis, name)
            figures = [
                f"{value if abs(value) > SHOWN_AS_ZERO_REL * r.peak else 0.0:.6g}"
                for value in (r.low, r.high, r.peak)
            ]
            word = name.split("_")[0]
            view.add_row(
                axis,
                f"{word} [{unit}]",
                *figures,
                f"{r.peak_t_s:.6g}",
                str(r.interval),
                f"{r.rms:.6g}",
                end_section=word == "jerk",
            )
    return view


def _tell(
    kind: str,
    points: Waypoints,
    timing: PassageTimes,
    paths: dict[str, Trajectory],
    warnings: list[str],
) -> None:
    """What the table cannot say."""
    lasts = ", ".join(f"{h:.6g}" for h in np.diff(timing.times_s)[:MOST_INTERVALS].tolist())
    more = ", ..." if timing.times_s.size > MOST_INTERVALS + 1 else ""
    out.print(f"intervals, from 0 on: {lasts}{more} s")
    if timing.allocated_s is not None and timing.reached is not None:
        shares = ", ".join(
            f"{share:.2%} of {name.split('_')[0]}" for name, share in timing.reached.items()
        )
        out.print(
            f"used of the limits: {shares}; the allocation alone, only scaled: {timing.allocated_s:.6f} s"
        )
    for axis, row in _rows(points):
        smooth = _continuity(paths[axis])
        passed = (
            f"; passes a point by {_miss_m(paths[axis], timing.times_s, row):.6g} m"
            if kind == BLENDS
            else ""
        )
        out.print(f"{axis}: {smooth}{STEPS.get(smooth, '')}{passed}")
    for warning in warnings:
        out.print(f"over limits: {warning}", style="yellow")


def _write_csv(paths: dict[str, Trajectory], file: Path) -> None:
    end = max(path.duration_s for path in paths.values())
    if end > MOST_ROWS * TABLE_SAMPLE_S:
        raise ConfigError(
            f"--csv of {end:g} s every {TABLE_SAMPLE_S:g} s; must be <= {MOST_ROWS} rows: give a shorter --time"
        )
    t = np.minimum(
        TABLE_SAMPLE_S * np.arange(math.ceil(end / TABLE_SAMPLE_S - SAMPLE_ROUNDING_REL) + 1), end
    )
    head = [f"{axis}_{unit}" for axis in paths for unit in ("m", "m_s", "m_s2", "m_s3")]
    columns = np.column_stack(
        [t, *(path.at(t, order) for path in paths.values() for order in range(4))]
    )
    with file.open("w", newline="") as target:
        rows = csv.writer(target)
        rows.writerow(["t_s", *head])
        rows.writerows([f"{value:.9g}" for value in row] for row in columns)
