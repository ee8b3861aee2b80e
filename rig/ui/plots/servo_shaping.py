"""The picture of input shaping: impulses on a joint that is another than assumed, and a torque pulse with and without."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from planners.shapers import Shaper
from rig.studies.servo.shaping import (
    UNSHAPED,
    PulseResponse,
    Robustness,
    ShapingTask,
    impulse_response,
    pulse_response,
)

COLOURS = (
    "#1565c0",
    "#2e7d32",
    "#ef6c00",
    "#6a1b9a",
    "#00838f",
    "#5d4037",
    "#d81b60",
    "#9e9d24",
    "#455a64",
)
INK, GREY, BARE = "#212121", "#757575", "#c62828"
IN_A_ROW = 3  # shapers
CURVE_POINTS = 1500  # of a curve
WATCHED = 1.5  # periods of the assumed mode after the last impulse, and after the torque


def draw_shaping(task: ShapingTask, rows: Sequence[Robustness]) -> Figure:
    """Impulse responses of every shaper in the four cases; speed of the load, and torque, of the pulse example."""
    columns = min(IN_A_ROW, len(rows))
    lines = math.ceil(len(rows) / columns)
    figure = Figure(figsize=(14.0, 3.2 * lines + 7.0), layout="constrained")
    upper, lower = figure.subfigures(2, 1, squeeze=False, height_ratios=(3.2 * lines, 7.0)).ravel()
    panels = upper.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel()
    end_s = max(row.facts.duration_s for row in rows) + WATCHED * _period_s(task)
    for panel, row in zip(panels, rows, strict=False):
        _impulses(panel, task, row, end_s)
    for panel in panels[::columns]:
        panel.set_ylabel("swing of one impulse = 1")
    upper.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False
    )
    for panel in panels[len(rows) :]:
        panel.set_visible(False)
    speed, torque = lower.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    _pulses(speed, torque, task, rows, end_s)
    figure.suptitle(
        f"Impulses for {task.frequency_rad_s:g} rad/s and damping {task.damping:g}; true joint off by "
        f"{task.frequency_error:.3g} in frequency, {task.damping_error:.3g} in damping (shares, four corners)",
        ha="left",
        x=0.01,
    )
    return figure


def _impulses(panel: Axes, task: ShapingTask, row: Robustness, end_s: float) -> None:
    """Swing after the impulses, over that of one impulse; the impulses stand as stems."""
    t_s = np.linspace(0.0, end_s, CURVE_POINTS)
    for k, case in enumerate(task.cases):
        label = "four cases" if k == 0 else None
        panel.plot(
            t_s, impulse_response(row.shaper, case, t_s), color=BARE, lw=1.0, alpha=0.6, label=label
        )
    panel.plot(
        t_s,
        impulse_response(UNSHAPED, task.mode, t_s),
        color=GREY,
        lw=0.8,
        ls=":",
        label="one impulse",
    )
    panel.plot(
        t_s, impulse_response(row.shaper, task.mode, t_s), color=INK, lw=1.8, label="as assumed"
    )
    panel.vlines(row.shaper.times_s, 0.0, row.shaper.amplitudes, color=COLOURS[0], lw=2.5)
    panel.plot(row.shaper.times_s, row.shaper.amplitudes, "o", color=COLOURS[0], label="impulses")
    panel.set_title(
        f"{row.name}, {len(row.shaper.times_s)} impulses: {row.singer_seering.max():.3%} left at most",
        fontsize=11,
    )
    _dress(panel, "")
    panel.set_xlabel("time [s]")


def _pulses(
    speed: Axes, torque: Axes, task: ShapingTask, rows: Sequence[Robustness], watch_s: float
) -> None:
    t_s = np.linspace(0.0, task.pulse_s + watch_s, CURVE_POINTS)
    curves = [("unshaped", UNSHAPED, BARE)]
    curves += [(row.name, row.shaper, COLOURS[k % len(COLOURS)]) for k, row in enumerate(rows)]
    for name, shaper, colour in curves:
        nominal, *cases = _of_all(task, shaper, watch_s)
        values = np.array([case.load_speed.at(t_s) for case in cases])  # (4, POINTS)
        speed.fill_between(
            t_s, values.min(axis=0), values.max(axis=0), color=colour, alpha=0.18, lw=0
        )
        speed.plot(t_s, nominal.load_speed.at(t_s), color=colour, lw=1.6, label=name)
        edges = nominal.command.breaks_s
        steps = nominal.command.at((edges[1:] + edges[:-1]) / 2.0, 1)
        torque.stairs([*steps, 0.0], [*edges, t_s[-1]], baseline=0.0, color=colour, lw=1.6)
    _dress(speed, "speed of the load [rad/s]")
    speed.legend(frameon=False, title="bands: the four cases", loc="lower right")
    _dress(torque, "torque [N m]")
    torque.use_sticky_edges = False  # room for lines at the edges
    torque.set_xlabel(f"time [s]; 1 N m on 1 kg m² for {task.pulse_s:g} s")


def _of_all(task: ShapingTask, shaper: Shaper, watch_s: float) -> list[PulseResponse]:
    """As assumed, then the four cases."""
    return [
        pulse_response(task.pulse_s, shaper, mode, watch_s) for mode in (task.mode, *task.cases)
    ]


def _period_s(task: ShapingTask) -> float:
    return 2.0 * math.pi / (task.frequency_rad_s * math.sqrt(1.0 - task.damping**2))


def _dress(panel: Axes, label: str) -> None:
    panel.set_ylabel(label)
    panel.axhline(0.0, color=GREY, lw=0.6)
    panel.grid(alpha=0.25)
    panel.spines[["top", "right"]].set_visible(False)
