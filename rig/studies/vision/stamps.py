"""Time stamps of a video: constant or variable rate, holes, or two recordings joined."""

from __future__ import annotations

from typing import Literal, TypeAlias

Stamps: TypeAlias = Literal["cfr", "vfr", "holes", "joined"]
VARIABLE_KEPT = (True, True, False)  # of each three frames: intervals of one and two periods
HOLE_EVERY = 100  # frames
HOLE_FRAMES = 10
JOINED_BACK_FRAMES = 40  # the second recording begins so many periods before the end of the first


def is_kept(stamps: Stamps, number: int) -> bool:
    """Tell if frame number, from 0, is in a video with these stamps."""
    if stamps == "vfr":
        return VARIABLE_KEPT[number % len(VARIABLE_KEPT)]
    if stamps == "holes":
        return number % HOLE_EVERY < HOLE_EVERY - HOLE_FRAMES
    return True


def stamp_s(stamps: Stamps, number: int, period_s: float, frames: int) -> float:
    """Compute the time stamp of frame number of that many frames, from the first one."""
    t_s = number * period_s
    if stamps == "joined" and number >= frames // 2:
        t_s -= min(JOINED_BACK_FRAMES, frames // 2) * period_s
    return t_s
