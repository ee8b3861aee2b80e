"""Figure of a first look at a video: median picture, lines, pivot and static lines."""

from __future__ import annotations

from matplotlib.figure import Figure

from rig.ui.plots.style import GREEN, ORANGE, RED
from vision.first_look import Look

MARGIN_PX = 20.0


def look_figure(look: Look) -> Figure:
    """Draw what a first look found, in pixels of the view."""
    height, width = look.median.shape
    figure = Figure(figsize=(7.0, 7.0 * min(max(height / width, 0.5), 1.6)))
    axes = figure.add_subplot()
    axes.imshow(look.median, cmap="gray", vmin=0, vmax=255)
    label = "line of the cable"
    for item in look.lines:
        if item is None:
            continue
        line, rows = item.measured.line, (item.fit.first_row, item.fit.last_row)
        axes.plot([line.at(float(v)) for v in rows], rows, color=GREEN, lw=0.8, label=label)
        label = "_"
    label = "line that never moves"
    for still in look.static_lines:
        rows = (still.first_row, still.last_row)
        axes.plot([still.line.at(float(v)) for v in rows], rows, color=RED, lw=1.5, label=label)
        label = "_"
    if look.bob is not None:
        seen = [blob for blob in look.bob.blobs if blob is not None]
        places = [blob.u for blob in seen], [blob.v for blob in seen]
        axes.plot(*places, ".", color=GREEN, label="centroid of the bob")
    top, bottom = 0.0, float(height)
    if look.pivot is not None:
        x, y = look.pivot.at_px
        axes.plot([x], [y], "+", color=ORANGE, ms=12, mew=2, label=f"pivot {x:.1f},{y:.1f}")
        top, bottom = min(top, y - MARGIN_PX), max(bottom, y + MARGIN_PX)
    axes.set_xlim(0, width)
    axes.set_ylim(bottom, top)
    axes.set_xlabel("column [px]")
    axes.set_ylabel("row [px]")
    axes.set_title(f"{look.subject.value}, {look.view.plane} plane", fontsize=9)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc="lower right", fontsize=8)
    figure.tight_layout()
    return figure
