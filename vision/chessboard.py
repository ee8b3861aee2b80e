"""Intrinsics and lens of a camera from pictures of a chessboard (Zhang 2000, in OpenCV)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.errors import VisionError
from vision.line_fit import Grey

FloatArray = NDArray[np.float64]
MIN_BOARDS = 6  # poses; fewer leave focal length and principal point together unclear
MAX_BOARDS = 60  # more cost time and add nothing
MIN_MOVE_PX = 4.0  # mean distance of the corners of two boards, below which they count once
MAX_RMS_PX = 1.0  # of the reprojection; a sharp picture leaves 0.05 to 0.3
OUTLIER_FACTOR = 3.0  # times the median rms of the boards
MIN_OUTLIER_PX = 0.1
MAX_WINDOW_PX = 11  # half width around a corner
STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
FIND_FLAGS = cv2.CALIB_CB_ADAPTIVE_THRESH + cv2.CALIB_CB_NORMALIZE_IMAGE
SMALLEST_BOARD = (4, 4)  # inner corners of another board that is looked for
OTHER_TRIES = 2  # pictures


class BoardSize(NamedTuple):
    """Chessboard: inner corners along the columns and rows of squares, and side of a square."""

    columns: int
    rows: int
    square_m: float

    @property
    def points_m(self) -> NDArray[np.float32]:
        """Corners (N, 3) on the board."""
        grid = np.mgrid[0 : self.columns, 0 : self.rows].T.reshape(-1, 2)
        return np.asarray(np.insert(self.square_m * grid, 2, 0.0, axis=1), np.float32)


class SeenBoard(NamedTuple):
    """Corners (N, 2) of a chessboard in a picture."""

    name: str  # of the picture
    corners_px: NDArray[np.float32]


class FoundBoards(NamedTuple):
    """Boards in pictures, and why other pictures have none."""

    boards: list[SeenBoard]
    size_px: tuple[int, int]  # of the pictures
    refused: dict[str, str]  # reason by name of the picture


class Intrinsics(NamedTuple):
    """Intrinsics and lens, each sigma one standard deviation of the noise of the corners."""

    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, float, float, float, float]  # k1, k2, p1, p2, k3
    sigma_focal_px: tuple[float, float]
    sigma_centre_px: tuple[float, float]
    sigma_distortion: tuple[float, float, float, float, float]
    rms_px: float  # of the reprojection
    used: list[str]  # names of the pictures
    refused: dict[str, str]  # reason by name of the picture


def find_boards(pictures: Iterable[tuple[str, Grey]], board: BoardSize) -> FoundBoards:
    """Find the chessboard in pictures with their names.

    Raises VisionError where there is no picture, where pictures differ in size, and where no board
    is found, naming the size of the one that is there.
    """
    boards: list[SeenBoard] = []
    refused: dict[str, str] = {}
    size_px: tuple[int, int] | None = None
    without: list[Grey] = []
    for name, picture in pictures:
        size_px = size_px or (picture.shape[1], picture.shape[0])
        if (picture.shape[1], picture.shape[0]) != size_px:
            raise VisionError(
                f"{name}: picture of {picture.shape[1]} x {picture.shape[0]} px; must be "
                f"{size_px[0]} x {size_px[1]} as those before: calibrate one camera at one size"
            )
        corners_px = _corners(picture, board)
        if corners_px is None:
            refused[name] = "no board"
            if len(without) < OTHER_TRIES:
                without.append(picture)
            continue
        reason = _not_needed(corners_px, boards)
        if reason:
            refused[name] = reason
            continue
        boards.append(SeenBoard(name, corners_px))
    if size_px is None:
        raise VisionError("no picture of a chessboard; must be one at least: name pictures")
    if not boards:
        raise VisionError(
            f"no board of {board.columns} x {board.rows} inner corners in {len(refused)} pictures; "
            f"must be in {MIN_BOARDS} at least: {_other_board(without)}"
        )
    return FoundBoards(boards, size_px, refused)


def _corners(picture: Grey, board: BoardSize) -> NDArray[np.float32] | None:
    """Find the inner corners to a few hundredths of a pixel; None without a board."""
    size = board.columns, board.rows
    flags = FIND_FLAGS + cv2.CALIB_CB_FAST_CHECK
    is_found, corners = cv2.findChessboardCorners(picture, size, flags=flags)
    if not is_found:
        return None
    corners = np.asarray(corners, np.float32).reshape(-1, 2)
    grid = corners.reshape(board.rows, board.columns, 2)
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1)]
    half_px = int(min(MAX_WINDOW_PX, max(2.0, 0.45 * min(steps))))
    start = corners.reshape(-1, 1, 2).copy()  # changed in place
    fine = cv2.cornerSubPix(picture, start, (half_px, half_px), (-1, -1), STOP)
    return np.asarray(fine, np.float32).reshape(-1, 2)


def _not_needed(corners_px: NDArray[np.float32], boards: Sequence[SeenBoard]) -> str:
    """Say why a board adds nothing to others; empty where it does."""
    if len(boards) >= MAX_BOARDS:
        return f"more than {MAX_BOARDS} boards"
    for other in boards:
        apart_px = np.linalg.norm(corners_px - other.corners_px, axis=1).mean()
        if apart_px < MIN_MOVE_PX:
            return f"board as in {other.name}"
    return ""


def _other_board(pictures: Sequence[Grey]) -> str:
    """Name the next step: another number of corners, if a board of it is in the pictures."""
    for picture in pictures:
        is_found, _, corners = cv2.findChessboardCornersSBWithMeta(
            picture, SMALLEST_BOARD, cv2.CALIB_CB_LARGER
        )
        if is_found and corners is not None:
            size = f"{max(corners.shape)}x{min(corners.shape)}"
            return f"there is one of {size}, give --corners {size}"
    return "show the whole board, flat, sharp and evenly lit, with its white border"


def calibrate_intrinsics(found: FoundBoards, board: BoardSize) -> Intrinsics:
    """Estimate intrinsics and lens (k1, k2, p1, p2; k3 = 0) from boards in MIN_BOARDS poses.

    A board whose reprojection is much worse than that of the others is left out. Raises VisionError
    for too few boards, and for a reprojection that no lens explains.
    """
    boards = list(found.boards)
    refused = dict(found.refused)
    _check_count(boards, refused)
    rms_px, matrix, lens, sigma, each_px = _calibrated(boards, found.size_px, board)
    limit_px = max(MIN_OUTLIER_PX, OUTLIER_FACTOR * float(np.median(each_px)))
    kept = []
    for seen, error_px in zip(boards, each_px, strict=True):
        if error_px > limit_px:
            refused[seen.name] = f"reprojection {error_px:.2f} px, others {np.median(each_px):.2f}"
        else:
            kept.append(seen)
    if len(kept) < len(boards):
        _check_count(kept, refused)
        rms_px, matrix, lens, sigma, _ = _calibrated(kept, found.size_px, board)
    if not rms_px <= MAX_RMS_PX:
        raise VisionError(
            f"reprojection of {len(kept)} boards: {rms_px:.2f} px rms; must be <= {MAX_RMS_PX} px: "
            "take sharp pictures of a flat board at rest, and give --corners as they are printed"
        )
    return Intrinsics(
        focal_px=(float(matrix[0, 0]), float(matrix[1, 1])),
        centre_px=(float(matrix[0, 2]), float(matrix[1, 2])),
        distortion=_five(lens),
        sigma_focal_px=(float(sigma[0]), float(sigma[1])),
        sigma_centre_px=(float(sigma[2]), float(sigma[3])),
        sigma_distortion=_five(sigma[4:]),
        rms_px=rms_px,
        used=[seen.name for seen in kept],
        refused=refused,
    )


def _five(values: FloatArray) -> tuple[float, float, float, float, float]:
    k1, k2, p1, p2, k3 = (float(value) for value in values[:5])
    return k1, k2, p1, p2, k3


def _check_count(boards: Sequence[SeenBoard], refused: dict[str, str]) -> None:
    if len(boards) >= MIN_BOARDS:
        return
    reasons = ", ".join(f"{name}: {reason}" for name, reason in list(refused.items())[:5])
    raise VisionError(
        f"{len(boards)} poses of the board ({reasons or 'no other picture'}); must be >= "
        f"{MIN_BOARDS}: take more pictures, with the board turned and in every part of the picture"
    )


def _calibrated(
    boards: Sequence[SeenBoard], size_px: tuple[int, int], board: BoardSize
) -> tuple[float, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Calibrate: rms [px], matrix, lens (5,), sigma of all (9,), rms of each board [px]."""
    points = [board.points_m for _ in boards]
    corners = [seen.corners_px for seen in boards]
    start = np.array([[1.0, 0.0, 0.5 * size_px[0]], [0.0, 1.0, 0.5 * size_px[1]], [0.0, 0.0, 1.0]])
    rms_px, matrix, lens, _, _, sigma, _, each_px = cv2.calibrateCameraExtended(
        points, corners, size_px, start, np.zeros(5), flags=cv2.CALIB_FIX_K3
    )
    numbers = np.asarray(sigma, np.float64).ravel()[:9]
    if not math.isfinite(rms_px):
        numbers = np.full(9, math.inf)
    return (
        float(rms_px),
        np.asarray(matrix, np.float64),
        np.asarray(lens, np.float64).ravel(),
        numbers,
        np.asarray(each_px, np.float64).ravel(),
    )
