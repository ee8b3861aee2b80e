"""The moving average over frames, honest about the instant it stands for."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from vision.errors import VisionError


class Angle(NamedTuple):
    """An angle, the instant it is true for, and its standard deviation."""

    t_ns: int
    angle_rad: float
    sigma_rad: float


class MovingAverage:
    """Mean of the newest `frames` angles; starts again after a gap of more than max_gap_ns between two stamps.

    An average over equal periods delays by (frames - 1) / 2 periods at every frequency; its mean stamp says so, also
    while the window is still filling. Over a hole the delay would change, hence the new start.
    """

    def __init__(self, frames: int, max_gap_ns: int) -> None:
        if frames < 1 or max_gap_ns < 1:
            raise VisionError(
                f"moving average of {frames} frames, gap {max_gap_ns} ns; both must be at least 1: check [vision]"
            )
        self._window: deque[Angle] = deque(maxlen=frames)
        self._max_gap_ns = max_gap_ns

    def restart(self) -> None:
        """Forget the window: the newest frame gave no angle."""
        self._window.clear()

    def add(self, t_ns: int, angle_rad: float, sigma_rad: float) -> Angle:
        """Take in an angle true at t_ns; the mean of the window, at its mean instant. Errors of frames are independent."""
        if self._window and not 0 < t_ns - self._window[-1].t_ns <= self._max_gap_ns:
            self._window.clear()
        self._window.append(Angle(t_ns, angle_rad, sigma_rad))
        n = len(self._window)
        return Angle(
            sum(a.t_ns for a in self._window) // n,
            math.fsum(a.angle_rad for a in self._window) / n,
            math.hypot(*(a.sigma_rad for a in self._window)) / n,
        )
