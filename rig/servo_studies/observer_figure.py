"""The picture of a torque disturbance observer: damping over its time constant, and the load after a torque step."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.servo.disturbance_design import Nominal, Place
from rig.servo.loops import swinging
from rig.servo_studies.observer import ObserverTask, course, damping, printed_poles_1_s, turns

BARE, FAST, BEST, ELASTIC, GREY = "#212121", "#c62828", "#2e7d32", "#1565c0", "#757575"
DECADES = 3.0  # each side of 1 / omega_z
FASTER = 4.0  # the fast filter shown, than the one that breaks even (or than the best)


def draw_observer(task: ObserverTask) -> Figure:
    """Damping over the time constant; the load's speed over a torque on the motor, and after a step on motor and load."""
    turn = turns(task)
    fast_s = (turn.best_s if turn.break_even_s is None else turn.break_even_s) / FASTER
    curves: list[tuple[str, Nominal | None, float, str]] = [
        ("no observer", None, 0.0, BARE),
        (f"motor alone as nominal, $T_f$ = {1e3 * fast_s:.2g} ms", task.rigid, fast_s, FAST),
        (f"motor alone, $T_f$ = {1e3 * turn.best_s:.2g} ms", task.rigid, turn.best_s, BEST),
        (f"elastic joint as nominal, $T_f$ = {1e3 * fast_s:.2g} ms", task.elastic, fast_s, ELASTIC),
    ]
    figure = Figure(figsize=(14.0, 9.0), layout="constrained")
    (over, spectrum), (motor, load) = figure.subplots(2, 2)
    _damping(over, task, turn.break_even_s, turn.best_s)
    _spectrum(spectrum, task, curves)
    _course(motor, task, curves, "motor")
    _course(load, task, curves, "load")
    figure.legend(*spectrum.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle("A torque disturbance observer on an elastic joint", ha="left", x=0.01)
    return figure


def _damping(panel: Axes, task: ObserverTask, break_even_s: float | None, best_s: float) -> None:
    centre = 1.0 / task.joint.antiresonance_rad_s
    times = centre * np.logspace(-DECADES, DECADES, 400)
    panel.semilogx(times, [damping(task, t) for t in times], color=FAST, lw=1.8, label="motor alone as nominal")
    printed = [min(swinging(printed_poles_1_s(task.joint, t)), key=lambda m: m.damping, default=None) for t in times]
    shown = [np.nan if pair is None else pair.damping for pair in printed]
    panel.semilogx(times, shown, color=GREY, lw=1.0, ls="--", label="by $H_f$ as printed in source 001")
    panel.axhline(task.bare.damping, color=ELASTIC, lw=1.4, label="elastic joint as nominal, and no observer")
    panel.axhline(task.locked.damping, color=GREY, lw=0.8, ls=":", label="load alone, motor standing")
    for t, colour in ((break_even_s, BARE), (best_s, BEST)):
        if t is not None:
            panel.plot([t], [damping(task, t)], "o", ms=8, color=colour)
            panel.annotate(f" {1e3 * t:.3g} ms", (t, damping(task, t)), color=colour, va="bottom")
    inside = [t for t in task.time_constants_s if times[0] <= t <= times[-1]]
    panel.plot(inside, [damping(task, t) for t in inside], ".", ms=9, color=FAST)
    panel.set_ylabel("damping of the elastic pair")
    panel.set_xlabel("time constant $T_f$ [s]")
    panel.set_ylim(0.0, 1.35 * damping(task, best_s))
    panel.legend(frameon=False, loc="upper left", ncols=2)
    _dress(panel)


def _spectrum(panel: Axes, task: ObserverTask, curves: list[tuple[str, Nominal | None, float, str]]) -> None:
    omega = task.joint.antiresonance_rad_s * np.logspace(-2.0, 1.5, 1200)
    plant = np.polyval(task.joint.load_numerator, 1j * omega) / np.polyval(task.joint.denominator[:-1], 1j * omega)
    for label, nominal, time_s, colour in curves:
        found = plant if nominal is None else task.design(nominal, time_s).disturbance(task.joint, "motor", "load").at(omega)
        panel.loglog(omega, np.abs(found), color=colour, lw=1.6, label=label)
    panel.set_title("speed of the load over a torque on the motor [rad/s per N m]", fontsize=11)
    panel.set_xlabel("frequency [rad/s]")
    _dress(panel)


def _course(panel: Axes, task: ObserverTask, curves: list[tuple[str, Nominal | None, float, str]], place: Place) -> None:
    """Each over its own peak, which the legend tells: they differ by orders of magnitude."""
    for _, nominal, time_s, colour in curves:
        found = course(task, nominal, time_s, place)
        label = f"peak {found.peak_rad_s:.3g} rad/s"
        panel.plot(found.t_s, found.speed_rad_s / found.peak_rad_s, color=colour, lw=1.6, label=label)
    panel.set_title(f"speed of the load after 1 N m on the {place}, over its peak", fontsize=11)
    panel.set_xlabel("time [s]")
    panel.axhline(0.0, color=GREY, lw=0.6)
    panel.legend(frameon=False, loc="lower right")
    _dress(panel)


def _dress(panel: Axes) -> None:
    panel.grid(alpha=0.25)
    panel.spines[["top", "right"]].set_visible(False)
