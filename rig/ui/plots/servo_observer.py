"""Figure of a disturbance observer: damping ratio over time constant, disturbance responses."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.drives.servo.disturbance_design import Place
from rig.drives.servo.loops import oscillatory_pairs
from rig.drives.servo.nominal import Nominal
from rig.studies.servo.observer import ObserverTask, printed_poles_1_s, torque_step_response
from rig.studies.servo.observer_damping import (
    TimeConstantRanges,
    least_damping,
    time_constant_ranges,
)
from rig.ui.plots.style import BLUE, GREEN, GREY, INK, LIGHT_RED, PALE_RED, RED, style_axes

BARE = INK  # no observer
FAST = RED
BEST = GREEN
ELASTIC = BLUE
EXCITED = PALE_RED
UNSTABLE = LIGHT_RED
DECADES = 3.0  # of the time constant, each side of 1 / omega_z
CURVE_POINTS = 400  # of the damping ratio over the time constant
# largest time constant that reduces the damping (or the best one) over that of the fast filter
FAST_FACTOR = 4.0
AXIS_RANGE_REL = 1.2  # range of a panel over the largest value


class Curve(NamedTuple):
    """Curve of one observer; nominal None: no observer."""

    label: str
    nominal: Nominal | None
    time_constant_s: float
    colour: str


def draw_observer(task: ObserverTask) -> Figure:
    """Draw the damping ratio over the time constant, and the load speed caused by torques.

    Torques: on the motor over frequency, and steps on motor and load over time.
    """
    turn = time_constant_ranges(task)
    curves = _curves(task, turn)
    bare, *fast, best = curves
    figure = Figure(figsize=(14.0, 9.5), layout="constrained")
    panels = figure.subplot_mosaic("AAABBB\nCCDDEE")
    _draw_damping(panels["A"], task, turn)
    _draw_spectrum(panels["B"], task, curves)
    _draw_responses(panels["C"], task, (bare, best), "motor")
    _draw_responses(panels["D"], task, fast, "motor")
    top = _draw_responses(panels["E"], task, (*fast, best, bare), "load", cut=bare)
    if top:
        panels["E"].set_ylim(-top, top)
    figure.legend(
        *panels["B"].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False
    )
    figure.suptitle(_title(turn), ha="left", x=0.01)
    return figure


def _curves(task: ObserverTask, turn: TimeConstantRanges) -> list[Curve]:
    """Choose the curves: no observer, two fast observers, the best damped one."""
    fast_s = (turn.excited[0][1] if _is_excited_when_fast(turn) else turn.best_s) / FAST_FACTOR
    fast, best = (f"$T_f$ = {1e3 * t:.3g} ms" for t in (fast_s, turn.best_s))
    return [
        Curve("no observer", None, 0.0, BARE),
        Curve(f"rigid nominal, {fast}", task.rigid, fast_s, FAST),
        Curve(f"elastic nominal, {fast}", task.elastic, fast_s, ELASTIC),
        Curve(f"rigid nominal, {best}", task.rigid, turn.best_s, BEST),
    ]


def _is_excited_when_fast(turn: TimeConstantRanges) -> bool:
    """Check whether all time constants from 0 to a finite one reduce the damping ratio."""
    if not turn.excited:
        return False
    low_s, high_s = turn.excited[0]
    return low_s == 0.0 and math.isfinite(high_s)


def _title(turn: TimeConstantRanges) -> str:
    largest = "the largest that reduces the damping" if _is_excited_when_fast(turn) else "the best"
    return (
        "Torque disturbance observer on an elastic joint\n"
        f"$T_f$ of the responses: best damped, and 1/{FAST_FACTOR:g} of {largest}"
    )


def _draw_damping(panel: Axes, task: ObserverTask, turn: TimeConstantRanges) -> None:
    """Draw the least damping ratio over the time constant."""
    times = np.logspace(-DECADES, DECADES, CURVE_POINTS) / task.joint.antiresonance_rad_s
    found = [least_damping(task, t) for t in times]
    panel.semilogx(1e3 * times, found, color=FAST, lw=1.8, label="rigid nominal")
    if task.order == 1:
        printed = [
            min(
                oscillatory_pairs(printed_poles_1_s(task.joint, t)),
                key=lambda m: m.damping,
                default=None,
            )
            for t in times
        ]
        shown = [np.nan if pair is None else pair.damping for pair in printed]
        panel.semilogx(
            1e3 * times,
            shown,
            color=GREY,
            lw=1.0,
            ls="--",
            label="$H_f$ as printed in source 001",
        )
    panel.axhline(
        task.joint_pair.damping, color=ELASTIC, lw=1.4, label="elastic nominal; no observer"
    )
    panel.axhline(
        task.locked_rotor_pair.damping, color=GREY, lw=0.8, ls=":", label="load, motor locked"
    )
    for name, colour, intervals in (
        ("excited", EXCITED, turn.excited),
        ("unstable", UNSTABLE, turn.unstable),
    ):
        for k, (low, high) in enumerate(intervals):
            ends = 1e3 * max(low, times[0]), 1e3 * min(high, times[-1])
            label = "_" if k else f"{name}: bounds {_bounds_ms(intervals)} ms"
            panel.axvspan(*ends, color=colour, alpha=0.5, lw=0.0, label=label)
    best = f"best: {1e3 * turn.best_s:.3g} ms"
    panel.plot([1e3 * turn.best_s], [turn.best.damping], "o", ms=8, color=BEST, label=best)
    inside = [t for t in task.time_constants_s if times[0] <= t <= times[-1]]
    panel.plot(
        [1e3 * t for t in inside],
        [least_damping(task, t) for t in inside],
        ".",
        ms=9,
        color=FAST,
        label="in the table",
    )
    bottom = AXIS_RANGE_REL * min(0.0, *found)
    top = AXIS_RANGE_REL * max(turn.best.damping, task.joint_pair.damping)
    panel.set_ylim(bottom, top)
    panel.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=9)
    style_axes(panel, xlabel="time constant $T_f$ [ms]", ylabel="least damping ratio of the poles")


def _bounds_ms(intervals: Iterable[tuple[float, float]]) -> str:
    """Format the finite bounds of the intervals [ms]."""
    bounds_s = [bound_s for interval in intervals for bound_s in interval]
    return ", ".join(f"{1e3 * bound_s:.3g}" for bound_s in bounds_s if 0.0 < bound_s < math.inf)


def _draw_spectrum(panel: Axes, task: ObserverTask, curves: Iterable[Curve]) -> None:
    """Draw the load speed per torque on the motor over frequency."""
    omega = task.joint.antiresonance_rad_s * np.logspace(-2.0, 1.5, 1200)
    plant = np.polyval(task.joint.load_numerator, 1j * omega) / np.polyval(
        task.joint.denominator[:-1], 1j * omega
    )
    for curve in curves:
        label, nominal, time_s, colour = curve
        if not _is_stable(task, curve):
            panel.plot([], [], color=colour, lw=1.6, label=f"{label}: unstable")
            continue
        found = (
            plant
            if nominal is None
            else task.design(nominal, time_s).disturbance(task.joint, "motor", "load").at(omega)
        )
        panel.loglog(omega, np.abs(found), color=colour, lw=1.6, label=label)
    panel.set_title("load speed per torque on the motor [rad/s per N m]", fontsize=11)
    style_axes(panel, xlabel="frequency [rad/s]")


def _draw_responses(
    panel: Axes,
    task: ObserverTask,
    curves: Iterable[Curve],
    place: Place,
    cut: Curve | None = None,
) -> float:
    """Draw step responses; gives the range that holds all curves but `cut` [rad/s]."""
    top = 0.0
    highest = 0.0
    for curve in curves:
        if not _is_stable(task, curve):
            continue
        found = torque_step_response(task, curve.nominal, curve.time_constant_s, place)
        panel.plot(found.t_s, found.speed_rad_s, color=curve.colour, lw=1.6)
        highest = max(highest, found.peak_rad_s)
        top = max(top, 0.0 if curve is cut else AXIS_RANGE_REL * found.peak_rad_s)
    panel.set_title(f"load speed [rad/s], step of 1 N m on the {place}", fontsize=11)
    xlabel = "time [s]"
    if cut is not None and highest > top:
        xlabel = f"time [s]; curve cut: {cut.label}"
    style_axes(panel, xlabel=xlabel, zero_line=True)
    return top


def _is_stable(task: ObserverTask, curve: Curve) -> bool:
    if curve.nominal is None:
        return True
    return task.design(curve.nominal, curve.time_constant_s).least_damped(task.joint).damping >= 0.0
