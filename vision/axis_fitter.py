"""Fit of the axis of the cable to all rows of a picture: straight, bent, or with a joint."""

from __future__ import annotations

import math

import numpy as np

from vision.axis import Axis, MeasuredAxis, MeasuredRows
from vision.knee import KNEE_GAIN, MIN_LINK_SHARE, STEP_ROWS, find_knee, has_links
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
    huber_line,
    local_noise,
)
from vision.row_offsets import near_gap, row_offsets
from vision.static_scene import StaticScene
from vision.templates import CableLook, make_templates

MIN_CURVATURE_SIGMAS = 3.0  # a row with less curvature shows no cable
MAX_NEWTON_PX = 1.5  # beyond, the template covers another slope of the profile
MAX_NEWTON_BLURS = 1.5  # the same for a blurred cable
BEND_SIGMAS = 5.0  # a bend below is noise
MIN_BEND_PX = 0.02
MAX_SHAPE_ERROR_PX = 0.4  # of a parabola, for a cable that vibrates
KNEE_FACTOR = 4.0  # correlation of the rows that a parabola does not explain
KNEE_NOISES, KNEE_SCATTER_PX = 1.3, 0.005  # and not much more than the noise of a row
MIN_KNEE_SLOPE = 3e-3  # below, the row of the joint is not measured
MIN_FIRST_KNEE_SLOPE = 8e-3  # below, a joint is not told from a bend
MAX_KNEE_STEP_ROWS = 20.0


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
        if self._static is not None:
            self._static = self._static.reaching(self._templates.half_px)
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
            square = self._basis[2, rows] - axis.square_level - axis.square_slope * rows
            u = u + axis.bend_px * square
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
        low, high = self._border_px, self._width - 1 - self._border_px
        is_straight = not assumed.bend_px and assumed.knee_row is None
        ends = (float(u[0]), float(u[-1])) if is_straight else (u.min(), u.max())
        if not low < min(ends) <= max(ends) < high:
            inside = (u > low) & (u < high)
            v, u = v[inside], u[inside]
        visible = len(v)
        static_rows = 0
        if self._static is not None:
            free = self._static.is_free(v, u)
            static_rows = visible - int(np.count_nonzero(free))
            if static_rows:
                v, u = v[free], u[free]
        if len(v) < MIN_ROWS:
            return None
        offset_px, curvature = row_offsets(image, v, u, self._templates, noise)
        min_curvature = MIN_CURVATURE_SIGMAS * self._templates.second_norm * noise
        good = (np.abs(offset_px) < self._max_newton_px) & (curvature > min_curvature)
        count = int(np.count_nonzero(good))
        if count < len(v):
            good &= ~near_gap(good)
            count = int(np.count_nonzero(good))
        if count < MIN_ROWS:
            return None
        if count < len(v):
            v, offset_px, curvature = v[good], offset_px[good], curvature[good]
        if static_rows and not self._sees_upper(assumed, v):
            # the joint is hidden: these rows are those of the second link alone
            lower = Axis(assumed.lower_line)
            offset_px = offset_px + self.columns(assumed, v) - self.columns(lower, v)
            assumed = lower
        offsets = RowOffsets(offset_px, curvature)
        return self._fitted(assumed, MeasuredRows(v, offsets, visible, static_rows), noise)

    def _fitted(self, assumed: Axis, rows: MeasuredRows, noise: float) -> MeasuredAxis:
        """Fit the axis to the offsets of the rows from an assumed one."""
        v, offsets = rows.v, rows.offsets
        if assumed.knee_row is not None:
            measured = None
            if has_links(v, assumed, self._height):
                measured = self._with_knee(assumed, rows)
                if not has_links(v, measured.axis, self._height):
                    measured = None
                elif measured.correlation_factor < KNEE_FACTOR:
                    return measured
            # no joint explains these rows
            straight = Axis(assumed.line)
            whole = self._seen_from(straight, assumed, rows)
            bent = self._bent(straight, whole, huber_fit(self._basis[:, v], whole.offsets))
            if measured is not None and measured.scatter_px < bent.scatter_px:
                return measured
            return bent
        if assumed.bend_px:
            rows = self._seen_from(Axis(assumed.line), assumed, rows)
            assumed, offsets = Axis(assumed.line), rows.offsets
        part = rows.part
        fit = huber_line(self._basis[1, part], offsets)
        if not self._is_bent(part, fit):
            return self._straight(assumed, rows, fit)
        fit = huber_fit(self._basis[:, part], offsets)
        factor = correlation_factor(fit.residual_px * fit.is_near)
        if factor > KNEE_FACTOR:
            knee = self._knee(assumed, rows, fit, noise)
            if knee is not None:
                measured = self._with_knee(knee, self._seen_from(knee, assumed, rows))
                # the templates were not yet at this axis
                return measured._replace(moved_px=math.inf)
        return self._bent(assumed, rows, fit)

    def _seen_from(self, axis: Axis, assumed: Axis, rows: MeasuredRows) -> MeasuredRows:
        """Take the offsets from another axis than the assumed one."""
        change_px = self.columns(assumed, rows.v) - self.columns(axis, rows.v)
        offset_px, curvature = rows.offsets
        return rows._replace(offsets=RowOffsets(offset_px + change_px, curvature))

    def _knee(self, assumed: Axis, rows: MeasuredRows, fit: AxisFit, noise: float) -> Axis | None:
        """Look for a joint that explains the rows where a parabola does not."""
        v = rows.v[::STEP_ROWS]
        columns = self.columns(assumed, v) + rows.offsets.offset_px[::STEP_ROWS]
        knee = find_knee(v.astype(np.float64), columns)
        noise_px = noise * self._templates.first_norm / fit.curvature
        if knee is None or abs(knee.change) < MIN_FIRST_KNEE_SLOPE:
            return None
        if knee.scatter_px > min(
            KNEE_GAIN * fit.scatter_px, KNEE_NOISES * noise_px + KNEE_SCATTER_PX
        ):
            return None
        if np.count_nonzero(rows.v < knee.row) < MIN_LINK_SHARE * self._height:
            return None
        return Axis(knee.line, knee_row=knee.row, knee_slope=knee.change)

    def _sees_upper(self, axis: Axis, v: Rows) -> bool:
        """Tell if enough of the rows v (N,) are above the joint; True without one."""
        if axis.knee_row is None:
            return True
        above = int(np.count_nonzero(v < axis.knee_row))
        return above >= MIN_LINK_SHARE * self._height

    def _is_bent(self, part: slice | Rows, fit: AxisFit) -> bool:
        """Tell if the rows lie on a parabola rather than on a line."""
        t = self._basis[1, part]
        first, last = float(t[0]), float(t[-1])
        span, middle = last - first, 0.5 * (first + last)
        # a parabola without a straight part, for rows at equal distances
        parabola = self._basis[2, part] - (2.0 * middle) * t
        parabola += middle * middle - span * span / 12.0
        size = float(np.dot(parabola, parabola))
        if size <= 0.0:
            return False
        bend_px = float(np.dot(parabola * fit.is_near, fit.residual_px)) / size
        limit_px = BEND_SIGMAS * fit.scatter_px / math.sqrt(size)
        return abs(bend_px) > max(limit_px, 4.0 * MIN_BEND_PX / max(span * span, 1e-6))

    def _straight(self, assumed: Axis, rows: MeasuredRows, fit: AxisFit) -> MeasuredAxis:
        """Take a fitted straight line as the axis."""
        line, sigma = self._line(assumed, fit)
        return self._measured(rows, fit, Axis(line), sigma, self._moved_px(rows.v, fit))

    def _bent(self, assumed: Axis, rows: MeasuredRows, fit: AxisFit) -> MeasuredAxis:
        """Take a fitted parabola as the axis, with the straight line that fits its rows best."""
        used = rows.v
        bend_px = float(fit.further[0])
        # the line is that of all rows; only what is clearly off the axis has the fitted place
        is_off = ~fit.is_near & (np.abs(fit.residual_px) > MAX_SHAPE_ERROR_PX)
        offset_px = rows.offsets.offset_px - np.where(is_off, fit.residual_px, 0.0)
        axis = self._straightened(self.columns(assumed, used) + offset_px, bend_px, used)
        noise_px, factor = local_noise(fit.residual_px)
        spread = used - used.mean()
        sigma = noise_px / math.sqrt(max(float(spread @ spread), 1e-9))
        half = (used[-1] - used[0]) / self._height  # of t
        sigma_bend_px = half * half * math.sqrt(max(0.0, float(fit.covariance[2, 2])))
        measured = self._measured(rows, fit, axis, sigma, self._moved_px(rows.v, fit))
        return measured._replace(
            bend_px=-bend_px * half * half, sigma_bend_px=sigma_bend_px, correlation_factor=factor
        )

    def _with_knee(self, assumed: Axis, rows: MeasuredRows) -> MeasuredAxis:
        """Fit two links from an assumed axis with a joint; its row moves along."""
        v = rows.v
        knee_row = assumed.knee_row or 0.0
        below = np.maximum(v - knee_row, 0.0)
        basis = [*self._basis[:2, v], below / self._height]
        is_clear = abs(assumed.knee_slope) > 2.0 * MIN_KNEE_SLOPE
        if is_clear:
            basis.append((below > 0.0).astype(np.float64))
        stacked = np.stack(basis)
        fit = huber_fit(stacked, rows.offsets)
        line, sigma = self._line(assumed, fit)
        slope = assumed.knee_slope + float(fit.further[0]) / self._height
        if is_clear:
            moved_rows = -float(fit.further[1]) / assumed.knee_slope
            knee_row += min(max(moved_rows, -MAX_KNEE_STEP_ROWS), MAX_KNEE_STEP_ROWS)
            knee_row = min(max(knee_row, float(v[0])), float(v[-1]))
        variance = fit.covariance[1, 1] * 4.0 + fit.covariance[2, 2] + 4.0 * fit.covariance[1, 2]
        axis = Axis(line, knee_row=knee_row, knee_slope=slope)
        coefficients = np.array([fit.shift, fit.slope, *fit.further])
        moved_px = np.abs(coefficients @ stacked[:, [0, -1]]).max()
        measured = self._measured(rows, fit, axis, sigma, float(moved_px))
        upper = rows.v[fit.is_near & (v < knee_row)]
        last_row = int(upper[-1]) if upper.size else measured.last_row
        sigma_lower = math.sqrt(max(0.0, float(variance))) / self._height
        return measured._replace(last_row=last_row, sigma_lower_slope=sigma_lower)

    def _line(self, assumed: Axis, fit: AxisFit) -> tuple[ImageLine, float]:
        """Add the fitted line to the assumed one; t = 2 v / H - 1. Returns sigma of the slope."""
        per_row = 2.0 / self._height
        line = ImageLine(
            assumed.line.intercept_px + fit.shift - fit.slope,
            assumed.line.slope + fit.slope * per_row,
        )
        return line, per_row * math.sqrt(max(0.0, fit.variance_slope))

    def _moved_px(self, v: Rows, fit: AxisFit) -> float:
        """Compute the largest change of the column in the first and the last row."""
        moved = []
        for row in (v[0], v[-1]):
            _, t, square = self._basis[:, row].tolist()
            bend = fit.further[0] * square if fit.further.size else 0.0
            moved.append(abs(fit.shift + fit.slope * t + bend))
        return float(max(moved))

    def _measured(
        self, rows: MeasuredRows, fit: AxisFit, axis: Axis, sigma_slope: float, moved_px: float
    ) -> MeasuredAxis:
        is_near = fit.is_near
        last = len(is_near) - 1 - int(is_near[::-1].argmax())
        return MeasuredAxis(
            axis=axis,
            rows=fit.rows,
            visible_rows=rows.visible,
            static_rows=rows.static,
            first_row=int(rows.v[int(is_near.argmax())]),
            last_row=int(rows.v[last]),
            scatter_px=fit.scatter_px,
            curvature=fit.curvature,
            sigma_slope=sigma_slope,
            correlation_factor=correlation_factor(fit.residual_px * is_near),
            moved_px=moved_px,
        )

    def _straightened(self, columns: FloatArray, bend_px: float, used: Rows) -> Axis:
        """Fit a straight line to the columns of a bent axis on rows (N,), as its line."""
        rows = used.astype(np.float64)
        middle = float(rows.mean())
        spread = rows - middle
        inertia = max(float(spread @ spread), 1e-9)
        slope = float(spread @ columns) / inertia
        square = self._basis[2, used]
        lever = float(spread @ square) / inertia
        # the parabola keeps its place: the axis is that line and what t^2 differs from its own
        level = float(square.mean()) - lever * middle
        line = ImageLine(float(columns.mean()) - slope * middle, slope)
        return Axis(line, bend_px, level, lever)
