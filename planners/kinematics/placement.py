"""Placement of a Quattro in the coordinates of the platform: x right, y depth, z up, home at 0."""

from __future__ import annotations

from collections.abc import Sequence

from planners.errors import PlanError
from planners.kinematics.minors import Vector4
from planners.kinematics.quattro import QuattroGeometry, QuattroPose

HOME = QuattroPose(0.0, 0.0, -0.90, 0.0)  # middle of the work envelope


class WorkspacePlacement:
    """Joint angles of platform positions and back, at the angle of the home pose.

    The axes of the platform are parallel to those of the robot; the home pose is its origin.
    """

    def __init__(self, geometry: QuattroGeometry | None = None, home: QuattroPose = HOME) -> None:
        self.geometry = geometry or QuattroGeometry()
        self.home = home
        self.geometry.inverse(home[:3], home.angle_rad)  # raises PlanError
        self._pose = home  # start of the next iteration

    def joints_of(self, position_m: Sequence[float]) -> Vector4:
        """Compute the joint angles [rad] of a platform position; raises PlanError."""
        x, y, z = position_m
        home_x, home_y, home_z, angle_rad = self.home
        return self.geometry.inverse((x + home_x, y + home_y, z + home_z), angle_rad)

    def position_of(self, joints_rad: Sequence[float]) -> tuple[float, float, float]:
        """Compute the platform position of joint angles; raises PlanError.

        The iteration starts at the last position found, then at home.
        """
        try:
            pose = self.geometry.forward(joints_rad, self._pose)
        except PlanError:
            pose = self.geometry.forward(joints_rad, self.home)
        self._pose = pose
        home = self.home
        return pose.x_m - home.x_m, pose.y_m - home.y_m, pose.z_m - home.z_m

    def rates_of(self, joint_rates_rad_s: Sequence[float]) -> tuple[float, float, float]:
        """Compute the velocity [m/s] at the position found last; raises PlanError."""
        rates = self.geometry.pose_rates(self._pose, joint_rates_rad_s)
        return rates.x_m, rates.y_m, rates.z_m
