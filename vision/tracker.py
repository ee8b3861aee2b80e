"""Cable tracker: angle of a thin dark cable before a bright screen, from one image.

With a prediction: Newton steps of every row from the predicted line; if the rows do not agree, a
fit in the strip around it. Without a prediction, or if the strip gives no line: a search of the
whole image, then the same steps from the line found. The result is a line with free intercept; the
predicted pivot only selects which line is the cable.
"""

from __future__ import annotations

import enum
import math
import operator
from dataclasses import dataclass

import cv2
import numpy as np

from vision.errors import VisionError
from vision.line_fit import (
    FIRST_NORM,
    MIN_ROWS,
    SECOND_NORM,
    TEMPLATE_HALF_PX,
    FloatArray,
    Grey,
    ImageLine,
    LineFit,
    RowOffsets,
    Rows,
    coarse_line,
    huber_line,
    pixel_runs,
    refined_columns,
    row_offsets,
)
from vision.ridge import (
    CLEAR_ROWS,
    FLANK_PX,
    SLOPE_LIMIT,
    Levels,
    grey_levels,
    line_response,
    search,
)

STRIP_PX = 40  # the cable may be 14 px from the prediction: 27 mrad at the bottom of the image
ROW_GROUP = np.arange(4)  # the coarse line uses one row in four, the fit all of them
MIN_RESPONSE_SIGMAS = 3.0  # line response of a dark pixel; noise exceeds it in 1 of 1,000 pixels
MIN_CURVATURE_SIGMAS = 3.0  # a row with less curvature shows no cable
MAX_COARSE_PX = 3.0  # distance of a row from the coarse line; a wide cable is flat in its middle
BORDER_PX = TEMPLATE_HALF_PX + len(ROW_GROUP)  # columns of template and row group at 45 degrees
NEWTON_STEPS = 2  # of all rows; without convergence the strip is used
CONVERGED_PX = 0.15  # a last step shorter than this leaves an error below 0.001 px
MIN_DIRECT_SHARE = 0.9  # of the rows below the pivot; they must agree on the line
MAX_NEWTON_PX = 1.5  # beyond, the template covers another slope of the profile
MAX_PIVOT_MISS_PX = 5.0  # a line farther from the predicted pivot is not the cable
MIN_ROWS_SHARE = 0.12  # of the image height; fewer rows are too short for a slope
# a fit is poor if its scatter exceeds both
MAX_SCATTER_PX = 0.3
MAX_SCATTER_SIGMAS = 3.0  # of the noise
MIN_SIZE_PX = 64
# weights of the last angles in the predicted one, newest first, by the number of angles
EXTRAPOLATION_WEIGHTS = ((), (1.0,), (2.0, -1.0), (3.0, -3.0, 1.0))


