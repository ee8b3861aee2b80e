"""Tracker of a bob whose cable cannot be seen: angle of the line from the pivot to its centroid."""

from __future__ import annotations

import math
from dataclasses import replace

from vision.blob import find_blob
from vision.bob_look import BobLook
from vision.fit import Fit, TrackFailure
from vision.line_fit import Grey
from vision.ridge import grey_levels

MAX_AREA_RATIO = 1.6  # of the area in the first look; more or less is something else
MAX_MISS_PX = 3.0  # of the distance from the pivot
MAX_MISS_SIGMAS = 6.0
MAX_RADIUS_SIGMAS = 3.0  # a short arc hardly tells the distance
MIN_SIGMA_PX = 0.007  # of a centroid without noise: rounding of pixels and ground
MAX_ANGLE_RAD = math.radians(60.0)


class BobTracker:
    """Tracker of the bob of a first look, in pictures of the view.

    The sigma of an angle contains the accuracy of the pivot, unless it is told: that error is
    common to all pictures.
    """

    def __init__(self, look: BobLook, *, is_pivot_told: bool = False) -> None:
        self._look = look
        self._is_pivot_told = is_pivot_told

    def measure(self, image: Grey, pivot_px: tuple[float, float]) -> Fit:
        """Measure the angle in image (height, width) uint8 of the view.

        residual_px and pivot_miss_px of the result: distance of the centroid from the circle.
        """
        ground = self._look.ground
        if image.shape != ground.shape:
            return Fit(reason=TrackFailure.BAD_IMAGE)
        levels = grey_levels(image)
        blob = find_blob(ground, image, levels.noise)
        empty = Fit(
            reason=TrackFailure.NO_CABLE,
            background=levels.background,
            saturation=levels.saturation,
        )
        if blob is None:
            return empty
        across, along = blob.u - pivot_px[0], blob.v - pivot_px[1]
        distance = math.hypot(across, along)
        angle_rad = math.atan2(across, along)
        miss_px = distance - self._look.circle.radius_px
        reason = TrackFailure.NONE
        ratio = blob.area_px / self._look.area_px
        circle = self._look.circle
        limit_px = max(
            MAX_MISS_PX,
            MAX_MISS_SIGMAS * circle.scatter_px,
            MAX_RADIUS_SIGMAS * circle.sigma_radius_px,
        )
        if blob.touches_border or not 1.0 / MAX_AREA_RATIO < ratio < MAX_AREA_RATIO:
            reason = TrackFailure.POOR_FIT
        elif abs(miss_px) > limit_px or abs(angle_rad) > MAX_ANGLE_RAD:
            reason = TrackFailure.PIVOT_MISSED
        valid = reason is TrackFailure.NONE
        slope = math.tan(angle_rad) if abs(angle_rad) < MAX_ANGLE_RAD else 0.0
        sigma_px = math.hypot(
            blob.sigma_px[0] * math.cos(angle_rad),
            blob.sigma_px[1] * math.sin(angle_rad),
            MIN_SIGMA_PX,
            self._pivot_sigma_px(angle_rad),
        )
        return replace(
            empty,
            angle_rad=angle_rad if valid else None,
            sigma_rad=sigma_px / distance if valid else None,
            reason=reason,
            rows=blob.rows,
            residual_px=abs(miss_px),
            pivot_miss_px=miss_px,
            line_px=(pivot_px[0] - slope * pivot_px[1], slope),
            first_row=round(blob.v - 0.5 * blob.rows),
            last_row=round(blob.v + 0.5 * blob.rows),
        )

    def _pivot_sigma_px(self, angle_rad: float) -> float:
        """Compute the deviation of the pivot across the line at an angle."""
        if self._is_pivot_told:
            return 0.0
        circle = self._look.circle
        across = circle.sigma_centre_px[0] * math.cos(angle_rad)
        along = circle.sigma_centre_px[1] * math.sin(angle_rad)
        variance = across**2 + along**2 - 2.0 * circle.correlation * across * along
        return math.sqrt(max(0.0, variance))
