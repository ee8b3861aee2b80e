"""Faults of single frames: dropped, duplicated, frozen and damaged ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_rig.camera_params import CameraFaults

Picture = NDArray[np.uint8]
MAX_DAMAGED_SHARE = 0.5  # of the rows


class FrameFault(NamedTuple):
    """Faults of one frame."""

    is_dropped: bool = False
    is_repeated: bool = False
    is_damaged: bool = False
    number: int = 0


class FrameFaults:
    """Faults of a camera; equal seeds and numbers of the frame give equal faults."""

    def __init__(self, faults: CameraFaults, seed: tuple[int, ...]) -> None:
        self._faults = faults
        self._seed = seed
        self._last: Picture | None = None

    def at(self, number: int, t_s: float) -> FrameFault:
        """Draw the faults of frame number, taken at t_s."""
        faults = self._faults
        dropped, duplicated, damaged = np.random.default_rng((*self._seed, number)).random(3)
        is_frozen = any(part.from_s <= t_s < part.to_s for part in faults.frozen)
        return FrameFault(
            is_dropped=bool(dropped < faults.dropped),
            is_repeated=is_frozen or bool(duplicated < faults.duplicated),
            is_damaged=bool(damaged < faults.damaged),
            number=number,
        )

    def repeated(self, fault: FrameFault) -> Picture | None:
        """Return the picture before, where the fault repeats it."""
        return self._last if fault.is_repeated else None

    def damaged(self, fault: FrameFault, picture: Picture) -> Picture:
        """Keep the picture for a repetition; return it with a band of rows spoilt by the fault.

        The upper part of the band is shifted to the side, the lower one holds noise.
        """
        self._last = picture
        if not fault.is_damaged:
            return picture
        random = np.random.default_rng((*self._seed, fault.number, 1))
        height, width = picture.shape[:2]
        size = int(random.integers(2, max(3, int(MAX_DAMAGED_SHARE * height))))
        first = int(random.integers(0, height - size))
        middle = first + size // 2
        spoilt = picture.copy()
        spoilt[first:middle] = np.roll(picture[first:middle], int(random.integers(width)), axis=1)
        spoilt[middle : first + size] = random.integers(0, 256, spoilt[middle : first + size].shape)
        return spoilt
