"""Geometry of the simulated Quattro: joint angles, pose and Jacobian, with errors of the lengths.

z points up and the plate hangs below the base. Each leg is computed in its own frame, turned about
z by the azimuth: out from the base axis, across, and down. Arm and forearm meet where the circle of
the elbow cuts the sphere about the plate point; the outer one of both points is taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_rig.quattro_params import QuattroParams

AZIMUTHS_RAD = tuple(math.radians(degrees) for degrees in (-45.0, 45.0, 135.0, 225.0))
BAR_ENDS = (1, 1, -1, -1)  # end of the bar that carries the leg
SIDES = (-1, 1, 1, -1)  # side of the bar, along y
NEWTON_STEP = 1e-9  # m and rad; convergence is quadratic
MAX_NEWTON_STEP = 0.2
MIN_DETERMINANT = 1e-9  # of the rate matrix; 0.3 at home
MAX_ITERATIONS = 50
# square of the sine of the angle of arm and forearm in the plane of the arm
MIN_SQUARE_SINE = 1e-8

JointAngles = tuple[float, float, float, float]
FloatArray = NDArray[np.float64]


class PlatePose(NamedTuple):
    """Pose of the plate in the coordinates of the robot."""

    x_m: float
    y_m: float
    z_m: float
    angle_rad: float


class LegGeometry(NamedTuple):
    """Constants of a leg: shoulder relative to the end of the bar at pose 0, in the leg frame."""

    cos: float  # of the azimuth
    sin: float
    out_m: float
    across_m: float
    bar_m: float  # signed half bar
    arm_m: float
    forearm_m: float


class LegState(NamedTuple):
    """State of a leg at a pose."""

    cos: float  # of the joint angle
    sin: float
    x_m: float  # forearm from elbow to plate, axes of the robot
    y_m: float
    z_m: float
    along_m: float  # forearm along the arm
    moment_m2: float  # forearm times velocity of the elbow per joint rate; 0 = in line


def actual_legs(params: QuattroParams) -> tuple[LegGeometry, ...]:
    """Compute the constants of the legs of the robot, with its errors."""
    errors_m = zip(params.arm_error_m, params.forearm_error_m, strict=True)
    return tuple(_legs(params, params.base_radius_error_m, errors_m))


def nominal_legs(params: QuattroParams) -> tuple[LegGeometry, ...]:
    """Compute the constants of the legs as its servos know them, without errors."""
    return tuple(_legs(params, 0.0, iter([(0.0, 0.0)] * len(AZIMUTHS_RAD))))


def _legs(
    params: QuattroParams, radius_error_m: float, errors_m: Iterator[tuple[float, float]]
) -> Iterator[LegGeometry]:
    radius_m = params.base_radius_m + radius_error_m
    rows = zip(AZIMUTHS_RAD, BAR_ENDS, SIDES, errors_m, strict=True)
    for azimuth_rad, end, side, (arm_error_m, forearm_error_m) in rows:
        c, s = math.cos(azimuth_rad), math.sin(azimuth_rad)
        offset_m = side * params.offset_m
        yield LegGeometry(
            cos=c,
            sin=s,
            out_m=offset_m * s - radius_m,
            across_m=offset_m * c,
            bar_m=0.5 * end * params.bar_m,
            arm_m=params.arm_m + arm_error_m,
            forearm_m=params.forearm_m + forearm_error_m,
        )


def leg_state(leg: LegGeometry, x: float, y: float, z: float, c: float, s: float) -> LegState:
    """Compute the state of a leg at position (x, y, z) and plate angle with cosine c, sine s.

    In the plane of the arm, with D the vector from shoulder to plate point, |D| = rho, and E the
    unit vector of D turned outward by 90 deg: arm direction = (k D / rho + w E) / rho, where
    k = (|D|^2 + across^2 + arm^2 - forearm^2) / (2 arm) and w = sqrt(rho^2 - k^2). The moment is
    arm x w. Raises ValueError out of reach and with arm and forearm in line.
    """
    cos_a, sin_a, out_m, across_m, bar_m, arm_m, forearm_m = leg
    end_x, end_y = x + bar_m * c, y + bar_m * s
    h = end_x * cos_a + end_y * sin_a + out_m
    across = end_y * cos_a - end_x * sin_a + across_m
    g = -z
    square = h * h + g * g
    k = (square + across * across + arm_m * arm_m - forearm_m * forearm_m) / (2.0 * arm_m)
    w2 = square - k * k
    if not w2 > MIN_SQUARE_SINE * square:
        raise _out_of_reach(leg, (x, y, z), math.sqrt(square + across * across))
    w = math.sqrt(w2)
    cos_q, sin_q = (k * h + w * g) / square, (k * g - w * h) / square
    out = h - arm_m * cos_q
    return LegState(
        cos_q,
        sin_q,
        out * cos_a - across * sin_a,
        out * sin_a + across * cos_a,
        arm_m * sin_q - g,
        k - arm_m,
        arm_m * w,
    )


def joint_angles(legs: Sequence[LegGeometry], pose: PlatePose) -> JointAngles:
    """Compute the joint angles [rad] of a pose: 0 = horizontal, positive = down."""
    c, s = math.cos(pose.angle_rad), math.sin(pose.angle_rad)
    x, y, z, _ = pose
    angles = []
    for leg in legs:
        state = leg_state(leg, x, y, z, c, s)
        angles.append(math.atan2(state.sin, state.cos))
    return angles[0], angles[1], angles[2], angles[3]


def rate_matrix(legs: Sequence[LegGeometry], pose: PlatePose) -> FloatArray:
    """Compute the matrix (4, 4) from the rates of a pose to the joint rates.

    Row of a leg: (n, b n . (-sin, cos, 0)) / moment, with the forearm n and the half bar b.
    """
    c, s = math.cos(pose.angle_rad), math.sin(pose.angle_rad)
    x, y, z, _ = pose
    rows = []
    for leg in legs:
        state = leg_state(leg, x, y, z, c, s)
        turn_m2 = leg.bar_m * (state.y_m * c - state.x_m * s)
        row = np.array([state.x_m, state.y_m, state.z_m, turn_m2])
        rows.append(row / state.moment_m2)
    return np.array(rows)


def pose_of(
    legs: Sequence[LegGeometry], joints_rad: Sequence[float], start: PlatePose
) -> PlatePose:
    """Compute the pose near `start` with these joint angles (Newton on the angles).

    A step that leaves the reach of a leg is halved. Raises ValueError if no pose is found.
    """
    pose = start
    wanted = np.array(joints_rad)
    for _ in range(MAX_ITERATIONS):
        excess = np.array(joint_angles(legs, pose)) - wanted
        matrix = rate_matrix(legs, pose)
        if not np.all(np.isfinite(excess)) or not abs(np.linalg.det(matrix)) > MIN_DETERMINANT:
            break
        step = np.linalg.solve(matrix, excess)
        step /= max(1.0, np.max(np.abs(step)) / MAX_NEWTON_STEP)
        pose = _step_within_reach(legs, pose, step)
        if np.max(np.abs(step)) < NEWTON_STEP:
            return pose
    raise ValueError(
        f"joints = {tuple(map(float, joints_rad))} rad; must be angles at which all forearms reach "
        "the plate: compute them from a pose within reach"
    )


def _step_within_reach(legs: Sequence[LegGeometry], pose: PlatePose, step: FloatArray) -> PlatePose:
    """Subtract a step from a pose, halved until all legs reach."""
    for halvings in range(MAX_ITERATIONS):
        moved = np.array(pose) - step / 2**halvings
        candidate = PlatePose(*map(float, moved))
        try:
            joint_angles(legs, candidate)
        except ValueError:
            continue
        return candidate
    return pose


def _out_of_reach(
    leg: LegGeometry, position_m: tuple[float, float, float], distance_m: float
) -> ValueError:
    """Build the error for a plate point that a leg cannot hold."""
    azimuth_deg = math.degrees(math.atan2(leg.sin, leg.cos))
    x, y, z = position_m
    return ValueError(
        f"plate at ({x:.6g}, {y:.6g}, {z:.6g}) m, {distance_m:.6g} m from the shoulder at "
        f"{azimuth_deg:.0f} deg; must be within reach of arm {leg.arm_m:g} m and forearm "
        f"{leg.forearm_m:g} m, not in line: keep the setpoints in the work envelope"
    )
