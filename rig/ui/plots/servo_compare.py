"""The picture of a comparison: speed of the load, its error, a close look after the move, and torque; a move a column."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.studies.servo.compare import ControllerRun
from rig.ui.plots.servo_shaping import BARE, COLOURS, GREY

BEFORE_S = 0.03  # shown before a move, and before its end in the close look
AFTER_S = 0.2  # shown after its end in the close look
LABELS = (
    "speed of the load [°/s]",
    "its error [% of the top speed]",
    "after the move [% of the top speed]",
    "motor torque [N m]",
)


def draw_comparison(rows: Sequence[ControllerRun]) -> Figure:
    """Rows of one truth; every controller in a colour of its own."""
    moves = sorted({row.move for row in rows})
    colours = dict(
        zip(dict.fromkeys(row.controller for row in rows), (BARE, *COLOURS), strict=False)
    )
    figure = Figure(figsize=(4.6 * len(moves) + 1.0, 12.0), layout="constrained")
    panels = figure.subplots(len(LABELS), len(moves), sharey="row", squeeze=False)
    for column, move in enumerate(moves):
        chosen = [row for row in rows if row.move == move]
        _column(list(panels[:, column]), chosen, colours)
        panels[0, column].set_title(f"{move}: {chosen[0].title}", fontsize=11)
        panels[-1, column].set_xlabel("time [s]")
    for panel, label in zip(panels[:, 0], LABELS, strict=True):
        panel.set_ylabel(label)
    handles, words = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside lower center", ncols=len(words), frameon=False)
    figure.suptitle(f"truth: {rows[0].plant_variant}; the moves are shaded", ha="left", x=0.01)
    return figure


def _column(panels: Sequence[Axes], rows: Sequence[ControllerRun], colours: dict[str, str]) -> None:
    r = rows[0].recording
    panels[0].plot(
        r.t_s, np.degrees(r.reference_rad_s), color=GREY, lw=1.2, ls="--", label="reference"
    )
    for row in rows:
        r, colour = row.recording, colours[row.controller]
        percent = 100.0 / float(np.abs(r.reference_rad_s).max())
        near = (r.t_s >= r.end_s - BEFORE_S) & (r.t_s <= r.end_s + AFTER_S)
        panels[0].plot(r.t_s, np.degrees(r.load_rad_s), color=colour, lw=1.3, label=row.controller)
        panels[1].plot(r.t_s, percent * (r.load_rad_s - r.reference_rad_s), color=colour, lw=1.3)
        panels[2].plot(r.t_s[near], percent * r.load_rad_s[near], color=colour, lw=1.5)
        panels[3].step(r.t_s, r.torque_n_m, color=colour, lw=1.0, where="post")
    ends = [(-BEFORE_S, float(r.t_s[-1]))] * 2 + [
        (r.end_s - BEFORE_S, r.end_s + AFTER_S),
        (-BEFORE_S, float(r.t_s[-1])),
    ]
    for panel, (low, high) in zip(panels, ends, strict=True):
        panel.axvspan(max(0.0, low), r.end_s, color="#00000010", lw=0)
        panel.set_xlim(low, high)
        panel.axhline(0.0, color=GREY, lw=0.6)
        panel.grid(alpha=0.25)
        panel.spines[["top", "right"]].set_visible(False)
    panels[2].set_ylim(-12.0, 12.0)
