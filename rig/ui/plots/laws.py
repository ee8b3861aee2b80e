"""Figures of motion laws, of motions through points, and of the motion of a motor."""

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
from rig.ui.plots.style import BLUE, GREEN, GREY, NAVY, ORANGE, RED, SERIES, style_axes

TITLES = ("position / h", "speed × T/h", "acceleration × T²/h", "jerk × T³/h")
SPECTRUM = "acceleration spectrum × T/h"
OMEGA = "Ω = T / Tn: move duration over load period; dots: zero residual swing"
CYCLES = 6.0  # upper end of a spectrum [load periods]
PIECE_POINTS = 160  # samples of a piece of a trajectory
MAX_OVERLAID_LAWS = 6  # more laws are drawn in rows
CONTINUITY_COLOURS = {"C1": RED, "C2": BLUE, "C3": GREEN}
CONTINUOUS = GREEN  # continuous torque of a motor
INTERMITTENT = ORANGE  # peak torque of a motor
MAX_POINT_LINES = 40  # points marked by a line through all panels
MAX_CURVE_SAMPLES = 20_000


def draw_laws(names: Sequence[str]) -> Figure:
    """Draw position, speed, acceleration, jerk and acceleration spectrum of motion laws.

    The laws run from 0 to 1 in 1 s. Up to MAX_OVERLAID_LAWS share their panels; more get a row
    each. Raises PlanError for an unknown law.
    """
    if len(names) <= MAX_OVERLAID_LAWS:
        return _draw_overlaid(names)
    return _draw_in_rows(names)


def draw_motion(
    axes: Mapping[str, Trajectory], times_s: FloatArray, limits: AxisLimits, title: str
) -> Figure:
    """Draw position, speed, acceleration and jerk of each axis.

    times_s (N,): instants of the points, marked by dots. Limits and peaks are marked too.
    """
    figure = Figure(figsize=(10.0, 10.0), layout="constrained")
    panels = figure.subplots(4, 1, sharex=True)
    for (name, path), colour in zip(axes.items(), SERIES, strict=False):
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
        style_axes(panel, ylabel=label)
        if times_s.size <= MAX_POINT_LINES:
            for t_s in times_s.tolist():
                panel.axvline(t_s, color=GREY, lw=0.5, alpha=0.5)
    _draw_limits(panels, limits)
    panels[0].legend(frameon=False, ncols=3)
    panels[3].set_xlabel("time [s]; dots: points, circles: peaks, dashed: limits")
    figure.suptitle(title, ha="left", x=0.01)
    return figure


def draw_motor(task: MotorTask, trajectory: Trajectory, verdict: Verdict) -> Figure:
    """Draw a motion in the torque-speed plane of its motor, and the torque over time."""
    figure = Figure(figsize=(13.0, 6.5), layout="constrained")
    plane, course = figure.subplots(1, 2, width_ratios=(1.0, 1.2), sharey=True)
    motor = task.motor
    drivetrain = task.drivetrain
    colour = GREEN if verdict.feasible else RED
    _draw_regions(plane, motor)
    plane.plot(*operating_points(drivetrain, trajectory), color=NAVY, lw=1.8, label="motion")
    t, values = _samples(torque(drivetrain, trajectory), 0)
    end_s = trajectory.duration_s + task.motion.rest_s
    course.plot(
        [0.0, *t, trajectory.duration_s, end_s],
        [0.0, *values, 0.0, 0.0],
        color=NAVY,
        lw=1.8,
        label="torque",
    )
    bounds = (
        (motor.peak_torque_n_m, INTERMITTENT),
        (motor.continuous_torque_n_m, CONTINUOUS),
    )
    for bound, shade in bounds:
        for side in (-bound, bound):
            course.axhline(side, color=shade, lw=1.0)
    course.axhline(
        verdict.cycle_torque_n_m, color=colour, lw=1.4, ls=":", label="rms torque of the cycle"
    )
    for panel, x, y in (
        (plane, "speed of the motor [rad/s]", "torque [N m]"),
        (course, "time [s]", ""),
    ):
        style_axes(panel, xlabel=x, ylabel=y, zero_line=True)
        panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3, frameon=False)
    verdict_word = "feasible" if verdict.feasible else "not feasible"
    margin = verdict.margins[verdict.tightest]
    tightest = f"least margin: {verdict.tightest}, {margin:+.1%}"
    figure.suptitle(f"{verdict_word}; {tightest}", ha="left", x=0.01, color=colour)
    return figure


def _draw_overlaid(names: Sequence[str]) -> Figure:
    figure = Figure(figsize=(14.0, 8.5), layout="constrained")
    panels = figure.subplot_mosaic(
        [["0", "1", "spectrum"], ["2", "3", "spectrum"]], width_ratios=(1.0, 1.0, 1.3)
    )
    tops = _largest_values(names)
    for name, colour in zip(names, SERIES, strict=False):
        for order in range(4):
            panel = panels[str(order)]
            _draw_law(panel, name, order, colour, tops[order], shade=len(names) == 1)
        _draw_spectrum(panels["spectrum"], name, colour, shade=len(names) == 1)
    for order, title in enumerate(TITLES):
        style_axes(panels[str(order)], xlabel="t / T", ylabel=title, zero_line=True)
    style_axes(panels["spectrum"], xlabel=OMEGA, ylabel=SPECTRUM, zero_line=True)
    panels["spectrum"].legend(frameon=False, fontsize=11)
    return figure


