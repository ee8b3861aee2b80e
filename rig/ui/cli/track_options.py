"""Options of `rig track` for a video, and their texts."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

from rig.errors import ConfigError
from vision.camera_model import Vector
from vision.first_look import LookChoices
from vision.stream import SourceOptions
from vision.view import PLANES, PictureRegion, Point

AUTO = "auto"
POLARITIES = ("dark", "bright")
MAX_WIDTH_PX = 40.0
MAX_ROW_US = 1000.0  # a slow rolling shutter reads a row in some 50 us


class TrackOptions(NamedTuple):
    """Options as given; None = the default."""

    video: str
    pivot: str | None
    plane: str | None
    polarity: str | None
    width_px: float | None
    roi: str | None
    from_s: float | None
    to_s: float | None
    rate_hz: float | None
    row_us: float | None
    calibration: Path | None
    position: str | None
    at_rest: bool
    filter: str | None
    look: bool
    plot: Path | None
    csv: Path | None
    mcap: Path | None
    overlay: Path | None
    as_json: bool

    def choices(self) -> LookChoices:
        """Collect what the first look need not find; raises ConfigError."""
        _check_one_of("--plane", self.plane, PLANES)
        _check_one_of("--polarity", self.polarity, POLARITIES)
        if self.width_px is not None and not 0.5 <= self.width_px <= MAX_WIDTH_PX:
            raise ConfigError(
                f"--width {self.width_px:g}; must be 0.5 to {MAX_WIDTH_PX:g} px: give the width of "
                "the cable in the picture, or leave it out"
            )
        return LookChoices(
            plane=self.plane,
            is_bright=None if self.polarity is None else self.polarity == "bright",
            width_px=self.width_px,
            region=None if self.roi is None else region_of(self.roi),
            turns=0 if self._is_upright else None,
            at_rest=self.at_rest,
        )

    @property
    def _is_upright(self) -> bool:
        """True if the calibration, or the order of the rows in time, is that of the sensor."""
        return self.calibration is not None or self.row_us is not None

    def source(self) -> SourceOptions:
        """Collect the options of the source of the frames; raises ConfigError."""
        if self.from_s is not None and self.to_s is not None and self.to_s <= self.from_s:
            raise ConfigError(
                f"--to {self.to_s:g} with --from {self.from_s:g}; must be later: exchange them"
            )
        return SourceOptions(rate_hz=self.rate_hz, from_s=self.from_s, to_s=self.to_s)

    def row_s(self) -> float:
        """Return the time between two rows of a rolling shutter, 0 without; raises ConfigError."""
        if self.row_us is None:
            return 0.0
        if not 0.0 <= self.row_us <= MAX_ROW_US:
            raise ConfigError(
                f"--row-time {self.row_us:g}; must be 0 to {MAX_ROW_US:g} us: the time to read the "
                "whole picture over its rows"
            )
        return 1e-6 * self.row_us

    def position_m(self) -> Vector:
        """Parse the place of the platform, home by default; raises ConfigError."""
        if self.position is None:
            return 0.0, 0.0, 0.0
        if self.calibration is None:
            raise ConfigError(
                f"--position {self.position} without --calibration; must be left out: it says "
                "where the platform of a calibrated camera stands"
            )
        count = 3 if "," in self.position else 1
        form = "X or X,Y,Z in metres"
        numbers = _numbers("--position", self.position, count, form, "0.2")
        x, y, z = (*numbers, 0.0, 0.0)[:3]
        return x, y, z

    def pivot_px(self) -> Point | None:
        """Parse the pivot; None = find it. Raises ConfigError."""
        if self.pivot is None or self.pivot == AUTO:
            return None
        x, y = _numbers("--pivot", self.pivot, 2, "X,Y in pixels, or auto", "320,-40")
        return x, y


def region_of(text: str) -> PictureRegion:
    """Parse X,Y,W,H [px]; raises ConfigError."""
    numbers = _numbers("--roi", text, 4, "X,Y,W,H in pixels", "100,0,440,480")
    x, y, width, height = (round(number) for number in numbers)
    if min(x, y) < 0 or min(width, height) < 1:
        raise ConfigError(
            f"--roi '{text}'; X and Y must be >= 0, W and H >= 1: give a part of the picture"
        )
    return PictureRegion(x, y, width, height)


def _numbers(option: str, text: str, count: int, form: str, example: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count:
        raise ConfigError(f"{option} '{text}'; must be {form}: for example {option} {example}")
    if not math.isfinite(math.fsum(numbers)):
        raise ConfigError(
            f"{option} '{text}'; must be {count} finite numbers: for example {option} {example}"
        )
    return numbers


def _check_one_of(option: str, value: str | None, known: tuple[str, ...]) -> None:
    if value is not None and value not in known:
        raise ConfigError(f"{option} '{value}'; must be one of {', '.join(known)}: choose one")
