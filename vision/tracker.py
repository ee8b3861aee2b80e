"""Cable tracker: angle of a dark cable before a bright screen, from one image.

With a prediction: Newton steps of every row from the predicted axis. Without a prediction, or if
the rows do not agree: a search of the whole image, then the same steps from the line found. The
result is a line with free intercept; the predicted pivot only selects which line is the cable.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator

import numpy as np

from vision.axis import Axis, MeasuredAxis
from vision.axis_fitter import AxisFitter
from vision.axis_shapes import axis_shapes
from vision.errors import VisionError
from vision.finder import Finder, Found
from vision.fit import Fit, LowerLink, TrackFailure
from vision.fit_check import CLEAR_FACTOR, judge, lower_link
from vision.line_fit import MIN_ROWS, Grey, ImageLine
from vision.profile_look import measure_look
from vision.ridge import CLEAR_ROWS, Levels, grey_levels
from vision.rivals import RivalWatch
from vision.static_scene import StaticScene
from vision.templates import CableLook

__all__ = ["Fit", "LowerLink", "TrackFailure", "Tracker"]

SEARCH_SCALES = (1, 2, 4, 8)  # a cable of some 2, 5, 10 and 20 px is 3 px wide at these
NEWTON_STEPS = 3  # of all rows
COLD_NEWTON_STEPS = 6  # from a line that was searched
CONVERGED_PX = 0.15  # a last step shorter than this leaves an error below 0.001 px
MIN_DIRECT_SHARE = 0.9  # of the rows below the pivot; they must agree while following
MAX_MEAN_FACTOR = 20.0
MIN_SIZE_PX = 64
LOOK_ROW_STEP = 2  # of the rows that show width and blur
LOOK_CHANGE_REL = 0.15  # a template that differs less is kept
FACTOR_WEIGHT = 0.1  # of the newest frame in the mean correlation of the rows
# weights of the last angles in the predicted one, newest first, by the number of angles
EXTRAPOLATION_WEIGHTS = ((), (1.0,), (2.0, -1.0), (3.0, -3.0, 1.0))


class Tracker:
    """Tracker of the cable in images of one size; predicts its angle from the last three.

    look: width and blur of the cable; measured in the first image that shows it if None. static:
    what never moves in the pictures, which is not taken for the cable.
    """

    def __init__(
        self,
        width: int,
        height: int,
        look: CableLook | None = None,
        static: StaticScene | None = None,
    ) -> None:
        if min(width, height) < MIN_SIZE_PX:
            raise VisionError(
                f"picture of {width} x {height} px; must be at least {MIN_SIZE_PX} x {MIN_SIZE_PX} "
                "px: use a camera or video with a larger image"
            )
        self.width = width
        self.height = height
        self._is_look_known = look is not None
        self._fitter = AxisFitter(width, height, look or CableLook(), static)
        self._static = static
        scales = [s for s in SEARCH_SCALES if min(width, height) >= s * MIN_SIZE_PX]
        self._finders = {s: Finder(width, height, s) for s in scales}
        self._scales = scales
        self._rivals = RivalWatch(width, height)
        self._factor = 1.0  # of the variance, by the correlation of the rows
        self.forget()

    @property
    def look(self) -> CableLook:
        """Width and blur of the templates in use."""
        return self._fitter.look

    def forget(self) -> None:
        """Clear the angle history; the next image is searched as a whole."""
        self._angles_rad: tuple[float, ...] = ()  # newest first
        self._axis: Axis | None = None  # the last one
        self._axis_before: Axis | None = None
        self._pivot_miss_px = 0.0

    def measure(
        self, image: Grey, pivot_px: tuple[float, float], predicted_angle_rad: float | None = None
    ) -> Fit:
        """Measure the angle of the cable in image (height, width) uint8.

        pivot_px: predicted upper end (u, v) of the cable. Without predicted_angle_rad the last
        three angles are extrapolated at constant acceleration. Never raises: an image of another
        size or type is BAD_IMAGE.
        """
        if image.shape != (self.height, self.width) or image.dtype != np.uint8:
            self.forget()
            return Fit(reason=TrackFailure.BAD_IMAGE)
        image = np.ascontiguousarray(image)
        levels = grey_levels(image)
        predicted = self._predict(pivot_px, predicted_angle_rad)
        fit = None
        if predicted is not None:
            fit = self._follow(image, levels, predicted, pivot_px)
        if fit is None or not fit.valid:
            # after a missed prediction the velocity is not known either
            self._angles_rad = self._angles_rad[:1]
            fit = self._search(image, levels, pivot_px)
        self._store(fit)
        return fit

    def _predict(self, pivot_px: tuple[float, float], angle_rad: float | None) -> Axis | None:
        if angle_rad is None:
            if not self._angles_rad:
                return None
            weights = EXTRAPOLATION_WEIGHTS[len(self._angles_rad)]
            angle_rad = sum(map(operator.mul, self._angles_rad, weights))
        slope = math.tan(angle_rad)
        line = ImageLine(pivot_px[0] + self._pivot_miss_px - slope * pivot_px[1], slope)
        if self._axis is None:
            return Axis(line)
        return self._axis.extrapolated(self._axis_before)._replace(line=line)

    def _store(self, fit: Fit) -> None:
        if fit.angle_rad is None or fit.pivot_miss_px is None:
            self.forget()
            return
        self._angles_rad = (fit.angle_rad, *self._angles_rad[:2])
        self._pivot_miss_px = fit.pivot_miss_px

    def _follow(
        self, image: Grey, levels: Levels, axis: Axis, pivot_px: tuple[float, float]
    ) -> Fit | None:
        """Fit the cable from a predicted axis; None if the rows do not agree on one."""
        measured = self._refine(image, levels, axis, pivot_px, MIN_DIRECT_SHARE)
        if measured is None:
            return None
        fit = self._check(measured, levels, pivot_px)
        if fit.valid and self._rivals.is_rivalled(image, levels, measured, pivot_px, self._static):
            return _failed(TrackFailure.AMBIGUOUS, levels)
        return fit

    def _refine(
        self,
        image: Grey,
        levels: Levels,
        axis: Axis,
        pivot_px: tuple[float, float],
        min_share: float,
    ) -> MeasuredAxis | None:
        """Take Newton steps of the rows below the pivot from an assumed axis.

        None if fewer than a share of the rows agree.
        """
        first_row = max(0, math.floor(pivot_px[1]) + CLEAR_ROWS + 1)
        rows = self.height - first_row
        measured = None
        for _ in range(NEWTON_STEPS if min_share else COLD_NEWTON_STEPS):
            measured = self._fitter.measure(image, levels.noise, axis, first_row)
            if measured is None or measured.rows < min_share * min(rows, measured.visible_rows):
                return None
            moved_px = measured.moved_px
            axis = measured.axis
            if moved_px < CONVERGED_PX:
                break
        return measured

    def _search(self, image: Grey, levels: Levels, pivot_px: tuple[float, float]) -> Fit:
        """Search the whole image, at the scale of the cable first."""
        seen = image if self._static is None else self._static.without(image)
        best: Fit | None = None
        for scale in self._scales:
            found = self._finders[scale].find(seen, pivot_px, levels)
            if found is None:
                continue
            fit = self._fit_found(image, levels, found, pivot_px, scale)
            if fit.valid:
                self._scales = [scale, *(s for s in self._scales if s != scale)]
                return fit
            best = best or fit
        if best is not None:
            return best
        is_flat = int(image.min()) == int(image.max())
        return _failed(TrackFailure.BAD_IMAGE if is_flat else TrackFailure.NO_CABLE, levels)

    def _fit_found(
        self, image: Grey, levels: Levels, found: Found, pivot_px: tuple[float, float], scale: int
    ) -> Fit:
        """Fit the axis from a line found at a scale, straight or of another shape."""
        if not self._is_look_known:
            guess = CableLook(2.5 * scale, max(0.85, 0.5 * scale))
            self._learn_look(image, Axis(found.line), pivot_px, guess)
        measured = self._refine(image, levels, Axis(found.line), pivot_px, 0.0)
        fit = self._checked(measured, levels, pivot_px)
        others = self._other_axes(image, levels, found, pivot_px, scale)
        while not _is_whole(measured, fit) and (axis := next(others, None)) is not None:
            if not self._is_look_known:
                self._learn_look(image, axis, pivot_px, CableLook(2.5 * scale, 0.5 + 0.5 * scale))
            other = self._refine(image, levels, axis, pivot_px, 0.0)
            again = self._checked(other, levels, pivot_px)
            if again.valid and (not fit.valid or again.rows > fit.rows):
                measured, fit = other, again
        if not fit.valid or measured is None:
            return fit
        if not self._is_look_known:
            # once more, around the axis itself
            look = self._fitter.look
            self._is_look_known = self._learn_look(image, measured.axis, pivot_px, look)
        is_rivalled = self._rivals.is_rivalled(image, levels, measured, pivot_px, self._static)
        if found.ambiguous or is_rivalled:
            return _failed(TrackFailure.AMBIGUOUS, levels)
        return fit

    def _other_axes(
        self, image: Grey, levels: Levels, found: Found, pivot_px: tuple[float, float], scale: int
    ) -> Iterator[Axis]:
        """Generate axes to try where the line found is not the whole cable.

        Those through points near it, then the parallel through the pivot: a shadow may be darker
        than the cable.
        """
        points = self._finders[scale].points(image, found.line, pivot_px, levels)
        if points is not None:
            yield from axis_shapes(points, self.height)
        slope = found.line.slope
        yield Axis(ImageLine(pivot_px[0] - slope * pivot_px[1], slope))

    def _learn_look(
        self, image: Grey, axis: Axis, pivot_px: tuple[float, float], guess: CableLook
    ) -> bool:
        """Measure width and blur around an axis, and change the templates; False if unclear."""
        first = max(0, math.ceil(pivot_px[1]) + CLEAR_ROWS)
        rows = np.arange(first, self.height, LOOK_ROW_STEP)
        if rows.size < MIN_ROWS:
            return False
        columns = self._fitter.columns(axis, rows)
        look = measure_look(image, rows.astype(np.float64), columns, axis.line.slope, guess)
        if look is None:
            return False
        now = self._fitter.look
        changes = (abs(a / b - 1.0) for a, b in zip(look, now, strict=True))
        if max(changes) > LOOK_CHANGE_REL:
            self._fitter.change_look(look)
        return True

    def _checked(
        self, measured: MeasuredAxis | None, levels: Levels, pivot_px: tuple[float, float]
    ) -> Fit:
        if measured is None:
            return _failed(TrackFailure.FEW_ROWS, levels)
        return self._check(measured, levels, pivot_px)

    def _sigma_rad(self, measured: MeasuredAxis) -> float:
        """Compute the standard deviation of the angle, with the correlation of the rows."""
        factor = max(1.0, self._factor)
        if measured.correlation_factor > CLEAR_FACTOR:
            factor = max(factor, measured.correlation_factor)
        return measured.sigma_slope * math.sqrt(factor) / (1.0 + measured.axis.line.slope**2)

    def _check(self, measured: MeasuredAxis, levels: Levels, pivot_px: tuple[float, float]) -> Fit:
        line = measured.axis.line
        miss_px = line.at(pivot_px[1]) - pivot_px[0]
        sigma_rad = self._sigma_rad(measured)
        noise_px = levels.noise * self._fitter.first_norm / measured.curvature
        reason = judge(measured, self.height, miss_px, sigma_rad, noise_px)
        valid = reason is TrackFailure.NONE
        if valid:
            self._axis_before, self._axis = self._axis, measured.axis
            factor = min(measured.correlation_factor, MAX_MEAN_FACTOR)
            self._factor += FACTOR_WEIGHT * (factor - self._factor)
        return Fit(
            angle_rad=math.atan(line.slope) if valid else None,
            sigma_rad=sigma_rad if valid else None,
            reason=reason,
            rows=measured.rows,
            residual_px=measured.scatter_px,
            pivot_miss_px=miss_px,
            background=levels.background,
            saturation=levels.saturation,
            line_px=(line.intercept_px, line.slope),
            first_row=measured.first_row,
            last_row=measured.last_row,
            bend_px=measured.bend_px,
            sigma_bend_px=measured.sigma_bend_px,
            lower=lower_link(measured) if valid else None,
        )


def _is_whole(measured: MeasuredAxis | None, fit: Fit) -> bool:
    """Tell if nearly all rows agree on a valid axis."""
    return fit.valid and measured is not None and measured.is_whole(MIN_DIRECT_SHARE)


def _failed(reason: TrackFailure, levels: Levels) -> Fit:
    return Fit(reason=reason, background=levels.background, saturation=levels.saturation)