class TrackFailure(enum.Enum):
    """Reason why an image gives no angle; the values are those of InvalidReason."""

    NONE = "none"
    NO_CABLE = "no_cable"
    FEW_ROWS = "few_rows"
    PIVOT_MISSED = "pivot_missed"
    AMBIGUOUS = "ambiguous"
    POOR_FIT = "poor_fit"
    BAD_IMAGE = "bad_image"


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Result of one image. The angle is absent unless valid; a rejected line keeps its facts."""

    angle_rad: float | None = None  # atan(du/dv): positive = lower end to the right
    sigma_rad: float | None = None  # one standard deviation, from the scatter of the rows
    reason: TrackFailure = TrackFailure.NONE
    rows: int = 0  # number of rows in the fit
    residual_px: float | None = None  # rms distance of those rows from the line
    pivot_miss_px: float | None = None  # line minus predicted pivot, along x, at the pivot's row
    background: float = 0.0  # median grey level, 0..255
    saturation: float = 0.0  # share of pixels at 255

    @property
    def valid(self) -> bool:
        """True if there is an angle."""
        return self.reason is TrackFailure.NONE


class Tracker:
    """Tracker of the cable in images of one size; predicts its angle from the last three."""

    def __init__(self, width: int, height: int) -> None:
        if min(width, height) < MIN_SIZE_PX:
            raise VisionError(
                f"picture of {width} x {height} px; must be at least {MIN_SIZE_PX} x {MIN_SIZE_PX} "
                "px: use a camera or video with a larger image"
            )
        self.width = width
        self.height = height
        self._all_rows = np.arange(height)
        self._group_rows = np.arange(0, height - len(ROW_GROUP) + 1, len(ROW_GROUP))
        self._groups = np.arange(len(self._group_rows))
        # weights over the strip: of two equal responses the nearer one wins, and the flanks of the
        # line filter stay in the strip
        distance = np.abs(np.arange(STRIP_PX) - STRIP_PX // 2)
        inside = distance <= STRIP_PX // 2 - FLANK_PX - 1
        weight = np.clip(255 - 6 * distance, 0, 255) * inside
        self._strip_weight = np.tile(weight.astype(np.uint8), (len(self._group_rows), 1))
        self.forget()

    def forget(self) -> None:
        """Clear the angle history; the next image is searched as a whole."""
        self._angles_rad: tuple[float, ...] = ()  # newest first
        self._pivot_miss_px = 0.0

    def measure(
        self, image: Grey, pivot_px: tuple[float, float], predicted_angle_rad: float | None = None
    ) -> Fit:
        """Measure the angle of the cable in image (height, width) uint8.

        pivot_px: predicted upper end (u, v) of the cable. Without predicted_angle_rad the last
        three angles are extrapolated at constant acceleration, the last two after a prediction
        miss at constant velocity. Never raises: an image of another size or type is BAD_IMAGE.
        """
        if image.shape != (self.height, self.width) or image.dtype != np.uint8:
            self.forget()
            return Fit(reason=TrackFailure.BAD_IMAGE)
        image = np.ascontiguousarray(image)
        levels = grey_levels(image)
        predicted = self._predict(pivot_px, predicted_angle_rad)
        fit = self._fit_near(image, levels, predicted, pivot_px) if predicted else None
        if fit is None or not fit.valid:
            fit = self._search(image, levels, pivot_px)
        self._store(fit)
        return fit

    def _predict(self, pivot_px: tuple[float, float], angle_rad: float | None) -> ImageLine | None:
        if angle_rad is None:
            if not self._angles_rad:
                return None
            weights = EXTRAPOLATION_WEIGHTS[len(self._angles_rad)]
            angle_rad = sum(map(operator.mul, self._angles_rad, weights))
        slope = math.tan(angle_rad)
        return ImageLine(pivot_px[0] + self._pivot_miss_px - slope * pivot_px[1], slope)

    def _store(self, fit: Fit) -> None:
        if fit.angle_rad is None or fit.pivot_miss_px is None:
            self.forget()
            return
        self._angles_rad = (fit.angle_rad, *self._angles_rad[:2])
        self._pivot_miss_px = fit.pivot_miss_px

    def _search(self, image: Grey, levels: Levels, pivot_px: tuple[float, float]) -> Fit:
        candidate = search(image, pivot_px, MIN_RESPONSE_SIGMAS * levels.noise)
        if candidate is None:
            flat = int(image.min()) == int(image.max())
            return _failed(TrackFailure.BAD_IMAGE if flat else TrackFailure.NO_CABLE, levels)
        fit = self._fit_near(image, levels, candidate.line, pivot_px)
        if fit.valid and candidate.ambiguous:
            return _failed(TrackFailure.AMBIGUOUS, levels)
        return fit

    def _fit_near(
        self, image: Grey, levels: Levels, near: ImageLine, pivot_px: tuple[float, float]
    ) -> Fit:
        """Fit the cable from a line near it; in the strip around it if the direct fit fails."""
        fit = self._fit_direct(image, levels, near, pivot_px)
        if fit and fit.valid:
            return fit
        # drop the acceleration history after a prediction miss
        self._angles_rad = self._angles_rad[:1]
        return self._fit_strip(image, levels, near, pivot_px)

    def _fit_direct(
        self, image: Grey, levels: Levels, line: ImageLine, pivot_px: tuple[float, float]
    ) -> Fit | None:
        """Take Newton steps of every row from line; None without convergence of nearly all rows."""
        v = self._all_rows[max(0, math.floor(pivot_px[1]) + CLEAR_ROWS + 1) :]
        if len(v) < MIN_ROWS:
            return None
        top = float(v[0])
        bottom = self.height - 1.0
        for _ in range(NEWTON_STEPS):
            ends = line.at(top), line.at(bottom)
            if not BORDER_PX < min(ends) <= max(ends) < self.width - 1 - BORDER_PX:
                return None
            fit = self._fit_rows(image, levels, v, line)
            if fit is None or fit.rows < MIN_DIRECT_SHARE * len(v):
                return None
            moved = abs(fit.line.at(top) - ends[0]), abs(fit.line.at(bottom) - ends[1])
            if max(moved) < CONVERGED_PX:
                return self._check(fit, levels, pivot_px)
            line = fit.line
        return None

    def _fit_strip(
        self, image: Grey, levels: Levels, near: ImageLine, pivot_px: tuple[float, float]
    ) -> Fit:
        """Fit a coarse line to the darkest points of the strip, then take a Newton step."""
        v, u = self._dark_points(image, near, pivot_px[1], MIN_RESPONSE_SIGMAS * levels.noise)
        if len(v) < MIN_ROWS:
            return _failed(TrackFailure.NO_CABLE, levels)
        line = coarse_line(v.astype(np.float64), u, near)
        if abs(line.slope) > SLOPE_LIMIT:
            return _failed(TrackFailure.NO_CABLE, levels)
        x = line.at(v)
        inside = (x > BORDER_PX) & (x < self.width - 1 - BORDER_PX)
        close = (np.abs(u - x) < MAX_COARSE_PX) & inside
        fit = self._fit_rows(image, levels, (v[close, None] + ROW_GROUP).ravel(), line)
        if fit is None:
            return _failed(TrackFailure.FEW_ROWS, levels)
        return self._check(fit, levels, pivot_px)

    def _fit_rows(self, image: Grey, levels: Levels, v: Rows, line: ImageLine) -> LineFit | None:
        """Take a Newton step in rows v (N,) from line; None if too few rows show a cable."""
        offset_px, curvature = row_offsets(image, v, line.at(v))
        min_curvature = MIN_CURVATURE_SIGMAS * SECOND_NORM * levels.noise
        good = (np.abs(offset_px) < MAX_NEWTON_PX) & (curvature > min_curvature)
        count = np.count_nonzero(good)
        if count < MIN_ROWS:
            return None
        if count < len(v):
            v = v[good]
            offset_px = offset_px[good]
            curvature = curvature[good]
        return huber_line(v.astype(np.float64), RowOffsets(offset_px, curvature), line)

    def _dark_points(
        self, image: Grey, near: ImageLine, pivot_v: float, threshold: float
    ) -> tuple[Rows, FloatArray]:
        """Find the thin dark points of the strip: rows (N,) and columns (N,) to 0.1 px.

        At most one point in each group of four rows.
        """
        start = np.rint(near.at(self._group_rows)).astype(np.intp) - STRIP_PX // 2
        start = np.minimum(np.maximum(start, 0), self.width - STRIP_PX)
        strip = pixel_runs(image, self._group_rows * self.width + start, STRIP_PX)
        response = line_response(strip.reshape(1, -1)).reshape(self._strip_weight.shape)
        weighted = cv2.multiply(response, self._strip_weight, scale=1.0 / 255.0)
        column = weighted.argmax(axis=1)
        below = self._group_rows > pivot_v + CLEAR_ROWS
        dark = (weighted[self._groups, column] > threshold) & below
        v = self._group_rows[dark]
        u = (start + column)[dark]
        return v, refined_columns(image, v, u)

    def _check(self, fit: LineFit, levels: Levels, pivot_px: tuple[float, float]) -> Fit:
        miss_px = fit.line.at(pivot_px[1]) - pivot_px[0]
        noise_px = levels.noise * FIRST_NORM / fit.curvature
        reason = TrackFailure.NONE
        if abs(miss_px) > MAX_PIVOT_MISS_PX:
            reason = TrackFailure.PIVOT_MISSED
        elif fit.rows < MIN_ROWS_SHARE * self.height:
            reason = TrackFailure.FEW_ROWS
        elif fit.scatter_px > max(MAX_SCATTER_PX, MAX_SCATTER_SIGMAS * noise_px):
            reason = TrackFailure.POOR_FIT
        valid = reason is TrackFailure.NONE
        return Fit(
            angle_rad=math.atan(fit.line.slope) if valid else None,
            sigma_rad=fit.sigma_slope / (1.0 + fit.line.slope**2) if valid else None,
            reason=reason,
            rows=fit.rows,
            residual_px=fit.scatter_px,
            pivot_miss_px=miss_px,
            background=levels.background,
            saturation=levels.saturation,
        )


def _failed(reason: TrackFailure, levels: Levels) -> Fit:
    return Fit(reason=reason, background=levels.background, saturation=levels.saturation)
