"""Kinematics of the Quattro: four arms on a base carry one plate in x, y, z and rotation.

z points up and the plate hangs below the base. Joint angle 0 is a horizontal arm, positive is
down. Leg i has the azimuth a_i, e_i = (cos a_i, sin a_i, 0). Its forearm ends at the plate point
C_i = P + s_i (b/2) (cos th, sin th, 0) + v_i, where s = (1, 1, -1, -1) and
v_i = (0, -w | +w | +w | -w, 0). The constraint of a leg is |n_i| = forearm, n_i = C_i - elbow_i.
Method: Pierrot, Nabat et al., "Optimal design of a 4-dof parallel manipulator", IEEE T-RO 2009.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from planners.errors import NotConverged, check_range
from planners.kinematics.errors import SingularPose, UnreachablePose
from planners.kinematics.minors import Matrix4, Vector4, solve_by_minors

LEGS = 4
BAR_SIGNS = (1.0, 1.0, -1.0, -1.0)
OFFSET_SIGNS = (-1.0, 1.0, 1.0, -1.0)
MIN_IN_LINE_SIN = 1e-3  # sine of the angle of arm and forearm, in the plane of the arm
MIN_VOLUME = 1e-3  # determinant of Jx with unit forearms and unit half bar; 0.68 at home
NEWTON_STEP_M = 1e-8  # convergence is quadratic: the next step is below 1e-15 m
ANGLE_ROUNDING_RAD = 1e-9  # of an angle at its limit
SINGULAR_ANGLE_RAD = 1.34  # Jx is singular at 77 to 98 deg, depending on the position
MAX_TURN_RAD = 0.4  # of a Newton step; larger ones leave the range of the plate
MAX_ITERATIONS = 20  # 3 from a pose 10 mm away, 6 from home within the work envelope


class QuattroPose(NamedTuple):
    """Pose of the plate, or its rates, in the coordinates of the robot."""

    x_m: float
    y_m: float
    z_m: float
    angle_rad: float


class QuattroJacobian(NamedTuple):
    """Matrices of Jx (xd, yd, zd, angle rate) = Jq (joint rates)."""

    plate: Matrix4  # Jx: a row for each leg
    joints: Vector4  # diagonal of Jq [m2]


class Leg(NamedTuple):
    """Constants of a leg."""

    cos: float  # of the azimuth
    sin: float
    anchor_x_m: float  # shoulder minus offset of the plate point
    anchor_y_m: float
    bar_m: float  # signed half bar


@dataclass(frozen=True, kw_only=True)
class QuattroGeometry:
    """Lengths and limits of a Quattro; the defaults cover a cylinder of 0.65 m radius.

    Base radius, arm and forearm are those of the public robnux model of this robot; plate and
    limits are a design choice. They are not data of the vendor.
    """

    base_radius_m: float = 0.300
    arm_m: float = 0.400
    forearm_m: float = 1.020
    bar_m: float = 0.24
    offset_m: float = 0.12
    azimuths_rad: Vector4 = (-math.pi / 4, math.pi / 4, 3 * math.pi / 4, 5 * math.pi / 4)
    max_angle_rad: float = math.pi / 4  # of the plate, both directions
    min_joint_rad: float = math.radians(-52.0)
    max_joint_rad: float = math.radians(124.0)

    def __post_init__(self) -> None:
        for name in ("base_radius_m", "arm_m", "forearm_m", "bar_m"):
            check_range(name, getattr(self, name), 1e-3, 10.0, "give it in m")
        check_range("offset_m", self.offset_m, 0.0, 10.0, "give it in m")
        check_range("max_angle_rad", self.max_angle_rad, 0.0, 1.3, "keep away from pi / 2")
        check_range("min_joint_rad", self.min_joint_rad, -math.pi, math.pi, "give it in rad")
        advice = "give it in rad, above min_joint_rad"
        check_range("max_joint_rad", self.max_joint_rad, self.min_joint_rad, math.pi, advice)

    @cached_property
    def legs(self) -> tuple[Leg, ...]:
        """Constants of the four legs."""
        return tuple(self._leg(index) for index in range(LEGS))

    def _leg(self, index: int) -> Leg:
        azimuth_rad = self.azimuths_rad[index]
        c, s = math.cos(azimuth_rad), math.sin(azimuth_rad)
        anchor_y_m = self.base_radius_m * s - OFFSET_SIGNS[index] * self.offset_m
        return Leg(c, s, self.base_radius_m * c, anchor_y_m, BAR_SIGNS[index] * 0.5 * self.bar_m)

    def inverse(self, position_m: Sequence[float], angle_rad: float = 0.0) -> Vector4:
        """Compute the joint angles [rad] of a pose, elbows outside.

        With d = C_i - shoulder_i, h = d . e_i and K = (|d|^2 + arm^2 - forearm^2) / (2 arm):
        h cos q - d_z sin q = K, so q = -atan2(d_z, h) - acos(K / hypot(h, d_z)).
        Raises UnreachablePose and SingularPose.
        """
        x, y, z = position_m
        self._check_angle(angle_rad)
        c, s = math.cos(angle_rad), math.sin(angle_rad)
        squares_m2 = self.arm_m * self.arm_m - self.forearm_m * self.forearm_m
        joints: list[float] = []
        for leg in self.legs:
            dx = x + leg.bar_m * c - leg.anchor_x_m
            dy = y + leg.bar_m * s - leg.anchor_y_m
            h = dx * leg.cos + dy * leg.sin
            k = (dx * dx + dy * dy + z * z + squares_m2) / (2.0 * self.arm_m)
            reach = math.hypot(h, z)
            if not abs(k) < reach:
                raise self._out_of_reach(len(joints), (x, y, z), (h, dx * leg.sin - dy * leg.cos))
            if reach * reach - k * k < (MIN_IN_LINE_SIN * reach) ** 2:
                raise _in_line(len(joints), math.sqrt(1.0 - (k / reach) ** 2))
            joints.append(-math.atan2(z, h) - math.acos(k / reach))
        self._check_joints(joints)
        return joints[0], joints[1], joints[2], joints[3]

    def forward(self, joints_rad: Sequence[float], start: QuattroPose) -> QuattroPose:
        """Compute the pose near `start` (Newton on |n_i|^2 = forearm^2).

        Raises UnreachablePose, SingularPose, and NotConverged where the legs do not meet.
        """
        self._check_joints(joints_rad)
        elbows = self._elbows(joints_rad)
        pose = start
        for _ in range(MAX_ITERATIONS):
            rows, lengths_m2 = self._rows(elbows, pose)
            forearm_m2 = self.forearm_m * self.forearm_m
            l0, l1, l2, l3 = lengths_m2
            excess = (
                0.5 * (l0 - forearm_m2),
                0.5 * (l1 - forearm_m2),
                0.5 * (l2 - forearm_m2),
                0.5 * (l3 - forearm_m2),
            )
            dx, dy, dz, turn = self._solve(rows, excess)
            turn = min(max(turn, -MAX_TURN_RAD), MAX_TURN_RAD)
            x, y, z, angle_rad = pose
            pose = QuattroPose(x - dx, y - dy, z - dz, angle_rad - turn)
            if abs(dx) + abs(dy) + abs(dz) + abs(turn) * self.bar_m < NEWTON_STEP_M:
                self._check_angle(pose.angle_rad)
                return pose
        raise NotConverged(
            f"pose of joints {_degrees(joints_rad)} deg not found in {MAX_ITERATIONS} steps; "
            f"must be found to {NEWTON_STEP_M:g} m: check the joint angles, or start nearer"
        )

    def jacobian(self, pose: QuattroPose) -> QuattroJacobian:
        """Compute Jx and Jq: rows [n_i, s_i (b/2) n_i . (-sin th, cos th, 0)], n_i . dB_i/dq.

        B_i is the elbow. Raises UnreachablePose and SingularPose.
        """
        joints_rad = self.inverse(pose[:3], pose.angle_rad)
        rows, _ = self._rows(self._elbows(joints_rad), pose)
        diagonal = []
        for leg, row, q in zip(self.legs, rows, joints_rad, strict=True):
            outward = row[0] * leg.cos + row[1] * leg.sin
            diagonal.append(-self.arm_m * (math.sin(q) * outward + math.cos(q) * row[2]))
        return QuattroJacobian(rows, (diagonal[0], diagonal[1], diagonal[2], diagonal[3]))

    def joint_rates(self, pose: QuattroPose, pose_rates: Sequence[float]) -> Vector4:
        """Compute the joint rates [rad/s] of the rates (m/s, m/s, m/s, rad/s) of a pose."""
        plate, diagonal = self.jacobian(pose)
        vx, vy, vz, turn = pose_rates
        rates = []
        for (a, b, c, d), jq in zip(plate, diagonal, strict=True):
            rates.append((a * vx + b * vy + c * vz + d * turn) / jq)
        return rates[0], rates[1], rates[2], rates[3]

    def pose_rates(self, pose: QuattroPose, joint_rates_rad_s: Sequence[float]) -> QuattroPose:
        """Compute the rates (m/s, m/s, m/s, rad/s) of a pose from the joint rates.

        Raises SingularPose where Jx is singular.
        """
        plate, diagonal = self.jacobian(pose)
        r0, r1, r2, r3 = joint_rates_rad_s
        q0, q1, q2, q3 = diagonal
        return QuattroPose(*self._solve(plate, (q0 * r0, q1 * r1, q2 * r2, q3 * r3)))

    def condition_number(self, pose: QuattroPose) -> float:
        """Compute the condition number of Jq^-1 Jx, with the rotation as b/2 times the angle."""
        import numpy as np

        plate, diagonal = self.jacobian(pose)
        matrix = np.array(plate) / np.array(diagonal)[:, None]
        matrix[:, 3] /= 0.5 * self.bar_m
        return float(np.linalg.cond(matrix))

    def _elbows(self, joints_rad: Sequence[float]) -> list[tuple[float, float, float]]:
        """Compute the elbows, each less the offset of its plate point."""
        elbows = []
        for leg, q in zip(self.legs, joints_rad, strict=True):
            out_m = self.arm_m * math.cos(q)
            x_m = leg.anchor_x_m + out_m * leg.cos
            y_m = leg.anchor_y_m + out_m * leg.sin
            elbows.append((x_m, y_m, -self.arm_m * math.sin(q)))
        return elbows

    def _rows(
        self, elbows: list[tuple[float, float, float]], pose: QuattroPose
    ) -> tuple[Matrix4, Vector4]:
        """Compute the rows of Jx and |n_i|^2."""
        x, y, z, angle_rad = pose
        c, s = math.cos(angle_rad), math.sin(angle_rad)
        rows = []
        squares = []
        for leg, (ex, ey, ez) in zip(self.legs, elbows, strict=True):
            nx = x + leg.bar_m * c - ex
            ny = y + leg.bar_m * s - ey
            nz = z - ez
            rows.append((nx, ny, nz, leg.bar_m * (ny * c - nx * s)))
            squares.append(nx * nx + ny * ny + nz * nz)
        matrix = (rows[0], rows[1], rows[2], rows[3])
        return matrix, (squares[0], squares[1], squares[2], squares[3])

    def _solve(self, rows: Matrix4, right: Vector4) -> Vector4:
        """Solve Jx x = right; raises SingularPose."""
        unit = self.forearm_m**LEGS * 0.5 * self.bar_m
        solution, determinant = solve_by_minors(rows, right, MIN_VOLUME * unit)
        if solution is None:
            raise SingularPose(
                f"forearms in one plane or bars in line (Jx singular): volume = "
                f"{abs(determinant) / unit:.3g}; must be >= {MIN_VOLUME:g}: "
                "keep the plate below the elbows and its angle away from +-1.57 rad"
            )
        return solution

    def _check_angle(self, angle_rad: float) -> None:
        """Check the angle of the plate; NaN is outside."""
        if abs(angle_rad) <= self.max_angle_rad + ANGLE_ROUNDING_RAD:
            return
        singular = ", singular near +-1.57" if abs(angle_rad) > SINGULAR_ANGLE_RAD else ""
        limit = self.max_angle_rad
        error = SingularPose if singular else UnreachablePose
        raise error(
            f"angle_rad = {angle_rad:.6g}{singular}; must be {-limit:.6g} to {limit:.6g}: "
            "turn the plate less"
        )

    def _check_joints(self, joints_rad: Sequence[float]) -> None:
        """Check the joint limits; NaN is outside."""
        low, high = self.min_joint_rad, self.max_joint_rad
        for index, q in enumerate(joints_rad):
            if not low <= q <= high:
                raise UnreachablePose(
                    f"joint {index + 1} = {q:.6g} rad; must be {low:.6g} to {high:.6g} rad: "
                    "move the plate nearer to the home pose"
                )

    def _out_of_reach(
        self, index: int, position_m: tuple[float, ...], distance_m: tuple[float, float]
    ) -> UnreachablePose:
        """Build the error for a plate point out of reach; distance_m: along the arm, across."""
        reach = math.hypot(distance_m[0], position_m[2])
        low = math.hypot(reach - self.arm_m, distance_m[1])
        high = math.hypot(reach + self.arm_m, distance_m[1])
        x, y, z = position_m
        return UnreachablePose(
            f"forearm_m = {self.forearm_m:g} of leg {index + 1}; must be {low:.6g} to {high:.6g} m "
            f"to reach ({x:g}, {y:g}, {z:g}) m: move the plate nearer to the home pose"
        )


def _in_line(index: int, sine: float) -> SingularPose:
    """Build the error for an arm in line with its forearm (Jq singular)."""
    return SingularPose(
        f"arm and forearm of leg {index + 1} in line: sine = {sine:.3g}; "
        f"must be >= {MIN_IN_LINE_SIN:g}: move the plate nearer to the home pose"
    )


def _degrees(angles_rad: Sequence[float]) -> str:
    """Format angles in degrees."""
    return ", ".join(f"{math.degrees(angle):.3f}" for angle in angles_rad)
