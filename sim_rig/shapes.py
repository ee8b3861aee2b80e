"""Shapes in an image, blurred by the lens: share of each pixel that they cover, 0 to 1."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.special import ndtr

from sim_rig.cable_axis import CableAxis
from sim_rig.camera_objects import Chessboard, Hand, Patch, StaticLine
from sim_rig.camera_pose import PosedCamera
from sim_rig.coverage import coverage
from sim_rig.profile import CableShape

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]
TAIL_SIGMAS = 4.0
GRID_PX = 16
BOARD_POINTS = 4  # samples of a chessboard per pixel along each direction
LIGHT_SQUARE, DARK_SQUARE = 1.0, 0.1  # of a chessboard, shares of the level of the screen


class Box(NamedTuple):
    """Part of an image."""

    rows: slice
    columns: slice


def disc(
    centre_px: FloatArray, radius_px: float, blur_px: float, shape: tuple[int, int]
) -> tuple[Box, Image] | None:
    """Draw a disc: its box in an image of that shape, and the share there; None outside it."""
    reach = radius_px + TAIL_SIGMAS * blur_px
    box = _box(
        centre_px[0] - reach,
        centre_px[0] + reach,
        centre_px[1] - reach,
        centre_px[1] + reach,
        shape,
    )
    if box is None:
        return None
    columns = np.arange(box.columns.start, box.columns.stop) - centre_px[0]
    rows = np.arange(box.rows.start, box.rows.stop)[:, None] - centre_px[1]
    share = ndtr((radius_px - np.hypot(rows, columns)) / blur_px)
    return box, share.astype(np.float32)


def static_line(
    line: StaticLine, origin_px: FloatArray, blur_px: float, shape: tuple[int, int]
) -> Image:
    """Draw a straight line (height, width); origin_px: the pivot at home."""
    height, width = shape
    slope = math.tan(math.radians(line.angle_deg))
    column, row = origin_px + line.at_px
    half = line.length_px * math.cos(math.radians(line.angle_deg))
    first = max(0, math.ceil(row - half))
    rows = np.arange(first, min(height, math.floor(row + half) + 1))
    image = np.zeros(shape, np.float32)
    if rows.size == 0:
        return image
    columns = column + slope * (rows - row)
    axis = CableAxis(first, columns, columns, columns, np.full(rows.size, slope), rows.size)
    strips = coverage(axis, CableShape(line.width_px, blur_px, 1.0), width)
    if strips is not None:
        image[strips.rows, strips.columns] = strips.share
    return image


def patch(item: Patch, origin_px: FloatArray, shape: tuple[int, int]) -> Image:
    """Draw a rectangle with sharp edges (height, width)."""
    left, top = origin_px + item.corner_px
    image = np.zeros(shape, np.float32)
    box = _box(left, left + item.size_px[0], top, top + item.size_px[1], shape)
    if box is not None:
        image[box] = 1.0
    return image


def hand(item: Hand, origin_px: FloatArray, blur_px: float, shape: tuple[int, int]) -> Image:
    """Draw an arm from its rounded tip to beyond the right edge (height, width)."""
    column, row = origin_px + item.tip_px
    turn = math.radians(item.angle_deg)
    right = np.arange(shape[1]) - column
    down = np.arange(shape[0])[:, None] - row
    along = right * math.cos(turn) - down * math.sin(turn)
    across = right * math.sin(turn) + down * math.cos(turn)
    distance = np.hypot(np.minimum(along, 0.0), across)
    share = ndtr((0.5 * item.width_px - distance) / blur_px)
    return np.asarray(share, np.float32)


def chessboard(
    item: Chessboard, pose: PosedCamera, home_m: FloatArray, blur_px: float, shape: tuple[int, int]
) -> tuple[Image, Image]:
    """Draw a chessboard: the share of each pixel that it covers, and its level there.

    Each (height, width); the level is a share of that of the screen. Its outer border is as wide as
    a square and light.
    """
    covered, level = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    along = board_axes(item) @ pose.axes
    centre_m = home_m + item.place_m
    squares = np.array([item.columns + 1, item.rows + 1])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (0.5 * squares + 1.0)
    outline = pose.project(centre_m + corners * item.square_m @ along)
    if outline is None:
        return covered, level
    (left, top), (right, bottom) = outline.min(axis=0) - 1.0, outline.max(axis=0) + 1.0
    box = _box(left, right, top, bottom, shape)
    if box is None:
        return covered, level
    places = _fine_places(box, pose, centre_m, along) / item.square_m
    places += 0.5 * squares[:, None, None]
    size = squares[:, None, None]
    is_board = np.all((places > -1.0) & (places < size + 1.0), axis=0)
    is_inner = np.all((places >= 0.0) & (places < size), axis=0)
    is_dark = is_inner & (np.floor(places).sum(axis=0) % 2 == 0)
    covered[box] = _average(is_board)
    level[box] = LIGHT_SQUARE * covered[box]
    level[box] -= (LIGHT_SQUARE - DARK_SQUARE) * _average(is_dark)
    blurred = [cv2.GaussianBlur(image, (0, 0), blur_px) for image in (covered, level)]
    return np.asarray(blurred[0], np.float32), np.asarray(blurred[1], np.float32)


def _fine_places(
    box: Box, pose: PosedCamera, origin_m: FloatArray, along_m: FloatArray
) -> FloatArray:
    """Find the places on a plane of the samples of the pixels in a box (2, rows, columns).

    Removing the distortion of the lens takes long; splines through every GRID_PX-th pixel are exact
    to 1e-6 of a pixel.
    """
    inside = (np.arange(BOARD_POINTS) + 0.5) / BOARD_POINTS - 0.5
    (rows, fine_rows), (columns, fine_columns) = (
        (_grid(part), (np.arange(part.start, part.stop)[:, None] + inside).ravel())
        for part in (box.rows, box.columns)
    )
    grid = np.stack(np.meshgrid(columns, rows), axis=-1)
    places = pose.on_plane(grid.reshape(-1, 2), origin_m, along_m).reshape(grid.shape)
    splines = [RectBivariateSpline(rows, columns, places[..., k]) for k in (0, 1)]
    return np.stack([spline(fine_rows, fine_columns) for spline in splines])


def _grid(part: slice) -> FloatArray:
    """Choose the knots of a spline over a part of the rows or columns."""
    knots = max(4, math.ceil((part.stop - part.start) / GRID_PX) + 1)
    return np.linspace(part.start - 1.0, part.stop, knots)


def board_axes(item: Chessboard) -> FloatArray:
    """Compute the directions of columns and rows of a board (2, 3): right, down, ahead."""
    a, b, c = map(math.radians, item.turn_deg)
    upright = np.array([[math.cos(a), 0.0, math.sin(a)], [0.0, 1.0, 0.0]])
    ahead = np.cross(upright[0], upright[1])
    columns = upright[0]
    rows = math.cos(b) * upright[1] + math.sin(b) * ahead
    return np.array(
        [
            math.cos(c) * columns + math.sin(c) * rows,
            math.cos(c) * rows - math.sin(c) * columns,
        ]
    )


def _average(fine: NDArray[np.bool_]) -> Image:
    """Average over the samples of each pixel."""
    height, width = fine.shape[0] // BOARD_POINTS, fine.shape[1] // BOARD_POINTS
    cells = fine.reshape(height, BOARD_POINTS, width, BOARD_POINTS)
    return np.asarray(cells.mean(axis=(1, 3)), np.float32)


def _box(
    left: float, right: float, top: float, bottom: float, shape: tuple[int, int]
) -> Box | None:
    """Cut a rectangle out of an image of that shape; None if it is outside."""
    rows = slice(max(0, math.ceil(top)), min(shape[0], math.floor(bottom) + 1))
    columns = slice(max(0, math.ceil(left)), min(shape[1], math.floor(right) + 1))
    if rows.start >= rows.stop or columns.start >= columns.stop:
        return None
    return Box(rows, columns)
