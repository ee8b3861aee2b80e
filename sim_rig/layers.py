"""Layers of a picture that do not follow the cable: behind it, and in front of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_rig import shapes
from sim_rig.camera_objects import Chessboard, Dust, Hand, Mark, Patch, PictureObject, StaticLine
from sim_rig.camera_pose import PosedCamera

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]


STATIC = (StaticLine, Mark, Dust, Hand, Patch, Chessboard)


class Canvas(NamedTuple):
    """Size of the image, pivot at home, lens blur (standard deviation) and seed of the places."""

    shape: tuple[int, int]  # height, width
    origin_px: FloatArray  # (2,)
    blur_px: float
    seed: Sequence[int]


class FrontLayer(NamedTuple):
    """Objects before the cable: level = passed x level behind + own x level of the screen."""

    passed: Image  # (height, width) share of the picture behind that is seen
    own: Image  # (height, width)


class Layers:
    """Static objects of a picture; the layers are drawn anew where an object comes or goes."""

    def __init__(
        self,
        objects: Sequence[PictureObject],
        pose: PosedCamera,
        home_m: FloatArray,
        canvas: Canvas,
    ) -> None:
        self._pose = pose
        self._home_m = home_m
        self._canvas = canvas
        self._objects = [item for item in objects if isinstance(item, STATIC)]
        self._shown: tuple[bool, ...] | None = None
        self._behind: Image | None = None
        self._front: FrontLayer | None = None

    def at(self, t_s: float) -> tuple[Image | None, FrontLayer | None]:
        """Draw the layers of a picture taken at t_s; None where there is nothing.

        The layer behind the cable is the factor (height, width) of the level of the screen.
        """
        shown = tuple(item.is_shown(t_s) for item in self._objects)
        if shown != self._shown:
            self._shown = shown
            present = [item for item in self._objects if item.is_shown(t_s)]
            self._behind = self._draw_behind(present)
            self._front = self._draw_front(present)
        return self._behind, self._front

    def _draw_behind(self, objects: Sequence[PictureObject]) -> Image | None:
        canvas = self._canvas
        factor = None
        for item in objects:
            if not isinstance(item, StaticLine | Mark):
                continue
            if factor is None:
                factor = np.ones(self._canvas.shape, np.float32)
            if isinstance(item, StaticLine):
                share = shapes.static_line(item, canvas.origin_px, canvas.blur_px, canvas.shape)
                factor *= 1.0 - item.dark * share
            else:
                self._draw_mark(item, factor)
        return factor

    def _draw_mark(self, item: Mark, factor: Image) -> None:
        place = self._pose.project((self._home_m + item.place_m)[None, :])
        if place is None:
            return
        drawn = shapes.disc(place[0], item.radius_px, self._canvas.blur_px, self._canvas.shape)
        if drawn is not None:
            box, share = drawn
            factor[box] *= 1.0 - item.dark * share

    def _draw_front(self, objects: Sequence[PictureObject]) -> FrontLayer | None:
        layer = None
        for item in objects:
            if not isinstance(item, Dust | Hand | Patch | Chessboard):
                continue
            if layer is None:
                shape = self._canvas.shape
                layer = FrontLayer(np.ones(shape, np.float32), np.zeros(shape, np.float32))
            covered, level = self._draw_object(item)
            layer.passed[:] *= 1.0 - covered
            layer.own[:] = layer.own * (1.0 - covered) + level
        return layer

    def _draw_object(self, item: Dust | Hand | Patch | Chessboard) -> tuple[Image, Image]:
        """Draw what an object covers, and its level times that share."""
        canvas = self._canvas
        if isinstance(item, Chessboard):
            return shapes.chessboard(item, self._pose, self._home_m, canvas.blur_px, canvas.shape)
        if isinstance(item, Dust):
            covered = self._draw_dust(item)
        elif isinstance(item, Hand):
            covered = shapes.hand(item, canvas.origin_px, canvas.blur_px, canvas.shape)
        else:
            covered = shapes.patch(item, canvas.origin_px, canvas.shape)
        return covered, (1.0 - item.dark) * covered

    def _draw_dust(self, item: Dust) -> Image:
        height, width = self._canvas.shape
        covered = np.zeros(self._canvas.shape, np.float32)
        random = np.random.default_rng(self._canvas.seed)
        for place in random.uniform((0.0, 0.0), (width, height), (item.count, 2)):
            drawn = shapes.disc(place, item.radius_px, self._canvas.blur_px, self._canvas.shape)
            if drawn is not None:
                box, share = drawn
                covered[box] = np.maximum(covered[box], share)
        return covered
