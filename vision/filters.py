"""Moving average over frames, with the time at which it holds."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from vision.errors import VisionError


class Angle(NamedTuple):
    """Angle with the time at which it holds and its standard deviation."""

    t_ns: int
    angle_rad: float
    sigma_rad: float


class MovingAverage:
    """Moving average of the newest `frames` angles.

    An average over equal periods has a delay of (frames - 1) / 2 periods at every frequency; the
    mean time stamp contains it, also while the window fills. A missing frame would change the
    delay, so the average restarts after a gap of more than max_gap_ns between two time stamps.
    """

    def __init__(self, frames: int, max_gap_ns: int) -> None:
        if frames < 1 or max_gap_ns < 1:
            raise VisionError(
                f"moving average of {frames} frames, gap {max_gap_ns} ns; both must be at least 1: "
                "check [vision]"
            )
        self._window: deque[Angle] = deque(maxlen=frames)
        self._max_gap_ns = max_gap_ns

    def restart(self) -> None:
        """Clear the window, after a frame without an angle."""
        self._window.clear()

    def add(self, t_ns: int, angle_rad: float, sigma_rad: float) -> Angle:
        """Add an angle that holds at t_ns; return the mean of the window at its mean time.

        The errors of the frames are taken as independent.
        """
        if self._window and not 0 < t_ns - self._window[-1].t_ns <= self._max_gap_ns:
            self._window.clear()
        self._window.append(Angle(t_ns, angle_rad, sigma_rad))
        n = len(self._window)
        return Angle(
            sum(a.t_ns for a in self._window) // n,
            math.fsum(a.angle_rad for a in self._window) / n,
            math.hypot(*(a.sigma_rad for a in self._window)) / n,
        )
