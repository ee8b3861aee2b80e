"""Interface of a cable tracker, for `rig track --benchmark` and for trackers of other authors."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from vision.line_fit import Grey


class MeasuredAngle(Protocol):
    """Result of one picture: any object with these two attributes."""

    @property
    def angle_rad(self) -> float | None:
        """Angle of the cable: atan(du/dv), positive = lower end to the right; None = refused."""
        ...

    @property
    def sigma_rad(self) -> float | None:
        """Standard deviation that the tracker gives with the angle, > 0; None = not known."""
        ...


class CableAngle(NamedTuple):
    """Plain result of one picture; without arguments, a refused one."""

    angle_rad: float | None = None
    sigma_rad: float | None = None


class CableTracker(Protocol):
    """Tracker of the cable in the pictures of one sequence, all of one size.

    Constructed with (width, height) [px]. A class with the attribute `colour = True` is given the
    colour picture instead of the red plane. A class with a method `prepare(pictures, pivots_px)`
    is given some 30 pictures spread over the sequence, with the pivot in each, before the first
    picture is measured; the pictures are as in measure().
    """

    def measure(self, image: Grey, pivot_px: tuple[float, float], /) -> MeasuredAngle:
        """Measure the angle of the cable in one picture.

        image: (height, width) uint8, contiguous, the red plane of a colour picture; or
        (height, width, 3) blue, green, red. pivot_px: column and row of the upper end of the
        cable, as far as it is known; may lie outside the picture.
        """
        ...


TrackerClass = Callable[[int, int], CableTracker]  # (width, height)
