"""The picture of a torque disturbance observer: damping over its time constant, and the load after a torque step."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.drives.servo.disturbance_design import Nominal, Place
from rig.drives.servo.loops import oscillatory_pairs
from rig.studies.servo.observer import ObserverTask, printed_poles_1_s, torque_step_response
from rig.studies.servo.observer_damping import (
    TimeConstantRanges,
    least_damping,
    time_constant_ranges,
)

BARE, FAST, BEST, ELASTIC, GREY = "#212121", "#c62828", "#2e7d32", "#1565c0", "#757575"
EXCITED, UNSTABLE = "#ffcdd2", "#e57373"
DECADES = 3.0  # each side of 1 / omega_z
FASTER = 4.0  # the fast filter shown, than the one that breaks even (or than the best)
ROOM = 1.2  # above what a panel is to show


class Curve(NamedTuple):
    """An observer that is pictured; none for no nominal."""

    label: str
    nominal: Nominal | None
    time_constant_s: float
    colour: str


def draw_observer(task: ObserverTask) -> Figure:
    """Damping over the time constant; the load's speed over a torque on the motor, and after a step on motor and load."""
    turn = time_constant_ranges(task)
    bare, *fast, best = curves = _curves(task, turn)
    figure = Figure(figsize=(14.0, 9.5), layout="constrained")
    panels = figure.subplot_mosaic("AAABBB\nCCDDEE")
    _damping(panels["A"], task, turn)
    _spectrum(panels["B"], task, curves)
    _course(panels["C"], task, (bare, best), "motor")
    _course(panels["D"], task, fast, "motor")
    top = _course(panels["E"], task, (*fast, best, bare), "load", leaving=bare)
    if top:
        panels["E"].set_ylim(-top, top)
    figure.legend(
        *panels["B"].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False
    )
    figure.suptitle(_title(turn), ha="left", x=0.01)
    return figure


def _curves(task: ObserverTask, turn: TimeConstantRanges) -> list[Curve]:
    fast_s = (turn.excited[0][1] if _excites_first(turn) else turn.best_s) / FASTER
    fast, best = (f"$T_f$ = {1e3 * t:.3g} ms" for t in (fast_s, turn.best_s))
    return [
        Curve("no observer", None, 0.0, BARE),
        Curve(f"rigid nominal, {fast}", task.rigid, fast_s, FAST),
        Curve(f"elastic nominal, {fast}", task.elastic, fast_s, ELASTIC),
        Curve(f"rigid nominal, {best}", task.rigid, turn.best_s, BEST),
    ]


def _excites_first(turn: TimeConstantRanges) -> bool:
    """Whether fast filters excite, up to some time constant."""
    return bool(turn.excited) and turn.excited[0][0] == 0.0 and math.isfinite(turn.excited[0][1])


def _title(turn: TimeConstantRanges) -> str:
    where = "of where the observer stops exciting" if _excites_first(turn) else "of that"
    return (
        "A torque disturbance observer on an elastic joint\n"
        f"$T_f$ of the responses is chosen: the best damped, and 1/{FASTER:g} {where}, to show what a fast one does"
    )


def _damping(panel: Axes, task: ObserverTask, turn: TimeConstantRanges) -> None:
    times = np.logspace(-DECADES, DECADES, 400) / task.joint.antiresonance_rad_s
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
            label="by $H_f$ as printed in source 001",
        )
    panel.axhline(
        task.joint_pair.damping, color=ELASTIC, lw=1.4, label="elastic nominal, and no observer"
    )
    panel.axhline(
        task.locked_rotor_pair.damping,
        color=GREY,
        lw=0.8,
        ls=":",
        label="load alone, motor standing",
    )
    for name, colour, intervals in (
        ("excited", EXCITED, turn.excited),
        ("unstable", UNSTABLE, turn.unstable),
    ):
        for k, (low, high) in enumerate(intervals):
            ends = 1e3 * max(low, times[0]), 1e3 * min(high, times[-1])
            panel.axvspan(
                *ends,
                color=colour,
                alpha=0.5,
                lw=0.0,
                label="_" if k else f"{name}: ends at {_ends(intervals)} ms",
            )
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
    panel.set_ylabel("damping, of the least damped poles")
    panel.set_xlabel("time constant $T_f$ [ms]")
    panel.set_ylim(ROOM * min(0.0, *found), ROOM * max(turn.best.damping, task.joint_pair.damping))
    panel.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=9)
    _dress(panel)


def _ends(intervals: Iterable[tuple[float, float]]) -> str:
    return ", ".join(
        f"{1e3 * end:.3g}" for interval in intervals for end in interval if 0.0 < end < math.inf
    )


def _spectrum(panel: Axes, task: ObserverTask, curves: Iterable[Curve]) -> None:
    omega = task.joint.antiresonance_rad_s * np.logspace(-2.0, 1.5, 1200)
    plant = np.polyval(task.joint.load_numerator, 1j * omega) / np.polyval(
        task.joint.denominator[:-1], 1j * omega
    )
    for curve in curves:
        label, nominal, time_s, colour = curve
        if not _stable(task, curve):
            panel.plot([], [], color=colour, lw=1.6, label=f"{label}: unstable")
            continue
        found = (
            plant
            if nominal is None
            else task.design(nominal, time_s).disturbance(task.joint, "motor", "load").at(omega)
        )
        panel.loglog(omega, np.abs(found), color=colour, lw=1.6, label=label)
    panel.set_title("speed of the load over a torque on the motor [rad/s per N m]", fontsize=11)
    panel.set_xlabel("frequency [rad/s]")
    _dress(panel)


def _course(
    panel: Axes,
    task: ObserverTask,
    curves: Iterable[Curve],
    place: Place,
    leaving: Curve | None = None,
) -> float:
    """The height that holds all but one curve, which may leave the panel [rad/s]."""
    top = highest = 0.0
    for curve in curves:
        if not _stable(task, curve):
            continue
        found = torque_step_response(task, curve.nominal, curve.time_constant_s, place)
        panel.plot(found.t_s, found.speed_rad_s, color=curve.colour, lw=1.6)
        highest = max(highest, found.peak_rad_s)
        top = max(top, 0.0 if curve is leaving else ROOM * found.peak_rad_s)
    panel.set_title(f"speed of the load [rad/s] after 1 N m on the {place}", fontsize=11)
    panel.set_xlabel(
        f"time [s]; {leaving.label} leaves the panel" if leaving and highest > top else "time [s]"
    )
    panel.axhline(0.0, color=GREY, lw=0.6)
    _dress(panel)
    return top


def _stable(task: ObserverTask, curve: Curve) -> bool:
    if curve.nominal is None:
        return True
    return task.design(curve.nominal, curve.time_constant_s).least_damped(task.joint).damping >= 0.0


def _dress(panel: Axes) -> None:
    panel.grid(alpha=0.25)
    panel.spines[["top", "right"]].set_visible(False)
