"""Check of a fitted axis: angle, or the reason why there is none."""

from __future__ import annotations

import math

from vision.axis import MeasuredAxis
from vision.fit import LowerLink, TrackFailure
from vision.line_fit import MIN_ROWS

MAX_PIVOT_MISS_PX = 5.0  # a line farther from the predicted pivot is not the cable
MIN_ROWS_SHARE = 0.12  # of the image height; fewer rows are too short for a slope
# a fit is poor if its scatter exceeds both
MAX_SCATTER_PX = 0.3
MAX_SCATTER_SIGMAS = 3.0  # of the noise
MAX_STRUCTURED_RAD = 1e-3  # sigma of rows that follow something else than an axis
MIN_BENT_SHARE = 0.6  # of the visible rows that must agree on a bent axis
CLEAR_FACTOR = 3.0  # chance does not correlate the rows of one frame so much


def judge(
    measured: MeasuredAxis, height: int, miss_px: float, sigma_rad: float, noise_px: float
) -> TrackFailure:
    """Judge an axis fitted in a picture of that height.

    miss_px: distance from the predicted pivot. noise_px: deviation of a row by the noise alone.
    """
    if abs(miss_px) > MAX_PIVOT_MISS_PX:
        return TrackFailure.PIVOT_MISSED
    if measured.rows < max(MIN_ROWS, MIN_ROWS_SHARE * height):
        is_static = measured.static_rows > measured.rows
        return TrackFailure.STATIC if is_static else TrackFailure.FEW_ROWS
    is_scattered = measured.scatter_px > max(MAX_SCATTER_PX, MAX_SCATTER_SIGMAS * noise_px)
    is_structured = measured.correlation_factor > CLEAR_FACTOR and sigma_rad > MAX_STRUCTURED_RAD
    # a bent axis through a part of the rows may be that of something else
    is_part = measured.axis.is_bent and not measured.is_whole(MIN_BENT_SHARE)
    if is_scattered or is_structured or is_part:
        return TrackFailure.POOR_FIT
    return TrackFailure.NONE


def lower_link(measured: MeasuredAxis) -> LowerLink | None:
    """Compute the angle of the second link; None of one link."""
    axis = measured.axis
    if axis.knee_row is None:
        return None
    slope = axis.line.slope + axis.knee_slope
    sigma_rad = measured.sigma_lower_slope / (1.0 + slope**2)
    joint = (axis.line.at(axis.knee_row), axis.knee_row)
    return LowerLink(math.atan(slope), sigma_rad, joint)
