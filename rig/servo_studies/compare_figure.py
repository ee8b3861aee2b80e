"""The picture of a comparison: speed of the load, what is left after the move, and torque; a move a column."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.servo_studies.compare import Row

COLOURS = ("#c62828", "#1565c0", "#2e7d32", "#ef6c00", "#6a1b9a", "#00838f", "#5d4037")
GREY = "#757575"


def draw_comparison(rows: Sequence[Row]) -> Figure:
    """Rows of one truth; every controller in one colour."""
    moves = sorted({row.move for row in rows})
    names = list(dict.fromkeys(row.controller for row in rows))
    figure = Figure(figsize=(4.6 * len(moves) + 1.0, 9.5), layout="constrained")
    panels = figure.subplots(3, len(moves), sharey="row", sharex="col", squeeze=False)
    for column, move in enumerate(moves):
        chosen = [row for row in rows if row.move == move]
        _column(list(panels[:, column]), chosen, names)
        panels[0, column].set_title(f"{move}: {chosen[0].title}", fontsize=11)
        panels[2, column].set_xlabel("time [s]")
    labels = ("speed of the load [°/s]", "its error [% of the top speed]", "motor torque [N m]")
    for panel, label in zip(panels[:, 0], labels, strict=True):
        panel.set_ylabel(label)
    handles, words = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside lower center", ncols=len(words), frameon=False)
    figure.suptitle(f"truth: {rows[0].truth}; the moves are shaded", ha="left", x=0.01)
    return figure


def _column(panels: Sequence[Axes], rows: Sequence[Row], names: Sequence[str]) -> None:
    r = rows[0].recording
    panels[0].plot(r.t_s, np.degrees(r.reference_rad_s), color=GREY, lw=1.2, ls="--", label="asked")
    for row in rows:
        r, colour = row.recording, COLOURS[names.index(row.controller) % len(COLOURS)]
        top = float(np.abs(r.reference_rad_s).max())
        panels[0].plot(r.t_s, np.degrees(r.load_rad_s), color=colour, lw=1.3, label=row.controller)
        panels[1].plot(r.t_s, 100.0 * (r.load_rad_s - r.reference_rad_s) / top, color=colour, lw=1.3)
        panels[2].step(r.t_s, r.torque_n_m, color=colour, lw=1.0, where="post")
    for panel in panels:
        panel.axvspan(0.0, r.end_s, color="#00000010", lw=0)
        panel.axhline(0.0, color=GREY, lw=0.6)
        panel.grid(alpha=0.25)
        panel.spines[["top", "right"]].set_visible(False)
