"""Figure of a controller comparison: load speed, speed error and motor torque of each move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.studies.servo.compare import ControllerRun
from rig.ui.plots.style import GREY, RED, SERIES_WITHOUT_RED, SHADE, style_axes

BEFORE_S = 0.03  # time shown before a move, and before its end in the detail panel
AFTER_S = 0.2  # time shown after the end of the move in the detail panel
DETAIL_RANGE_PERCENT = 12.0  # of the detail panel, relative to the top speed
LABELS = (
    "load speed [°/s]",
    "speed error [% of top speed]",
    "load speed after the move\n[% of top speed]",
    "motor torque [N m]",
)


def draw_comparison(rows: Sequence[ControllerRun]) -> Figure:
    """Draw the runs of one plant variant: one column a move, one colour a controller."""
    moves = sorted({row.move for row in rows})
    controllers = dict.fromkeys(row.controller for row in rows)
    colours = dict(zip(controllers, (RED, *SERIES_WITHOUT_RED), strict=False))
    figure = Figure(figsize=(4.6 * len(moves) + 1.0, 12.0), layout="constrained")
    panels = figure.subplots(len(LABELS), len(moves), sharey="row", squeeze=False)
    for column, move in enumerate(moves):
        chosen = [row for row in rows if row.move == move]
        _draw_column(list(panels[:, column]), chosen, colours)
        panels[0, column].set_title(f"{move}: {chosen[0].title}", fontsize=11)
        panels[-1, column].set_xlabel("time [s]")
    for panel, label in zip(panels[:, 0], LABELS, strict=True):
        panel.set_ylabel(label)
    handles, words = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside lower center", ncols=len(words), frameon=False)
    figure.suptitle(f"plant variant: {rows[0].plant_variant}; moves shaded", ha="left", x=0.01)
    return figure


def _draw_column(
    panels: Sequence[Axes], rows: Sequence[ControllerRun], colours: dict[str, str]
) -> None:
    """Draw all runs of one move."""
    r = rows[0].recording
    panels[0].plot(
        r.t_s, np.degrees(r.reference_rad_s), color=GREY, lw=1.2, ls="--", label="reference"
    )
    for row in rows:
        r = row.recording
        colour = colours[row.controller]
        percent = 100.0 / float(np.abs(r.reference_rad_s).max())
        near = (r.t_s >= r.end_s - BEFORE_S) & (r.t_s <= r.end_s + AFTER_S)
        panels[0].plot(r.t_s, np.degrees(r.load_rad_s), color=colour, lw=1.3, label=row.controller)
        panels[1].plot(r.t_s, percent * (r.load_rad_s - r.reference_rad_s), color=colour, lw=1.3)
        panels[2].plot(r.t_s[near], percent * r.load_rad_s[near], color=colour, lw=1.5)
        panels[3].step(r.t_s, r.torque_n_m, color=colour, lw=1.0, where="post")
    whole = (-BEFORE_S, float(r.t_s[-1]))
    detail = (r.end_s - BEFORE_S, r.end_s + AFTER_S)
    for panel, (low, high) in zip(panels, (whole, whole, detail, whole), strict=True):
        panel.axvspan(max(0.0, low), r.end_s, color=SHADE, lw=0)
        panel.set_xlim(low, high)
        style_axes(panel, zero_line=True)
    panels[2].set_ylim(-DETAIL_RANGE_PERCENT, DETAIL_RANGE_PERCENT)
