"""Axis of the cable in a picture: straight, bent, or with a joint, fitted to all rows."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vision.finder import Found
from vision.line_fit import (
    MIN_ROWS,
    AxisFit,
    FloatArray,
    Grey,
    ImageLine,
    RowOffsets,
    Rows,
    correlation_factor,
    huber_fit,
    row_offsets,
)
from vision.static_scene import StaticScene
from vision.templates import CableLook, make_templates

MIN_CURVATURE_SIGMAS = 3.0  # a row with less curvature shows no cable
MAX_NEWTON_PX = 1.5  # beyond, the template covers another slope of the profile
MAX_NEWTON_BLURS = 1.5  # the same for a blurred cable
BEND_SIGMAS = 5.0  # a bend below is noise
MIN_BEND_PX = 0.02
KNEES = 24  # places at which a joint is tried
MIN_SEGMENT_POINTS = 6
KNEE_GAIN = 0.3  # a joint must leave less of the scatter than a bend does
MIN_KNEE_SLOPE = 3e-3


class Axis(NamedTuple):
    """Axis in the image: u = line + bend_px (t^2 - t0) with t = (2 v - H) / H, or with a joint.

    line: the straight line that fits the axis best, of the first link if there is a joint.
    """

    line: ImageLine
    bend_px: float = 0.0  # coefficient of t^2
    knee_row: float | None = None  # row of a joint between two links
    knee_slope: float = 0.0  # change of the slope there


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
    sigma_lower_slope: float
    bend_px: float  # of the middle from the chord, positive to the right
    sigma_bend_px: float
    correlation_factor: float  # of the variance, by the correlation of the rows
    moved_px: float  # from the assumed axis, at the first and the last row


class AxisFitter:
    """Newton steps of all rows from an assumed axis."""

    def __init__(
        self, width: int, height: int, look: CableLook, static: StaticScene | None
    ) -> None:
        self._width, self._height = width, height
        self._static = static
        self._all_rows = np.arange(height)
        t = (2.0 * self._all_rows - height) / height
        self._basis = np.stack([np.ones(height), t, t * t])
        self.change_look(look)

    def change_look(self, look: CableLook) -> None:
        """Use the templates of another cable."""
        self.look = look
        self._templates = make_templates(look)
        self._border_px = self._templates.half_px + 1
        self._max_newton_px = max(MAX_NEWTON_PX, MAX_NEWTON_BLURS * look.blur_px)

    @property
    def first_norm(self) -> float:
        """Noise of the first derivative per grey level of noise."""
        return self._templates.first_norm

    def columns(self, axis: Axis, rows: Rows) -> FloatArray:
        """Compute the columns of an axis on rows (N,)."""
        u = axis.line.at(rows.astype(np.float64))
        if axis.bend_px:
            u = u + axis.bend_px * self._basis[2, rows]
        if axis.knee_row is not None:
            u = u + axis.knee_slope * np.maximum(rows - axis.knee_row, 0.0)
        return u

    def measure(
        self, image: Grey, noise: float, assumed: Axis, first_row: int
    ) -> MeasuredAxis | None:
        """Take a Newton step of every row from first_row on; None if too few show a cable."""
        v = self._all_rows[first_row:]
        if len(v) < MIN_ROWS:
            return None
        u = self.columns(assumed, v)
        inside = (u > self._border_px) & (u < self._width - 1 - self._border_px)
        visible = len(v)
        if not inside.all():
            v, u = v[inside], u[inside]
            visible = len(v)
            if visible < MIN_ROWS:
                return None
        static_rows = 0
        if self._static is not None:
            free = self._static.is_free(v, u)
            if not free.all():
                static_rows = visible - int(np.count_nonzero(free))
                v, u = v[free], u[free]
        if len(v) < MIN_ROWS:
            return None
        offset_px, curvature = row_offsets(image, v, u, self._templates)
        min_curvature = MIN_CURVATURE_SIGMAS * self._templates.second_norm * noise
        good = (np.abs(offset_px) < self._max_newton_px) & (curvature > min_curvature)
        count = int(np.count_nonzero(good))
        if count < MIN_ROWS:
            return None
        if count < len(v):
            v, offset_px, curvature = v[good], offset_px[good], curvature[good]
        return self._fitted(assumed, v, RowOffsets(offset_px, curvature), visible, static_rows)

    def _fitted(
        self, assumed: Axis, v: Rows, offsets: RowOffsets, visible: int, static_rows: int
    ) -> MeasuredAxis:
        """Fit the axis to the offsets of rows v (N,) from an assumed one."""
        straight = self._basis[:2, v]
        fit = huber_fit(straight, offsets)
        third: FloatArray | None = None
        if assumed.knee_row is not None:
            third = np.maximum(v - assumed.knee_row, 0.0)
        elif assumed.bend_px or self._is_bent(v, fit):
            third = self._basis[2, v]
        if third is not None:
            fit = huber_fit(np.concatenate([straight, third[None]]), offsets)
        return self._measured(assumed, v, fit, visible, static_rows)

    def _is_bent(self, v: Rows, fit: AxisFit) -> bool:
        """Tell if the rows lie on a parabola rather than on a line."""
        t = self._basis[1, v]
        span = float(t[-1] - t[0])
        middle = 0.5 * float(t[-1] + t[0])
        # a parabola without a straight part, for rows at equal distances
        parabola = np.square(t - middle) - span * span / 12.0
        weight = parabola * fit.is_near
        size = float(np.dot(weight, parabola))
        if size <= 0.0:
            return False
        bend_px = float(np.dot(weight, fit.residual_px)) / size
        limit_px = BEND_SIGMAS * fit.scatter_px / math.sqrt(size)
        return abs(bend_px) > max(limit_px, 4.0 * MIN_BEND_PX / max(span * span, 1e-6))

    def _measured(
        self, assumed: Axis, v: Rows, fit: AxisFit, visible: int, static_rows: int
    ) -> MeasuredAxis:
        used = v[fit.is_near]
        if used.size == 0:
            used = v
        first, last = int(used[0]), int(used[-1])
        per_row = 2.0 / self._height  # of t
        shift, slope_t = float(fit.coefficients[0]), float(fit.coefficients[1])
        # t = 2 v / H - 1
        line = ImageLine(
            assumed.line.intercept_px + shift - slope_t, assumed.line.slope + slope_t * per_row
        )
        third = float(fit.coefficients[2]) if len(fit.coefficients) > 2 else 0.0
        variance = float(fit.covariance[1, 1]) * per_row**2
        axis = Axis(line)
        bend_px = sigma_bend_px = sigma_lower = 0.0
        if assumed.knee_row is not None:
            axis = Axis(line, 0.0, assumed.knee_row, assumed.knee_slope + third)
            sigma_lower = math.sqrt(variance + float(fit.covariance[2, 2]))
        elif len(fit.coefficients) > 2:
            whole = assumed.bend_px + third
            axis, lever = self._straightened(line, whole, used)
            # of the slope: that of t plus what the parabola adds to the best straight line
            gain = np.array([0.0, per_row, lever])
            variance = float(gain @ fit.covariance @ gain)
            half = 0.5 * (last - first) * per_row
            bend_px = -whole * half * half
            sigma_bend_px = half * half * math.sqrt(max(0.0, float(fit.covariance[2, 2])))
        moved = [abs(self._change(fit, assumed, row)) for row in (int(v[0]), int(v[-1]))]
        return MeasuredAxis(
            axis,
            fit.rows,
            visible,
            static_rows,
            first,
            last,
            fit.scatter_px,
            fit.curvature,
            math.sqrt(max(0.0, variance)),
            sigma_lower,
            bend_px,
            sigma_bend_px,
            correlation_factor(fit.residual_px[fit.is_near]),
            max(moved),
        )

    def _change(self, fit: AxisFit, assumed: Axis, row: int) -> float:
        """Compute the change of the column in a row."""
        basis = self._basis[: len(fit.coefficients), row].copy()
        if assumed.knee_row is not None and len(basis) > 2:
            basis[2] = max(row - assumed.knee_row, 0.0)
        return float(basis @ fit.coefficients)

    def _straightened(self, line: ImageLine, bend_px: float, used: Rows) -> tuple[Axis, float]:
        """Split a parabola into the straight line that fits it best over rows (N,), and the rest.

        Returns the axis, whose line is that one, and the slope [1/row] that a coefficient of 1 of
        t^2 adds to it.
        """
        rows = used.astype(np.float64)
        middle = float(rows.mean())
        square = self._basis[2, used]
        spread = rows - middle
        lever = float(spread @ square) / max(float(spread @ spread), 1e-9)
        level = float(square.mean()) - lever * middle
        best = ImageLine(line.intercept_px + bend_px * level, line.slope + bend_px * lever)
        return Axis(best, bend_px), lever

    def shape(self, found: Found) -> Axis | None:
        """Choose a bent axis, or one with a joint, through points found near a line."""
        rows, columns = found.rows_px, found.columns_px
        if rows.size < 2 * MIN_SEGMENT_POINTS:
            return None
        ones = np.ones_like(rows)
        t = (2.0 * rows - self._height) / self._height
        bent, bent_px = _robust(np.stack([ones, rows, t * t]), columns)
        best: Axis | None = None
        best_px = math.inf
        for knee in np.linspace(rows[0], rows[-1], KNEES + 2)[1:-1]:
            upper = int(np.count_nonzero(rows < knee))
            if min(upper, rows.size - upper) < MIN_SEGMENT_POINTS:
                continue
            hinge = np.maximum(rows - knee, 0.0)
            q, scatter_px = _robust(np.stack([ones, rows, hinge]), columns)
            if scatter_px < best_px and abs(q[2]) > MIN_KNEE_SLOPE:
                best_px = scatter_px
                best = Axis(ImageLine(float(q[0]), float(q[1])), 0.0, float(knee), float(q[2]))
        if best is not None and best_px < KNEE_GAIN * bent_px:
            return best
        return Axis(ImageLine(float(bent[0]), float(bent[1])), float(bent[2]))


def _robust(basis: FloatArray, y: FloatArray) -> tuple[FloatArray, float]:
    """Fit y (N,) by basis (P, N) with few outliers; return coefficients and median |residual|."""
    weight = np.ones_like(y)
    found = np.zeros(len(basis))
    residual = y
    for scale_px in (20.0, 4.0, 1.0, 0.5):
        scaled = basis * np.sqrt(weight)
        found = np.linalg.lstsq(scaled.T, y * np.sqrt(weight), rcond=None)[0]
        residual = y - found @ basis
        weight = 1.0 / np.square(1.0 + np.square(residual / scale_px))
    return found, float(np.median(np.abs(residual)))
