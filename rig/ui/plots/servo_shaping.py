"""Figure of input shapers: impulse responses with parameter errors, response to a torque pulse."""

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
from rig.ui.plots.style import BLUE, GREY, INK, RED, SERIES_WITHOUT_RED, style_axes

PANELS_PER_ROW = 3
CURVE_POINTS = 1500
SHOWN_PERIODS = 1.5  # of the assumed mode, after the last impulse and after the torque


def draw_shaping(task: ShapingTask, rows: Sequence[Robustness]) -> Figure:
    """Draw impulse responses of every shaper, and load speed and torque of the pulse example.

    Each with the assumed mode and with the four corner cases of the parameter errors.
    """
    columns = min(PANELS_PER_ROW, len(rows))
    lines = math.ceil(len(rows) / columns)
    figure = Figure(figsize=(14.0, 3.2 * lines + 7.0), layout="constrained")
    upper, lower = figure.subfigures(2, 1, squeeze=False, height_ratios=(3.2 * lines, 7.0)).ravel()
    panels = upper.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel()
    end_s = max(row.facts.duration_s for row in rows) + SHOWN_PERIODS * _damped_period_s(task)
    for panel, row in zip(panels, rows, strict=False):
        _draw_impulse_response(panel, task, row, end_s)
    for panel in panels[::columns]:
        panel.set_ylabel("response / amplitude\nof one impulse")
    upper.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False
    )
    for panel in panels[len(rows) :]:
        panel.set_visible(False)
    speed, torque = lower.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    _draw_pulse_response(speed, torque, task, rows, end_s)
    figure.suptitle(
        f"Shapers for {task.frequency_rad_s:g} rad/s, damping ratio {task.damping:g}; "
        f"relative errors ±{task.frequency_error:.3g} of frequency, "
        f"±{task.damping_error:.3g} of damping ratio (four corner cases)",
        ha="left",
        x=0.01,
    )
    return figure


def _draw_impulse_response(panel: Axes, task: ShapingTask, row: Robustness, end_s: float) -> None:
    """Draw the response to the impulses, relative to one impulse; impulses as stems."""
    t_s = np.linspace(0.0, end_s, CURVE_POINTS)
    for k, case in enumerate(task.cases):
        label = "corner cases" if k == 0 else None
        response = impulse_response(row.shaper, case, t_s)
        panel.plot(t_s, response, color=RED, lw=1.0, alpha=0.6, label=label)
    panel.plot(
        t_s,
        impulse_response(UNSHAPED, task.mode, t_s),
        color=GREY,
        lw=0.8,
        ls=":",
        label="one impulse",
    )
    panel.plot(
        t_s, impulse_response(row.shaper, task.mode, t_s), color=INK, lw=1.8, label="assumed mode"
    )
    panel.vlines(row.shaper.times_s, 0.0, row.shaper.amplitudes, color=BLUE, lw=2.5)
    panel.plot(row.shaper.times_s, row.shaper.amplitudes, "o", color=BLUE, label="impulses")
    panel.set_title(
        f"{row.name}, {len(row.shaper.times_s)} impulses: "
        f"residual <= {row.singer_seering.max():.3%}",
        fontsize=11,
    )
    style_axes(panel, xlabel="time [s]", ylabel="", zero_line=True)


def _draw_pulse_response(
    speed: Axes, torque: Axes, task: ShapingTask, rows: Sequence[Robustness], watch_s: float
) -> None:
    """Draw load speed and motor torque of the pulse_response, unshaped and with every shaper."""
    t_s = np.linspace(0.0, task.pulse_s + watch_s, CURVE_POINTS)
    curves = [("unshaped", UNSHAPED, RED)]
    for k, row in enumerate(rows):
        curves.append((row.name, row.shaper, SERIES_WITHOUT_RED[k % len(SERIES_WITHOUT_RED)]))
    for name, shaper, colour in curves:
        nominal, *cases = _pulse_responses(task, shaper, watch_s)
        values = np.array([case.load_speed.at(t_s) for case in cases])  # (4, POINTS)
        speed.fill_between(
            t_s, values.min(axis=0), values.max(axis=0), color=colour, alpha=0.18, lw=0
        )
        speed.plot(t_s, nominal.load_speed.at(t_s), color=colour, lw=1.6, label=name)
        edges = nominal.command.breaks_s
        steps = nominal.command.at((edges[1:] + edges[:-1]) / 2.0, 1)
        torque.stairs([*steps, 0.0], [*edges, t_s[-1]], baseline=0.0, color=colour, lw=1.6)
    style_axes(speed, ylabel="load speed [rad/s]", zero_line=True)
    speed.legend(frameon=False, title="bands: corner cases", loc="lower right")
    xlabel = f"time [s]; 1 N m on 1 kg m² for {task.pulse_s:g} s"
    style_axes(torque, xlabel=xlabel, ylabel="torque [N m]", zero_line=True)
    torque.use_sticky_edges = False  # keeps a margin around lines at the edges


def _pulse_responses(task: ShapingTask, shaper: Shaper, watch_s: float) -> list[PulseResponse]:
    """Compute the pulse responses of the assumed mode and of the four corner cases."""
    return [
        pulse_response(task.pulse_s, shaper, mode, watch_s) for mode in (task.mode, *task.cases)
    ]


def _damped_period_s(task: ShapingTask) -> float:
    return 2.0 * math.pi / (task.frequency_rad_s * math.sqrt(1.0 - task.damping**2))
