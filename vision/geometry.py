"""Pivot (upper end of the cable) in the image as a function of the platform position."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vision.errors import VisionError


@dataclass(frozen=True, slots=True, kw_only=True)
class PivotModel:
    """Linear pivot model: pivot = home_px + (pixels_per_m x, 0).

    The camera is fixed and looks along the y axis of the platform, +X to image right.
    """

    home_px: tuple[float, float]  # (u, v) at x = 0; v < 0 is above the image
    pixels_per_m: float

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.home_px)):
            raise VisionError(
                f"home_px = {self.home_px}; both must be finite: calibrate the pivot again"
            )
        if not 0.0 < self.pixels_per_m < math.inf:
            raise VisionError(
                f"pixels_per_m = {self.pixels_per_m}; must be > 0 and finite: "
                "calibrate the pivot again"
            )

    def pivot_px(self, x_m: float) -> tuple[float, float]:
        """Compute (u, v) of the pivot [px] with the platform at x_m."""
        return self.home_px[0] + self.pixels_per_m * x_m, self.home_px[1]
