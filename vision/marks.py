"""Pose of a camera from round dark marks at known places."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from vision.camera_model import Vector
from vision.chessboard import Intrinsics
from vision.errors import VisionError
from vision.line_fit import Grey

FloatArray = NDArray[np.float64]
MIN_MARKS = 6
MIN_RADIUS_PX = 1.5
MAX_RADIUS_SHARE = 0.1  # of the smaller side of the picture
MIN_CONTRAST = 20.0  # grey levels below the surroundings
MIN_ROUNDNESS = 0.6  # filled share of a circle around it; a square has 0.64
MAX_RMS_PX = 1.0  # of the reprojection
MAX_MISS_PX = 3.0  # of a mark from its place
MATCH_ROUNDS = 20
STARTS = (1.0, 0.85, 1.2, 0.7, 1.4)  # scales of the first guess
MIN_DEPTH_STEP_REL = 1e-9
# right and down of a camera before the plane x, and at the right, of the plane y
AXES = {"x": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0)), "y": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0))}


class SeenMarks(NamedTuple):
    """Round dark spots in a picture."""

    centres_px: FloatArray  # (N, 2)
    radius_px: FloatArray  # (N,)


class MeasuredPose(NamedTuple):
    """Pose of a camera, each sigma one standard deviation of the noise of the marks."""

    rotation: Vector  # Rodrigues vector of the turn from the world to the camera
    translation_m: Vector  # home position in the camera
    sigma_rotation: Vector
    sigma_translation_m: Vector
    rms_px: float  # of the reprojection
    miss_px: list[float]  # of each mark, in the order of the places
    unused: int  # spots that are no mark


def find_marks(picture: Grey) -> SeenMarks:
    """Find round dark spots and their centres, weighted by darkness, to 0.05 px."""
    smooth = cv2.GaussianBlur(picture, (0, 0), 1.0)
    side = int(MAX_RADIUS_SHARE * min(picture.shape)) * 4 + 1
    around = cv2.morphologyEx(
        smooth, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    )
    darkness = around.astype(np.float64) - picture
    level = max(MIN_CONTRAST, 0.5 * float(np.percentile(darkness, 99.9)))
    dark = (cv2.subtract(around, smooth) > level).astype(np.uint8)
    count, found, sizes, _ = cv2.connectedComponentsWithStats(dark)
    labels, stats = np.asarray(found, np.int32), np.asarray(sizes, np.int32)
    centres, radii = [], []
    for label in range(1, count):
        spot = _spot(darkness, labels, stats[label], label)
        if spot is not None:
            centres.append(spot[:2])
            radii.append(spot[2])
    return SeenMarks(np.array(centres, dtype=np.float64).reshape(-1, 2), np.array(radii))


def _spot(
    darkness: FloatArray, labels: NDArray[np.int32], stats: NDArray[np.int32], label: int
) -> tuple[float, float, float] | None:
    """Measure centre and radius of a spot; None for one that is not round, or at the border."""
    left, top, width, height, area = (int(value) for value in stats[:5])
    radius = math.sqrt(area / math.pi)
    reach = 0.5 * max(width, height)
    limit = MAX_RADIUS_SHARE * min(darkness.shape)
    if not MIN_RADIUS_PX <= radius <= limit or area < MIN_ROUNDNESS * math.pi * reach * reach:
        return None
    margin = math.ceil(0.5 * radius) + 2
    x0, y0 = left - margin, top - margin
    x1, y1 = left + width + margin, top + height + margin
    if min(x0, y0) < 0 or y1 > darkness.shape[0] or x1 > darkness.shape[1]:
        return None
    near = labels[y0:y1, x0:x1]
    if np.any((near != 0) & (near != label)):
        return None
    weight = darkness[y0:y1, x0:x1] - np.median(darkness[y0:y1, x0:x1][near == 0])
    rows, columns = np.mgrid[y0:y1, x0:x1]
    inside = np.hypot(columns - (left + 0.5 * width - 0.5), rows - (top + 0.5 * height - 0.5))
    weight = weight * (inside <= reach + margin - 1)
    total = float(weight.sum())
    x = float((weight * columns).sum()) / total
    y = float((weight * rows).sum()) / total
    return x, y, radius


def find_pose(
    seen: SeenMarks, places_m: FloatArray, intrinsics: Intrinsics, plane: str
) -> MeasuredPose:
    """Match spots to the places (N, 3) of the marks and solve for the pose.

    plane: of the swing that the camera sees, x from the front, y from the right; turned by 30
    degrees at most. Raises VisionError for too few spots, and naming the marks that do not match.
    """
    if len(places_m) < MIN_MARKS:
        raise VisionError(f"{len(places_m)} places of marks; must be >= {MIN_MARKS}: add marks")
    if len(seen.centres_px) < len(places_m):
        raise VisionError(
            f"{len(seen.centres_px)} round dark spots in the picture, {len(places_m)} places of "
            "marks; must be as many at least: show every mark whole, dark on bright, and name "
            "only places that are in the picture"
        )
    best: MeasuredPose | None = None
    for scale in STARTS:
        pose = _matched(seen.centres_px, places_m, intrinsics, plane, scale)
        if pose is not None and (best is None or pose.rms_px < best.rms_px):
            best = pose
        if best is not None and best.rms_px <= MAX_RMS_PX:
            break
    if best is None or best.rms_px > MAX_RMS_PX:
        raise VisionError(_mismatch(best, seen, places_m, intrinsics, plane))
    return best


def _matched(
    centres_px: FloatArray,
    places_m: FloatArray,
    intrinsics: Intrinsics,
    plane: str,
    scale: float,
) -> MeasuredPose | None:
    """Match by turns: assign the nearest spots, then solve, from an upright camera."""
    predicted = _first_guess(centres_px, places_m, plane, scale)
    assigned: NDArray[np.intp] | None = None
    for _ in range(MATCH_ROUNDS):
        apart = np.linalg.norm(predicted[:, None] - centres_px[None], axis=2)
        # beyond a hundred pixels all spots are alike: a mark without a spot moves no other
        order = linear_sum_assignment(np.minimum(apart, 100.0))[1]
        if assigned is not None and np.array_equal(order, assigned):
            break
        is_first = assigned is None
        assigned = order
        found = centres_px[order]
        if is_first:
            predicted = _affine(places_m, found, plane)
            continue
        pose = _solve(found, places_m, intrinsics)
        if pose is None:
            return None
        predicted = _projected(pose, places_m, intrinsics)
    if assigned is None:
        return None
    return _pose(centres_px, assigned, places_m, intrinsics)


def _first_guess(
    centres_px: FloatArray, places_m: FloatArray, plane: str, scale: float
) -> FloatArray:
    """Place the marks over the spots, by mean and spread, as an upright camera sees them."""
    flat = places_m @ np.array(AXES[plane]).T
    middle = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    low, high = centres_px.min(axis=0), centres_px.max(axis=0)
    spread = np.ptp(flat, axis=0)
    per_m = float(np.max(high - low) / max(float(np.max(spread)), 1e-9))
    return np.asarray((flat - middle) * per_m * scale + 0.5 * (low + high))


def _affine(places_m: FloatArray, found_px: FloatArray, plane: str) -> FloatArray:
    """Fit an affine map from the places to the spots that were assigned, and apply it."""
    flat = places_m @ np.array(AXES[plane]).T
    basis = np.concatenate([flat, np.ones((len(flat), 1))], axis=1)
    return np.asarray(basis @ np.linalg.lstsq(basis, found_px, rcond=None)[0])


def _matrix(intrinsics: Intrinsics) -> FloatArray:
    (fx, fy), (cx, cy) = intrinsics.focal_px, intrinsics.centre_px
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def _solve(
    found_px: FloatArray, places_m: FloatArray, intrinsics: Intrinsics
) -> tuple[FloatArray, FloatArray] | None:
    """Solve for rotation and translation (3,); None where there is no solution."""
    lens = np.array(intrinsics.distortion)
    matrix = _matrix(intrinsics)
    ok, turn, move = cv2.solvePnP(places_m, found_px, matrix, lens, flags=cv2.SOLVEPNP_SQPNP)
    if not ok:
        return None
    turn, move = cv2.solvePnPRefineLM(places_m, found_px, matrix, lens, turn, move)
    if not np.isfinite(turn).all() or move[2, 0] <= 0.0:
        return None
    return np.asarray(turn, np.float64).ravel(), np.asarray(move, np.float64).ravel()


def _projected(
    pose: tuple[FloatArray, FloatArray], places_m: FloatArray, intrinsics: Intrinsics
) -> FloatArray:
    lens = np.array(intrinsics.distortion)
    pixels, _ = cv2.projectPoints(places_m, pose[0], pose[1], _matrix(intrinsics), lens)
    return np.asarray(pixels, np.float64).reshape(-1, 2)


def _pose(
    centres_px: FloatArray,
    assigned: NDArray[np.intp],
    places_m: FloatArray,
    intrinsics: Intrinsics,
) -> MeasuredPose | None:
    found = centres_px[assigned]
    solved = _solve(found, places_m, intrinsics)
    if solved is None:
        return None
    lens = np.array(intrinsics.distortion)
    turn, move = solved
    pixels, jacobian = cv2.projectPoints(places_m, turn, move, _matrix(intrinsics), lens)
    miss = np.asarray(pixels, np.float64).reshape(-1, 2) - found
    squares = float(np.sum(miss * miss))
    variance = squares / (miss.size - 6)
    slopes = np.asarray(jacobian, np.float64)[:, :6]
    sigma = np.sqrt(variance * np.diag(np.linalg.pinv(slopes.T @ slopes)))
    return MeasuredPose(
        rotation=_three(turn),
        translation_m=_three(move),
        sigma_rotation=_three(sigma[:3]),
        sigma_translation_m=_three(sigma[3:]),
        rms_px=math.sqrt(squares / len(miss)),
        miss_px=[float(one) for one in np.linalg.norm(miss, axis=1)],
        unused=len(centres_px) - len(places_m),
    )


def _three(values: FloatArray) -> Vector:
    a, b, c = (float(value) for value in values)
    return a, b, c


def _mismatch(
    pose: MeasuredPose | None,
    seen: SeenMarks,
    places_m: FloatArray,
    intrinsics: Intrinsics,
    plane: str,
) -> str:
    """Say which mark does not match: the one without which the others do, else the worst."""
    named: list[int] = []
    if len(places_m) > MIN_MARKS:
        for left_out in range(len(places_m)):
            others = np.delete(places_m, left_out, axis=0)
            rest = _matched(seen.centres_px, others, intrinsics, plane, STARTS[0])
            if rest is not None and rest.rms_px <= MAX_RMS_PX:
                named.append(left_out)
    if not named and pose is not None:
        named = [k for k, miss_px in enumerate(pose.miss_px) if miss_px > MAX_MISS_PX]
    places = ", ".join(f"number {k + 1} at {places_m[k].tolist()} m" for k in named)
    rms = "no pose" if pose is None else f"{pose.rms_px:.1f} px rms"
    return (
        f"marks that do not match their places: {places or 'unknown'}; the reprojection must be <= "
        f"{MAX_RMS_PX} px rms and is {rms}: correct their rows in the file of the places, in "
        "metres, x right, y ahead, z up from the pivot at home"
    )
