"""The angle of a thin dark cable before a bright screen, from one picture.

Following: a Newton step of every row from the predicted line; if the rows do not agree, the strip about that line. Cold, or
when the strip refuses: a vote of the whole picture, then the same from the winner. Either way the answer is a free-intercept
line; the predicted pivot only says which line is the cable.
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
    CURVE_NORM,
    MIN_ROWS,
    REACH_PX,
    SLOPE_NORM,
    FloatArray,
    Grey,
    ImageLine,
    LineFit,
    RowOffsets,
    Rows,
    coarse_line,
    huber_line,
    refined_columns,
    row_offsets,
    runs,
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

STRIP_PX = 40  # the cable may be 14 px from the prediction: 27 mrad at the bottom of the picture
GROUP = np.arange(4)  # the coarse line looks at one row in four, the fit at all of them
RIDGE_SIGMAS = 3.0  # thinness that counts as dark; noise alone passes in 1 pixel of 1,000
STIFF_SIGMAS = 3.0  # a row flatter than this holds no cable
COARSE_REACH_PX = 3.0  # a wide, blurred cable is flat at its bottom
BORDER_PX = REACH_PX + len(GROUP)  # columns the template needs, and a group of rows at 45 degrees
NEWTON_STEPS = 2  # of all rows; a line that still moves, or that other rows disagree with, goes through the strip
SETTLED_PX = 0.15  # a last step shorter than this leaves an error below 0.001 px
DIRECT_SHARE = 0.9  # of the rows below the pivot must see one cable
NEWTON_REACH_PX = 1.5  # beyond, the template sees another slope of the profile
PIVOT_REACH_PX = 5.0  # a line that misses the predicted pivot by more is not the cable
ROWS_SHARE = 0.12  # of the picture's height; fewer rows are too short a lever
SCATTER_PX = 0.3  # rows that agree this well are never a poor fit,
SCATTER_SIGMAS = 3.0  # nor rows that agree as well as the noise lets them
MIN_SIZE_PX = 64
CONTINUED = (
    (),
    (1.0,),
    (2.0, -1.0),
    (3.0, -3.0, 1.0),
)  # weights of the last angles in the next, newest first


class TrackFailure(enum.Enum):
    """Why a picture gave no angle; the values are those of the wire."""

    NONE = "none"
    NO_CABLE = "no_cable"
    FEW_ROWS = "few_rows"
    PIVOT_MISSED = "pivot_missed"
    AMBIGUOUS = "ambiguous"
    POOR_FIT = "poor_fit"
    BAD_IMAGE = "bad_image"


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """What one picture says. The angle is absent unless valid; what was seen of a refused line is still told."""

    angle_rad: float | None = None  # atan(du/dv): positive = lower end to the right
    sigma_rad: float | None = None  # one standard deviation, from the scatter of the rows
    reason: TrackFailure = TrackFailure.NONE
    rows: int = 0  # rows the line rests on
    residual_px: float | None = None  # rms distance of those rows from the line
    pivot_miss_px: float | None = None  # line minus predicted pivot, along x, at the pivot's row
    background: float = 0.0  # median grey level, 0..255
    saturation: float = 0.0  # share of pixels at 255

    @property
    def valid(self) -> bool:
        """Whether there is an angle."""
        return self.reason is TrackFailure.NONE


class Tracker:
    """Angle of the cable from pictures of one size; remembers three angles to know where to look next."""

    def __init__(self, width: int, height: int) -> None:
        if min(width, height) < MIN_SIZE_PX:
            raise VisionError(
                f"picture of {width} x {height} px; need at least {MIN_SIZE_PX} each way: check the camera's settings"
            )
        self.width, self.height = width, height
        self._every = np.arange(height)
        self._rows = np.arange(0, height - len(GROUP) + 1, len(GROUP))
        self._lines = np.arange(len(self._rows))
        distance = np.abs(np.arange(STRIP_PX) - STRIP_PX // 2)
        shade = np.clip(255 - 6 * distance, 0, 255) * (distance <= STRIP_PX // 2 - FLANK_PX - 1)
        # the nearer of two equals wins, and no flank leaves the strip
        self._shade = np.tile(shade.astype(np.uint8), (len(self._rows), 1))
        self.forget()

    def forget(self) -> None:
        """Search the whole next picture."""
        self._angles_rad: tuple[float, ...] = ()  # newest first
        self._miss_px = 0.0  # of the pivot

    def measure(
        self, image: Grey, pivot_px: tuple[float, float], predicted_angle_rad: float | None = None
    ) -> Fit:
        """Angle of the cable in image (height, width) uint8, whose upper end should be at pivot_px = (u, v).

        Without predicted_angle_rad the last three angles are continued at constant acceleration, after a surprise the last
        two at constant velocity. Never raises on a picture: one of another size or type is refused as BAD_IMAGE.
        """
        if image.shape != (self.height, self.width) or image.dtype != np.uint8:
            self.forget()
            return Fit(reason=TrackFailure.BAD_IMAGE)
        image = np.ascontiguousarray(image)
        levels = grey_levels(image)
        expected = self._expected(pivot_px, predicted_angle_rad)
        fit = self._along(image, levels, expected, pivot_px) if expected else None
        if fit is None or not fit.valid:
            fit = self._anywhere(image, levels, pivot_px)
        self._remember(fit)
        return fit

    def _expected(self, pivot_px: tuple[float, float], angle_rad: float | None) -> ImageLine | None:
        if angle_rad is None:
            if not self._angles_rad:
                return None
            angle_rad = sum(map(operator.mul, self._angles_rad, CONTINUED[len(self._angles_rad)]))
        slope = math.tan(angle_rad)
        return ImageLine(pivot_px[0] + self._miss_px - slope * pivot_px[1], slope)

    def _remember(self, fit: Fit) -> None:
        if fit.angle_rad is None or fit.pivot_miss_px is None:
            self.forget()
            return
        self._angles_rad = (fit.angle_rad, *self._angles_rad[:2])
        self._miss_px = fit.pivot_miss_px

    def _anywhere(self, image: Grey, levels: Levels, pivot_px: tuple[float, float]) -> Fit:
        candidate = search(image, pivot_px, RIDGE_SIGMAS * levels.noise)
        if candidate is None:
            flat = int(image.min()) == int(image.max())
            return _refused(TrackFailure.BAD_IMAGE if flat else TrackFailure.NO_CABLE, levels)
        fit = self._along(image, levels, candidate.line, pivot_px)
        return (
            _refused(TrackFailure.AMBIGUOUS, levels) if fit.valid and candidate.ambiguous else fit
        )

    def _along(
        self, image: Grey, levels: Levels, near: ImageLine, pivot_px: tuple[float, float]
    ) -> Fit:
        """The line that is near already, in nearly every picture; else whatever crosses the strip about it."""
        fit = self._direct(image, levels, near, pivot_px)
        if fit and fit.valid:
            return fit
        self._angles_rad = self._angles_rad[:1]  # a surprise is no acceleration
        return self._through_strip(image, levels, near, pivot_px)

    def _direct(
        self, image: Grey, levels: Levels, line: ImageLine, pivot_px: tuple[float, float]
    ) -> Fit | None:
        """Newton steps of every row from line; None unless nearly all rows agree on a line that stays."""
        v = self._every[max(0, math.floor(pivot_px[1]) + CLEAR_ROWS + 1) :]
        if len(v) < MIN_ROWS:
            return None
        for _ in range(NEWTON_STEPS):
            ends = line.at(float(v[0])), line.at(self.height - 1.0)
            if not BORDER_PX < min(ends) <= max(ends) < self.width - 1 - BORDER_PX:
                return None
            fit = self._fitted(image, levels, v, line)
            if fit is None or fit.rows < DIRECT_SHARE * len(v):
                return None
            moved = (
                abs(fit.line.at(float(v[0])) - ends[0]),
                abs(fit.line.at(self.height - 1.0) - ends[1]),
            )
            if max(moved) < SETTLED_PX:
                return self._verdict(fit, levels, pivot_px)
            line = fit.line
        return None

    def _through_strip(
        self, image: Grey, levels: Levels, near: ImageLine, pivot_px: tuple[float, float]
    ) -> Fit:
        """Coarse line through the darkest points of the strip about near, a Newton step on the picture, verdict."""
        v, u = self._dark_points(image, near, pivot_px[1], RIDGE_SIGMAS * levels.noise)
        if len(v) < MIN_ROWS:
            return _refused(TrackFailure.NO_CABLE, levels)
        line = coarse_line(v.astype(np.float64), u, near)
        if abs(line.slope) > SLOPE_LIMIT:
            return _refused(TrackFailure.NO_CABLE, levels)
        x = line.at(v)
        close = (
            (np.abs(u - x) < COARSE_REACH_PX) & (x > BORDER_PX) & (x < self.width - 1 - BORDER_PX)
        )
        fit = self._fitted(image, levels, (v[close, None] + GROUP).ravel(), line)
        return (
            self._verdict(fit, levels, pivot_px) if fit else _refused(TrackFailure.FEW_ROWS, levels)
        )

    def _fitted(self, image: Grey, levels: Levels, v: Rows, line: ImageLine) -> LineFit | None:
        """A Newton step on the picture in rows v (N,) from line; None if too few of them see a cable."""
        offsets = row_offsets(image, v, line.at(v))
        good = (np.abs(offsets.offset_px) < NEWTON_REACH_PX) & (
            offsets.stiffness > STIFF_SIGMAS * CURVE_NORM * levels.noise
        )
        count = np.count_nonzero(good)
        if count < MIN_ROWS:
            return None
        if count < len(v):
            v, offsets = v[good], RowOffsets(offsets.offset_px[good], offsets.stiffness[good])
        return huber_line(v.astype(np.float64), offsets, line)

    def _dark_points(
        self, image: Grey, near: ImageLine, pivot_v: float, threshold: float
    ) -> tuple[Rows, FloatArray]:
        """One row in four (N,) where something thin and dark crosses the strip, and its columns (N,) to 0.1 px."""
        start = np.rint(near.at(self._rows)).astype(np.intp) - STRIP_PX // 2
        start = np.minimum(np.maximum(start, 0), self.width - STRIP_PX)
        strip = runs(image, self._rows * self.width + start, STRIP_PX)
        response = cv2.multiply(
            line_response(strip.reshape(1, -1)).reshape(self._shade.shape),
            self._shade,
            scale=1.0 / 255.0,
        )
        column = response.argmax(axis=1)
        dark = (response[self._lines, column] > threshold) & (self._rows > pivot_v + CLEAR_ROWS)
        v, u = self._rows[dark], (start + column)[dark]
        return v, refined_columns(image, v, u)

    def _verdict(self, fit: LineFit, levels: Levels, pivot_px: tuple[float, float]) -> Fit:
        miss = fit.line.at(pivot_px[1]) - pivot_px[0]
        expected_px = levels.noise * SLOPE_NORM / fit.stiffness
        reason = TrackFailure.NONE
        if abs(miss) > PIVOT_REACH_PX:
            reason = TrackFailure.PIVOT_MISSED
        elif fit.rows < ROWS_SHARE * self.height:
            reason = TrackFailure.FEW_ROWS
        elif fit.scatter_px > max(SCATTER_PX, SCATTER_SIGMAS * expected_px):
            reason = TrackFailure.POOR_FIT
        seen = reason is TrackFailure.NONE
        return Fit(
            angle_rad=math.atan(fit.line.slope) if seen else None,
            sigma_rad=fit.sigma_slope / (1.0 + fit.line.slope**2) if seen else None,
            reason=reason,
            rows=fit.rows,
            residual_px=fit.scatter_px,
            pivot_miss_px=miss,
            background=levels.background,
            saturation=levels.saturation,
        )


def _refused(reason: TrackFailure, levels: Levels) -> Fit:
    return Fit(reason=reason, background=levels.background, saturation=levels.saturation)
