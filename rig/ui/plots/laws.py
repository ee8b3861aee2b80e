"""Pictures of motion laws, of motions through points, and of a motor at work."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from planners.laws import LAWS
from planners.laws.catalogue import coefficients
from planners.spectra.law_spectra import law_spectrum
from planners.spectra.swing_free import swing_free_cycles
from planners.splines.limits import LIMIT_NAMES, AxisLimits
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import JUMP_REL, Trajectory
from rig.drives.motor import Motor, Verdict, operating_points, torque
from rig.studies.sizing.motor_task import MotorTask

TITLES = ("position / h", "speed × T/h", "acceleration × T²/h", "jerk × T³/h")
SPECTRUM = "acceleration spectrum × T/h"
OMEGA = "Ω = T / Tn: load periods in the move; dots: no swing left"
CYCLES = 6.0  # load periods shown of a spectrum
PIECE_POINTS = 160  # of a piece
MOST_OVERLAID = 6  # more laws than that are drawn in rows
CLASSES = {"C1": "#c62828", "C2": "#1565c0", "C3": "#2e7d32"}  # one colour for each continuity
COLOURS = ("#1565c0", "#c62828", "#2e7d32", "#ef6c00", "#6a1b9a", "#00838f")
CALM, HOT, BAD, INK, GREY = "#2e7d32", "#ef6c00", "#c62828", "#1a237e", "#757575"
MOST_LINES = 40  # points that get a line through all panels
MOST_SAMPLES = 20_000  # of one curve


def draw_laws(names: Sequence[str]) -> Figure:
    """Position, speed, acceleration, jerk and acceleration spectrum of laws from 0 to 1 in 1 s.

    Up to MOST_OVERLAID of them over each other, more in rows. Raises PlanError for an unknown law.
    """
    return _overlaid(names) if len(names) <= MOST_OVERLAID else _rows(names)


def draw_motion(
    axes: Mapping[str, Trajectory], times_s: FloatArray, limits: AxisLimits, title: str
) -> Figure:
    """Position, speed, acceleration and jerk of each axis; points (times_s (N,)), limits and peaks are marked."""
    figure = Figure(figsize=(10.0, 10.0), layout="constrained")
    panels = figure.subplots(4, 1, sharex=True)
    for (name, path), colour in zip(axes.items(), COLOURS, strict=False):
        for order, panel in enumerate(panels):
            t, values = _samples(path, order)
            panel.plot(t, values, color=colour, lw=1.6, label=name)
            peak = path.peak(order)
            if order and peak.value:
                low, high = path.extent(order)
                panel.plot(
                    peak.t_s, high if high >= -low else low, "o", ms=7, mfc="none", color=colour
                )
        panels[0].plot(times_s, path.at(times_s), ".", ms=9, color=colour)
    for panel, label in zip(
        panels, ("position [m]", "speed [m/s]", "acceleration [m/s²]", "jerk [m/s³]"), strict=True
    ):
        panel.set_ylabel(label)
        panel.grid(alpha=0.3, axis="y")
        for t_s in times_s.tolist() if times_s.size <= MOST_LINES else ():
            panel.axvline(t_s, color=GREY, lw=0.5, alpha=0.5)
    _limit_lines(panels, limits)
    panels[0].legend(frameon=False, ncols=3)
    panels[3].set_xlabel("time [s]; dots: points, rings: peaks, dashes: limits")
    figure.suptitle(title, ha="left", x=0.01)
    return figure


def draw_motor(task: MotorTask, trajectory: Trajectory, verdict: Verdict) -> Figure:
    """The motion in the torque-speed plane with the motor's regions, and its torque over time."""
    figure = Figure(figsize=(13.0, 6.5), layout="constrained")
    plane, course = figure.subplots(1, 2, width_ratios=(1.0, 1.2), sharey=True)
    motor, drivetrain, colour = task.motor, task.drivetrain, CALM if verdict.feasible else BAD
    _regions(plane, motor)
    plane.plot(*operating_points(drivetrain, trajectory), color=INK, lw=1.8, label="motion")
    t, values = _samples(torque(drivetrain, trajectory), 0)
    end_s = trajectory.duration_s + task.motion.rest_s
    course.plot(
        [0.0, *t, trajectory.duration_s, end_s],
        [0.0, *values, 0.0, 0.0],
        color=INK,
        lw=1.8,
        label="torque",
    )
    for bound, shade in ((motor.peak_torque_n_m, HOT), (motor.continuous_torque_n_m, CALM)):
        for side in (-bound, bound):
            course.axhline(side, color=shade, lw=1.0)
    course.axhline(
        verdict.cycle_torque_n_m, color=colour, lw=1.4, ls=":", label="its rms, with rest"
    )
    for panel, x, y in (
        (plane, "speed of the motor [rad/s]", "torque [N m]"),
        (course, "time [s]", ""),
    ):
        _dress(panel, x, y)
        panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3, frameon=False)
    verdict_word = "feasible" if verdict.feasible else "not feasible"
    tightest = (
        f"tightest limit: {verdict.tightest}, margin {verdict.margins[verdict.tightest]:+.1%}"
    )
    figure.suptitle(f"{verdict_word}; {tightest}", ha="left", x=0.01, color=colour)
    return figure


