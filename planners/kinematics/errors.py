"""Errors of planners/kinematics: poses out of reach, and singular ones."""

from __future__ import annotations

from planners.errors import PlanError


class UnreachablePose(PlanError):
    """Pose or joint angles outside the reach of the legs or outside a limit.

    Example: `forearm_m = 1.02 of leg 2; must be 1.2 to 2 m to reach (0, 0, -1.6) m: move ...`.
    """


class SingularPose(PlanError):
    """Pose at which joints and plate do not determine the motion of each other.

    Example: `arm and forearm of leg 1 in line: sine = 0.0002; must be >= 0.001: move ...`.
    """
