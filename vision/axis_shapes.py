"""Shapes that the axis of a cable may have near a line that was found."""

from __future__ import annotations

import numpy as np

from vision.axis import Axis
from vision.finder import Points
from vision.knee import KNEE_GAIN, MIN_LINK_SHARE, find_knee, robust_fit
from vision.line_fit import ImageLine

MIN_SHAPE_POINTS = 12


def axis_shapes(points: Points, height: int) -> list[Axis]:
    """List the shapes that points near a line may have: straight, bent, or with a joint.

    height: of the picture.
    """
    rows, columns = points.rows_px, points.columns_px
    found = [Axis(points.line)]
    if rows.size < MIN_SHAPE_POINTS:
        return found
    t = (2.0 * rows - height) / height
    bent, bent_px = robust_fit(np.stack([np.ones_like(rows), rows, t * t]), columns)
    parabola = Axis(ImageLine(float(bent[0]), float(bent[1])), float(bent[2]))
    knee = find_knee(rows, columns)
    if knee is None or knee.scatter_px >= KNEE_GAIN * bent_px:
        return [*found, parabola]
    if knee.row - rows[0] > MIN_LINK_SHARE * height:
        found.append(Axis(knee.line, knee_row=knee.row, knee_slope=knee.change))
    return [*found, parabola]
