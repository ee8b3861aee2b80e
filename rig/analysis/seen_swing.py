"""Swing that a camera saw, as arrays from its angle samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from comms.messages import AngleSample

FloatArray = npt.NDArray[np.float64]


class SeenSwing(NamedTuple):
    """Valid angles of the link at the platform."""

    t_s: FloatArray  # (N,) instants for which the angles hold
    angle_rad: FloatArray  # (N,)
    sigma_rad: FloatArray  # (N,)


def averaged(samples: Sequence[AngleSample]) -> SeenSwing:
    """Collect the averaged angles, at increasing instants."""
    rows = [
        (a.t_valid_ns * 1e-9, a.cable.angle_rad, a.cable.sigma_rad)
        for a in samples
        if a.cable is not None
    ]
    t, angle, sigma = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    keep = is_later(t)
    return SeenSwing(t[keep], angle[keep], sigma[keep])


def of_single_frames(samples: Sequence[AngleSample], average_frames: int) -> SeenSwing:
    """Collect the angles of single frames, for peaks, which an average reduces.

    The instants are those of the average.
    """
    sigma_factor = math.sqrt(average_frames)
    rows = []
    for a in samples:
        if a.cable is not None:
            angle_rad = a.cable.raw_rad - a.cable.offset_rad
            rows.append((a.t_valid_ns * 1e-9, angle_rad, a.cable.sigma_rad * sigma_factor))
    return SeenSwing(*np.array(rows, dtype=np.float64).reshape(-1, 3).T)


def is_later(t_s: FloatArray) -> npt.NDArray[np.bool_]:
    """Mark the stamps (N,) that are later than their predecessor; the first one is."""
    if not t_s.size:
        return np.zeros(0, dtype=bool)
    return np.concatenate([[True], np.diff(t_s) > 0])
