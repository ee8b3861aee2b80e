"""Names beside the points of a chart, where they hide no other point and no other name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

MARK = 9.0  # around a point, in points of print
SIDES = (  # offset in points of print, and how the name is set there
    ((8.0, 10.0), "left", "center"),
    ((-13.0, 0.0), "right", "center"),
    ((0.0, 15.0), "center", "bottom"),
    ((0.0, -15.0), "center", "top"),
    ((13.0, 0.0), "left", "center"),
)


def label_points(
    panel: Axes, places: Sequence[tuple[float, float]], labels: Mapping[int, tuple[str, str]]
) -> list[Annotation]:
    """Write name and colour beside the points of those numbers; where no side is free, the first one is taken.

    Limits and all other artists of the chart must be there, as the layout is done here.
    """
    figure = panel.figure
    figure.draw_without_rendering()  # type: ignore[union-attr]  # lays out
    reach = MARK / 72.0 * figure.dpi / 2.0
    pixels = panel.transData.transform(np.asarray(places))
    taken, written = (
        [Bbox.from_bounds(x - reach, y - reach, 2.0 * reach, 2.0 * reach) for x, y in pixels],
        [],
    )
    for number, (name, colour) in labels.items():
        tries = [_write(panel, name, colour, places[number], side) for side in SIDES]
        boxes = [note.get_window_extent() for note in tries]
        hidden = [
            sum(box.overlaps(other) for other in taken) + _outside(panel, box) for box in boxes
        ]
        best = int(np.argmin(hidden))
        for k, note in enumerate(tries):
            if k != best:
                note.remove()
        taken.append(boxes[best])
        written.append(tries[best])
    return written


def _write(
    panel: Axes,
    name: str,
    colour: str,
    place: tuple[float, float],
    side: tuple[tuple[float, float], str, str],
) -> Annotation:
    offset, across, up = side
    return panel.annotate(
        name,
        place,
        offset,
        textcoords="offset points",
        ha=across,
        va=up,
        fontsize=9,
        color=colour,
        annotation_clip=False,
    )


def _outside(panel: Axes, box: Bbox) -> bool:
    inner = panel.bbox
    return bool(box.x0 < inner.x0 or box.x1 > inner.x1 or box.y0 < inner.y0 or box.y1 > inner.y1)
