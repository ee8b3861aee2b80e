"""Result of one picture: the angle of the cable, or the reason why there is none."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import NamedTuple


class TrackFailure(enum.Enum):
    """Reason why an image gives no angle; the values are those of InvalidReason."""

    NONE = "none"
    NO_CABLE = "no_cable"
    FEW_ROWS = "few_rows"
    PIVOT_MISSED = "pivot_missed"
    AMBIGUOUS = "ambiguous"
    POOR_FIT = "poor_fit"
    BAD_IMAGE = "bad_image"
    STATIC = "static"  # it never moves, and so is not the cable
    DUPLICATE = "duplicate"  # the picture before once more
    FROZEN = "frozen"  # the same picture for a while
    DAMAGED = "damaged"


class LowerLink(NamedTuple):
    """Second link, below the joint that is in the picture."""

    angle_rad: float
    sigma_rad: float
    joint_px: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Result of one image. The angle is absent unless valid; a rejected line keeps its facts."""

    angle_rad: float | None = None  # atan(du/dv): positive = lower end to the right
    # one standard deviation, from the scatter of the rows and their correlation
    sigma_rad: float | None = None
    reason: TrackFailure = TrackFailure.NONE
    rows: int = 0  # number of rows in the fit
    residual_px: float | None = None  # rms distance of those rows from the axis
    pivot_miss_px: float | None = None  # line minus predicted pivot, along x, at the pivot's row
    background: float = 0.0  # median grey level, 0..255
    saturation: float = 0.0  # share of pixels at 255
    line_px: tuple[float, float] | None = None  # column at row 0, columns per row
    first_row: int = 0  # of the rows in the fit
    last_row: int = 0
    bend_px: float = 0.0  # distance of the middle of the axis from the chord, positive to the right
    sigma_bend_px: float = 0.0
    lower: LowerLink | None = None

    @property
    def valid(self) -> bool:
        """True if there is an angle."""
        return self.reason is TrackFailure.NONE
