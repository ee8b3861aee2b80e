"""Three axes over time: x right, y depth, z up."""

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
    """One trajectory an axis [m]; an axis that ends early stands still until the others are done."""

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
        """A move of one axis; the two others hold their entry of others_m. Raises PlanError for an unknown axis."""
        if axis not in AXES:
            raise unknown_name("axis", axis, AXES)
        held = {
            name: Trajectory.hold(m, trajectory.duration_s)
            for name, m in zip(AXES, others_m, strict=True)
        }
        return cls(**(held | {axis: trajectory}))

    @property
    def duration_s(self) -> float:
        """Time until the last axis stands still."""
        return max(axis.duration_s for axis in (self.x, self.y, self.z))

    def at(self, t_s: ArrayLike, order: int = 0) -> FloatArray:
        """Derivative of that order at times of any shape: t_s.shape + (3,), so (3,) for a number."""
        return np.stack([axis.at(t_s, order) for axis in (self.x, self.y, self.z)], axis=-1)

    def then(self, other: Motion) -> Motion:
        """This motion, and when all its axes stand still the other. Raises PlanError when a position would jump."""
        end = self.duration_s
        return Motion(
            *(_until(a, end).then(b) for a, b in zip(_axes(self), _axes(other), strict=True))
        )


def _axes(motion: Motion) -> tuple[Trajectory, Trajectory, Trajectory]:
    return motion.x, motion.y, motion.z


def _until(axis: Trajectory, end_s: float) -> Trajectory:
    if axis.duration_s >= end_s:
        return axis
    return axis.then(Trajectory.hold(float(axis.at(axis.duration_s)), end_s - axis.duration_s))
