"""Placement of names beside the points of a chart, without overlaps where possible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

MARKER_SIZE_PT = 9.0  # width and height kept free around a point
SIDES = (  # offset [pt], horizontal and vertical alignment of the name
    ((8.0, 10.0), "left", "center"),
    ((-13.0, 0.0), "right", "center"),
    ((0.0, 15.0), "center", "bottom"),
    ((0.0, -15.0), "center", "top"),
    ((13.0, 0.0), "left", "center"),
)


def label_points(
    panel: Axes, places: Sequence[tuple[float, float]], labels: Mapping[int, tuple[str, str]]
) -> list[Annotation]:
    """Write names beside points of a chart; gives the annotations.

    places: data coordinates of all points. labels: name and colour by index of the point.
    Each name takes the side with the fewest overlaps, the first of SIDES among equals.
    Set the axis limits and draw all other artists before: the layout is computed here.
    """
    figure = panel.figure
    figure.draw_without_rendering()  # type: ignore[union-attr]  # computes the layout
    half_px = MARKER_SIZE_PT / 72.0 * figure.dpi / 2.0
    pixels = panel.transData.transform(np.asarray(places))
    size_px = 2.0 * half_px
    taken = [Bbox.from_bounds(x - half_px, y - half_px, size_px, size_px) for x, y in pixels]
    written: list[Annotation] = []
    for number, (name, colour) in labels.items():
        tries = [_write(panel, name, colour, places[number], side) for side in SIDES]
        boxes = [note.get_window_extent() for note in tries]
        overlaps = [_count_overlaps(panel, box, taken) for box in boxes]
        best = int(np.argmin(overlaps))
        for k, note in enumerate(tries):
            if k != best:
                note.remove()
        taken.append(boxes[best])
        written.append(tries[best])
    return written


def _count_overlaps(panel: Axes, box: Bbox, taken: Sequence[Bbox]) -> int:
    """Count the boxes that a box overlaps; a box that leaves the panel counts one more."""
    return sum(box.overlaps(other) for other in taken) + _is_outside(panel, box)


def _write(
    panel: Axes,
    name: str,
    colour: str,
    place: tuple[float, float],
    side: tuple[tuple[float, float], str, str],
) -> Annotation:
    offset, horizontal, vertical = side
    return panel.annotate(
        name,
        place,
        offset,
        textcoords="offset points",
        ha=horizontal,
        va=vertical,
        fontsize=9,
        color=colour,
        annotation_clip=False,
    )


def _is_outside(panel: Axes, box: Bbox) -> bool:
    inner = panel.bbox
    beside = box.x0 < inner.x0 or box.x1 > inner.x1
    above_or_below = box.y0 < inner.y0 or box.y1 > inner.y1
    return bool(beside or above_or_below)