def _draw_in_rows(names: Sequence[str]) -> Figure:
    """Draw one law a row; the panels of a column share their scale."""
    height_in = 1.25 * len(names) + 1.8
    figure = Figure(figsize=(16.0, height_in))
    panels = figure.subplots(
        len(names), 5, sharex="col", sharey="col", width_ratios=(1.0, 1.0, 1.0, 1.0, 1.5)
    )
    figure.subplots_adjust(
        left=0.14,
        right=0.98,
        bottom=0.7 / height_in,
        top=1.0 - 1.1 / height_in,
        wspace=0.2,
        hspace=0.25,
    )
    tops = _largest_values(names)
    for name, row in zip(names, panels, strict=True):
        figures = coefficients(name)
        colour = CONTINUITY_COLOURS[figures.continuity]
        for order, panel in enumerate(row[:4]):
            _draw_law(panel, name, order, colour, tops[order])
        _draw_spectrum(row[4], name, colour)
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
    figure.suptitle("Motion laws from rest to rest", fontsize=18, y=1.0 - 0.25 / height_in)
    return figure


def _largest_values(names: Sequence[str]) -> list[float]:
    """Compute the largest absolute value of each derivative over all laws."""
    return [max(LAWS[name](1.0).peak(order).value for name in names) for order in range(4)]


def _draw_law(
    panel: Axes, name: str, order: int, colour: str, top: float, *, shade: bool = True
) -> None:
    """Draw one derivative of a law; arrows mark the unbounded jerk of acceleration steps."""
    law = LAWS[name](1.0)
    t, values = _samples(law, order)
    if order:
        t, values = np.array([0.0, *t, 1.0]), np.array([0.0, *values, 0.0])
    panel.plot(t, values, color=colour, lw=1.8)
    if shade:
        panel.fill_between(t, values, color=colour, alpha=0.1, lw=0)
    panel.set_xlim(-0.02, 1.02)
    panel.set_ylim(-1.12 * top if order > 1 else -0.08 * top, 1.12 * top)
    if order != 3:
        return
    for t_s, upward in _acceleration_steps(law):
        head = {"arrowstyle": "-|>", "color": colour, "lw": 1.4, "shrinkA": 0.0, "shrinkB": 0.0}
        tip = 1.1 * top if upward else -1.1 * top
        panel.annotate("", (t_s, tip), (t_s, 0.0), arrowprops=head)


def _acceleration_steps(law: Trajectory) -> list[tuple[float, bool]]:
    """List the instants of steps in acceleration [s]; True for a step upward."""
    ends = [piece.at(np.array([0.0, piece.duration_s]), 2).tolist() for piece in law.pieces]
    values = [0.0, *(value for pair in ends for value in pair), 0.0]
    steps = [
        (t_s, after - before)
        for t_s, before, after in zip(law.breaks_s, values[::2], values[1::2], strict=True)
    ]
    return [
        (float(t_s), step > 0.0) for t_s, step in steps if abs(step) > JUMP_REL * law.peak(2).value
    ]


def _draw_spectrum(panel: Axes, name: str, colour: str, *, shade: bool = True) -> None:
    cycles = np.linspace(0.0, CYCLES, 1201)
    heights = law_spectrum(name, cycles)
    panel.plot(cycles, heights, color=colour, lw=1.8, label=_title(name))
    if shade:
        panel.fill_between(cycles, heights, color=colour, alpha=0.1, lw=0)
    free = swing_free_cycles(LAWS[name](1.0), CYCLES)
    panel.plot(free, np.zeros_like(free), "o", ms=5, color=colour, clip_on=False, zorder=3)
    panel.set_xlim(0.0, CYCLES)


def _samples(path: Trajectory, order: int) -> tuple[FloatArray, FloatArray]:
    """Sample a derivative on both sides of every break: times and values (pieces x points,)."""
    points = max(2, min(PIECE_POINTS, MAX_CURVE_SAMPLES // len(path.pieces)))
    times = [np.linspace(0.0, piece.duration_s, points) for piece in path.pieces]
    values = [piece.at(t, order) for piece, t in zip(path.pieces, times, strict=True)]
    starts = path.breaks_s[:-1].tolist()
    shifted = [start + t for start, t in zip(starts, times, strict=True)]
    return np.concatenate(shifted), np.concatenate(values)


def _draw_limits(panels: Sequence[Axes], limits: AxisLimits) -> None:
    bounds = [(limits.position_min_m, limits.position_max_m)]
    bounds += [(-limits.peak_limit(order), limits.peak_limit(order)) for order in LIMIT_NAMES]
    for panel, sides in zip(panels, bounds, strict=True):
        for side in sides:
            if np.isfinite(side):
                panel.axhline(side, color=RED, lw=1.0, ls="--")


def _draw_regions(plane: Axes, motor: Motor) -> None:
    """Shade the continuous and the intermittent region of a motor."""
    for bound, shade, name in (
        (motor.peak_torque_n_m, INTERMITTENT, "intermittent"),
        (motor.continuous_torque_n_m, CONTINUOUS, "continuous"),
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


def _title(name: str) -> str:
    return name.replace("_", " ")
