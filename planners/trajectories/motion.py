"""Motion in three axes over time: x right, y depth, z up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import unknown_name
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Motion:
    """Motion with one trajectory per axis [m]; an axis that ends early holds its position."""

    x: Trajectory
    y: Trajectory
    z: Trajectory

    @classmethod
    def along(
        cls,
        axis: str,
        trajectory: Trajectory,
        others_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Motion:
        """Build a motion of one axis; the two others hold their entry of others_m.

        Raises PlanError for an unknown axis.
        """
        if axis not in AXES:
            raise unknown_name("axis", axis, AXES)
        held = {
            name: Trajectory.hold(m, trajectory.duration_s)
            for name, m in zip(AXES, others_m, strict=True)
        }
        return cls(**(held | {axis: trajectory}))

    @property
    def duration_s(self) -> float:
        """Duration of the longest axis [s]."""
        return max(axis.duration_s for axis in _axes(self))

    def at(self, t_s: ArrayLike, order: int = 0) -> FloatArray:
        """Compute the derivative of that order at times of any shape: t_s.shape + (3,)."""
        return np.stack([axis.at(t_s, order) for axis in _axes(self)], axis=-1)

    def then(self, other: Motion) -> Motion:
        """Append the other motion after the end of all axes of this one.

        Raises PlanError for a step in position.
        """
        end_s = self.duration_s
        return Motion(
            _extended(self.x, end_s).then(other.x),
            _extended(self.y, end_s).then(other.y),
            _extended(self.z, end_s).then(other.z),
        )


def _axes(motion: Motion) -> tuple[Trajectory, Trajectory, Trajectory]:
    return motion.x, motion.y, motion.z


def _extended(axis: Trajectory, end_s: float) -> Trajectory:
    """Hold the last position until end_s."""
    if axis.duration_s >= end_s:
        return axis
    return axis.then(Trajectory.hold(float(axis.at(axis.duration_s)), end_s - axis.duration_s))
