"""Results of a replay: angles of the links over time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.trajectories.pieces import FloatArray


class Swing(NamedTuple):
    """Angles of the links during a move; an instant where two pieces join stands twice."""

    t_s: FloatArray  # (N,) not decreasing
    angle_rad: FloatArray  # (N, n)
    angular_velocity_rad_s: FloatArray  # (N, n)

    def peak_rad(self) -> float:
        """Find the largest |angle| of any link, between the steps too (cubic Hermite)."""
        h = np.diff(self.t_s)[:, None]
        start, rise = self.angle_rad[:-1], np.diff(self.angle_rad, axis=0)
        slope, end_slope = h * self.angular_velocity_rad_s[:-1], h * self.angular_velocity_rad_s[1:]
        square = 3.0 * rise - 2.0 * slope - end_slope
        cube = slope + end_slope - 2.0 * rise
        root = np.sqrt(np.maximum(square**2 - 3.0 * cube * slope, 0.0))
        larger = -(square + np.copysign(root, square))
        with np.errstate(divide="ignore", invalid="ignore"):
            zeros_of_slope = np.nan_to_num([larger / (3.0 * cube), slope / larger])
        turns = np.clip(zeros_of_slope, 0.0, 1.0)
        between = start + turns * (slope + turns * (square + turns * cube))
        return float(max(np.abs(between).max(), np.abs(self.angle_rad).max()))


class ReplaySegment(NamedTuple):
    """Segment of a replay, from its first instant to its last."""

    t_s: FloatArray  # (N,)
    angles: FloatArray  # (N, n) [rad]
    momenta: FloatArray  # (N, n) [kg m^2/s]
    speeds: FloatArray  # (N,) of the platform [m/s]