def _overlaid(names: Sequence[str]) -> Figure:
    figure = Figure(figsize=(14.0, 8.5), layout="constrained")
    panels = figure.subplot_mosaic(
        [["0", "1", "spectrum"], ["2", "3", "spectrum"]], width_ratios=(1.0, 1.0, 1.3)
    )
    tops = _tops(names)
    for name, colour in zip(names, COLOURS, strict=False):
        for order in range(4):
            _law(panels[str(order)], name, order, colour, tops[order], shade=len(names) == 1)
        _spectrum(panels["spectrum"], name, colour, shade=len(names) == 1)
    for order, title in enumerate(TITLES):
        _dress(panels[str(order)], "t / T", title)
    _dress(panels["spectrum"], OMEGA, SPECTRUM)
    panels["spectrum"].legend(frameon=False, fontsize=11)
    return figure


def _rows(names: Sequence[str]) -> Figure:
    """A law a row, one scale a column."""
    tall = 1.25 * len(names) + 1.8  # inches
    figure = Figure(figsize=(16.0, tall))
    panels = figure.subplots(
        len(names), 5, sharex="col", sharey="col", width_ratios=(1.0, 1.0, 1.0, 1.0, 1.5)
    )
    figure.subplots_adjust(
        left=0.14, right=0.98, bottom=0.7 / tall, top=1.0 - 1.1 / tall, wspace=0.2, hspace=0.25
    )
    tops = _tops(names)
    for name, row in zip(names, panels, strict=True):
        figures = coefficients(name)
        colour = CLASSES[figures.continuity]
        for order, panel in enumerate(row[:4]):
            _law(panel, name, order, colour, tops[order])
        _spectrum(row[4], name, colour)
        for panel in row:
            panel.spines[["top", "right", "left", "bottom"]].set_visible(False)
            panel.axhline(0.0, color=GREY, lw=0.6)
            panel.tick_params(length=0, labelsize=8, colors=GREY)
        row[0].set_ylabel(
            _title(name),
            rotation=0,
            ha="right",
            va="bottom",
            labelpad=12,
            fontsize=12,
            color=colour,
        )
        under = f"{figures.continuity}   Cv {figures.cv:.4g}   Ca {figures.ca:.4g}"
        row[0].annotate(
            under, (-0.2, 0.32), xycoords="axes fraction", ha="right", fontsize=8, color=GREY
        )
    for panel, title in zip(panels[0], (*TITLES, SPECTRUM), strict=True):
        panel.set_title(title, fontsize=11, pad=10)
    for panel, label in zip(panels[-1], ("t / T",) * 4 + (OMEGA,), strict=True):
        panel.set_xlabel(label, fontsize=9, color=GREY)
    figure.suptitle("Motion laws from rest to rest", fontsize=18, y=1.0 - 0.25 / tall)
    return figure


def _tops(names: Sequence[str]) -> list[float]:
    """Largest absolute value of each derivative."""
    return [max(LAWS[name](1.0).peak(order).value for name in names) for order in range(4)]


