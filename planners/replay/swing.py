"""What a replay gives: the angles of the links over time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.trajectories.pieces import FloatArray


class Swing(NamedTuple):
    """Angles of the links during a move; where two pieces join, the instant stands twice, before and after."""

    t_s: FloatArray  # (N,) not decreasing
    angle_rad: FloatArray  # (N, n)
    angular_velocity_rad_s: FloatArray  # (N, n)

    def peak_rad(self) -> float:
        """Largest |angle| of any link, between the steps too (cubic Hermite)."""
        h = np.diff(self.t_s)[:, None]
        start, rise = self.angle_rad[:-1], np.diff(self.angle_rad, axis=0)
        slope, end_slope = h * self.angular_velocity_rad_s[:-1], h * self.angular_velocity_rad_s[1:]
        square, cube = 3.0 * rise - 2.0 * slope - end_slope, slope + end_slope - 2.0 * rise
        root = np.sqrt(np.maximum(square**2 - 3.0 * cube * slope, 0.0))
        larger = -(square + np.copysign(root, square))
        with np.errstate(divide="ignore", invalid="ignore"):
            turns = np.clip(
                np.nan_to_num([larger / (3.0 * cube), slope / larger]), 0.0, 1.0
            )  # where the slope is zero
        between = start + turns * (slope + turns * (square + turns * cube))
        return float(max(np.abs(between).max(), np.abs(self.angle_rad).max()))


class ReplaySegment(NamedTuple):
    """Part of a replay, from its first instant to its last."""

    t_s: FloatArray  # (N,)
    angles: FloatArray  # (N, n)
    momenta: FloatArray  # (N, n)
    speeds: FloatArray  # (N,)
