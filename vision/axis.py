"""Axis of the cable in a picture: straight, bent, or with a joint."""

from __future__ import annotations

from typing import NamedTuple

from vision.line_fit import ImageLine, RowOffsets, Rows


class Axis(NamedTuple):
    """Axis in the image: u = line + bend_px (t^2 - a - b v), t = (2 v - H) / H, or with a joint.

    line: the straight line that fits the axis best, of the first link if there is a joint.
    """

    line: ImageLine
    bend_px: float = 0.0  # coefficient of t^2
    # straight line that fits t^2 best over the rows, which is taken from it
    square_level: float = 0.0
    square_slope: float = 0.0
    knee_row: float | None = None  # row of a joint between two links
    knee_slope: float = 0.0  # change of the slope there

    @property
    def is_bent(self) -> bool:
        """True if it is not a straight line."""
        return bool(self.bend_px) or self.knee_row is not None

    @property
    def lower_line(self) -> ImageLine:
        """Straight line of the second link; that of the axis where it has no joint."""
        if self.knee_row is None:
            return self.line
        slope = self.line.slope + self.knee_slope
        return ImageLine(self.line.at(self.knee_row) - slope * self.knee_row, slope)

    def extrapolated(self, before: Axis | None) -> Axis:
        """Predict the shape of the next axis from the last two, where both have a joint."""
        if before is None or self.knee_row is None or before.knee_row is None:
            return self
        return self._replace(knee_slope=2.0 * self.knee_slope - before.knee_slope)


class MeasuredAxis(NamedTuple):
    """Axis fitted to the rows of a picture."""

    axis: Axis
    rows: int  # in the fit
    visible_rows: int  # below the pivot and in the picture
    static_rows: int  # left out because something that never moves is there
    first_row: int
    last_row: int
    scatter_px: float
    curvature: float  # rms [grey/px^2]
    sigma_slope: float
    correlation_factor: float  # of the variance, by the correlation of the rows
    moved_px: float  # from the assumed axis, at the first and the last row
    sigma_lower_slope: float = 0.0
    bend_px: float = 0.0  # of the middle from the chord, positive to the right
    sigma_bend_px: float = 0.0

    def is_whole(self, share: float) -> bool:
        """Tell if a share of the visible rows agrees."""
        return self.rows >= share * self.visible_rows


class MeasuredRows(NamedTuple):
    """Rows of a picture in which the cable was measured."""

    v: Rows  # (N,)
    offsets: RowOffsets  # from the assumed axis
    visible: int  # rows below the pivot and in the picture
    static: int  # of those, left out

    @property
    def part(self) -> slice | Rows:
        """Selection of the rows of an array of all rows, as a view where they are neighbours."""
        first, last = int(self.v[0]), int(self.v[-1])
        return slice(first, last + 1) if last - first + 1 == len(self.v) else self.v