def _law(
    panel: Axes, name: str, order: int, colour: str, top: float, *, shade: bool = True
) -> None:
    """One derivative; a step in acceleration is a jerk without bound, drawn as an arrow."""
    law = LAWS[name](1.0)
    t, values = _samples(law, order)
    if order:
        t, values = np.array([0.0, *t, 1.0]), np.array([0.0, *values, 0.0])
    panel.plot(t, values, color=colour, lw=1.8)
    if shade:
        panel.fill_between(t, values, color=colour, alpha=0.1, lw=0)
    panel.set_xlim(-0.02, 1.02)
    panel.set_ylim(-1.12 * top if order > 1 else -0.08 * top, 1.12 * top)
    for t_s, up in _steps(law) if order == 3 else ():
        head = {"arrowstyle": "-|>", "color": colour, "lw": 1.4, "shrinkA": 0.0, "shrinkB": 0.0}
        panel.annotate("", (t_s, 1.1 * top if up else -1.1 * top), (t_s, 0.0), arrowprops=head)


def _steps(law: Trajectory) -> list[tuple[float, bool]]:
    """Instants at which the acceleration steps, and whether upwards."""
    ends = [piece.at(np.array([0.0, piece.duration_s]), 2).tolist() for piece in law.pieces]
    values = [0.0, *(value for pair in ends for value in pair), 0.0]
    steps = [
        (t_s, after - before)
        for t_s, before, after in zip(law.breaks_s, values[::2], values[1::2], strict=True)
    ]
    return [
        (float(t_s), step > 0.0) for t_s, step in steps if abs(step) > JUMP_REL * law.peak(2).value
    ]


def _spectrum(panel: Axes, name: str, colour: str, *, shade: bool = True) -> None:
    cycles = np.linspace(0.0, CYCLES, 1201)
    heights = law_spectrum(name, cycles)
    panel.plot(cycles, heights, color=colour, lw=1.8, label=_title(name))
    if shade:
        panel.fill_between(cycles, heights, color=colour, alpha=0.1, lw=0)
    free = swing_free_cycles(LAWS[name](1.0), CYCLES)
    panel.plot(free, np.zeros_like(free), "o", ms=5, color=colour, clip_on=False, zorder=3)
    panel.set_xlim(0.0, CYCLES)


def _samples(path: Trajectory, order: int) -> tuple[FloatArray, FloatArray]:
    """Times and values, both sides of every joint: (pieces x points,) each."""
    points = max(2, min(PIECE_POINTS, MOST_SAMPLES // len(path.pieces)))
    times = [np.linspace(0.0, piece.duration_s, points) for piece in path.pieces]
    values = [piece.at(t, order) for piece, t in zip(path.pieces, times, strict=True)]
    starts = path.breaks_s[:-1].tolist()
    return np.concatenate(
        [start + t for start, t in zip(starts, times, strict=True)]
    ), np.concatenate(values)


def _limit_lines(panels: Sequence[Axes], limits: AxisLimits) -> None:
    bounds = [(limits.position_min_m, limits.position_max_m)]
    bounds += [(-limits.peak_limit(order), limits.peak_limit(order)) for order in LIMIT_NAMES]
    for panel, sides in zip(panels, bounds, strict=True):
        for side in sides:
            if np.isfinite(side):
                panel.axhline(side, color=BAD, lw=1.0, ls="--")


def _regions(plane: Axes, motor: Motor) -> None:
    for bound, shade, name in (
        (motor.peak_torque_n_m, HOT, "intermittent"),
        (motor.continuous_torque_n_m, CALM, "continuous"),
    ):
        speed, edge = motor.outline(bound)
        both = np.concatenate([-speed[::-1], speed])
        top = np.concatenate([edge[::-1], edge])
        plane.fill_between(both, -top, top, color=shade, alpha=0.16, lw=0, label=name)
        plane.plot(
            [*both, both[-1], *both[::-1], both[0]],
            [*top, -top[-1], *-top, top[0]],
            color=shade,
            lw=1.0,
        )


def _dress(panel: Axes, x: str, y: str) -> None:
    panel.set_xlabel(x)
    panel.set_ylabel(y)
    panel.grid(alpha=0.25)
    panel.axhline(0.0, color=GREY, lw=0.6)
    panel.spines[["top", "right"]].set_visible(False)


def _title(name: str) -> str:
    return name.replace("_", " ")
