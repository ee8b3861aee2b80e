"""Picture of a camera with all its faults, and what is true in that picture.

From back to front: the screen under its light, static lines and marks, the shadow of the cable, the
cable, its knots and the load, then dust, patches, a hand and chessboards, then glare.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_rig import shapes
from sim_rig.cable_axis import AxisProjector, CableAxis
from sim_rig.cable_state import CableState
from sim_rig.camera_objects import Glare, Knots, LoadInPicture, Shadow
from sim_rig.camera_pose import PosedCamera
from sim_rig.coverage import Strips, coverage, derivative
from sim_rig.layers import Canvas, Layers
from sim_rig.light import Light
from sim_rig.params import BenchParams
from sim_rig.profile import CableShape
from sim_rig.sensor import Sensor

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]
GREY_PLANES = (2,)  # red alone
COLOUR_PLANES = (0, 1, 2)
FLANK_WIDTH_SHARE = 0.25  # of the cable, lit from the side
FLANK_SHIFT_SHARE = 0.375  # of its width, from the axis to the middle of the lit flank
HIDDEN_SHARE = 0.5  # a row of the cable that is covered by more than this is not seen
MIN_SEEN_ROWS = 8


class PictureTruth(NamedTuple):
    """Truth in a picture without noise."""

    pivot_px: tuple[float, float]
    rows: int  # with a visible cable
    # of the straight line that fits the axis of the first link best over these rows; None if there
    # are too few
    angle_rad: float | None
    # Cramer-Rao bound of that angle, place of the line unknown; None without noise or information
    bound_rad: float | None


class Imager:
    """Camera number `number`, from 0, of a plant."""

    def __init__(self, params: BenchParams, number: int) -> None:
        camera, view = params.cameras[number], params.view
        exposure_s, row_s = camera.exposure_ms * 1e-3, camera.row_us * 1e-6
        self._shape = view.height, view.width
        self._camera = camera
        self._pose = PosedCamera(camera, view, params.home_m)
        self.projector = AxisProjector(self._pose, view.height, exposure_s, row_s)
        self.instants_ns = [round(1e9 * instant) for instant in self.projector.instants_s]
        self._cable = CableShape(camera.cable_width_px, camera.psf_px, 1.0)
        home_m = np.asarray(params.home_m)
        origin = self._pose.project(home_m[None, :])
        if origin is None:
            raise ValueError(
                f"camera {number + 1} is turned away from the home position or behind it; must "
                "look at the cable: reduce yaw_deg, pitch_deg and shift_m"
            )
        blur_px = math.sqrt(camera.psf_px**2 + 1.0 / 12.0)
        canvas = Canvas(self._shape, origin[0], blur_px, (params.seed, number, 1))
        self._canvas = canvas
        self._layers = Layers(camera.objects, self._pose, home_m, canvas)
        self._light = Light(camera.light, self._shape, exposure_s, row_s)
        self._sensor = Sensor(camera, self._shape, (params.seed, number, 2))
        colour = camera.sensor.kind in ("colour", "bayer")
        self._planes = COLOUR_PLANES if colour else GREY_PLANES

    @property
    def gain(self) -> float:
        """Gain of the sensor."""
        return self._camera.sensor.gain

    def picture(
        self, states: Sequence[CableState], start_s: float, index: int
    ) -> NDArray[np.uint8]:
        """Take the picture of the states at the instants of the projector, from start_s on."""
        axis = self.projector.axis(states, start_s)
        middle = states[len(states) // 2]
        return self._sensor.picture(self.levels(axis, middle, start_s), index)

    def truth(self, states: Sequence[CableState], start_s: float) -> PictureTruth:
        """Compute what is true in the picture of these states."""
        middle = states[len(states) // 2]
        pivot = self.projector.pivot_px(middle, self.projector.middle_s(start_s))
        place = (math.nan, math.nan) if pivot is None else (float(pivot[0]), float(pivot[1]))
        axis = self.projector.axis(states, start_s)
        if axis is None:
            return PictureTruth(place, 0, None, None)
        seen = self._seen(axis, start_s)
        count = int(np.count_nonzero(seen))
        if count < MIN_SEEN_ROWS:
            return PictureTruth(place, count, None, None)
        rows, columns = axis.rows[seen], axis.mean_px[seen]
        slope = float(np.polyfit(rows - rows.mean(), columns, 1)[0])
        bound_rad = self._bound_rad(axis, middle, seen, start_s)
        return PictureTruth(place, count, math.atan(slope), bound_rad)

    def levels(self, axis: CableAxis | None, state: CableState, start_s: float) -> list[Image]:
        """Compute the level of light on each pixel of each plane, without noise."""
        behind, front = self._layers.at(start_s)
        screen = self._screen(start_s)
        strips = None
        if axis is not None:
            strips = coverage(axis, self._cable, self._shape[1])
        planes = []
        for plane in self._planes:
            level = np.empty(self._shape, np.float32)
            level[:] = self._screen_level(plane) * screen
            own = level.copy() if front is not None else level
            if behind is not None:
                level *= behind
            self._draw_shadow(level, axis, start_s)
            if strips is not None and axis is not None:
                self._draw_cable(level, strips, screen, plane)
                self._draw_flank(level, axis)
            self._draw_followers(level, state, start_s)
            if front is not None:
                level *= front.passed
                level += front.own * own
            self._draw_glare(level, start_s)
            planes.append(level)
        return planes

    def _screen_level(self, plane: int) -> np.float32:
        return np.float32(self._camera.background * self._camera.screen_colour[plane])

    def _cable_level(self, plane: int) -> float:
        camera = self._camera
        return (camera.background - camera.contrast) * camera.cable_colour[plane]

    def _draw_cable(self, level: Image, strips: Strips, screen: Image, plane: int) -> None:
        """Put the cable before what is there; its own level follows the light of the screen."""
        light = np.broadcast_to(screen, self._shape)[strips.rows, strips.columns]
        there = level[strips.rows, strips.columns]
        own = self._cable_level(plane) * light
        level[strips.rows, strips.columns] = there + strips.share * (own - there)

    def _draw_flank(self, level: Image, axis: CableAxis) -> None:
        """Add the light on the right flank, which grows from the pivot down."""
        flank = self._camera.light.flank
        if not flank:
            return
        width_px = self._camera.cable_width_px
        shape = CableShape(FLANK_WIDTH_SHARE * width_px, self._cable.psf_px, 1.0)
        strips = coverage(axis, shape, self._shape[1], FLANK_SHIFT_SHARE * width_px)
        if strips is None:
            return
        pivot_row = self._canvas.origin_px[1]
        growth = (strips.rows - pivot_row) / max(self._shape[0] - 1.0 - pivot_row, 1.0)
        light = flank * np.clip(growth, 0.0, 1.0) * strips.share
        level[strips.rows, strips.columns] += light.astype(np.float32)

    def _draw_shadow(self, level: Image, axis: CableAxis | None, start_s: float) -> None:
        for item in self._camera.objects:
            if axis is None or not isinstance(item, Shadow) or not item.is_shown(start_s):
                continue
            shape = CableShape(item.width_px, self._cable.psf_px, 1.0)
            strips = coverage(axis, shape, self._shape[1], item.shift_px)
            if strips is not None:
                factor = 1.0 - item.dark * strips.share
                level[strips.rows, strips.columns] *= factor.astype(np.float32)

    def _draw_followers(self, level: Image, state: CableState, start_s: float) -> None:
        """Draw what moves with the cable: knots and the load."""
        t_s = self.projector.middle_s(start_s)
        for item in self._camera.objects:
            if isinstance(item, Knots) and item.is_shown(start_s):
                for place in self._knots_px(state, item.spacing_m, t_s):
                    self._draw_disc(level, place, item.radius_px, item.dark)
            if isinstance(item, LoadInPicture) and item.is_shown(start_s):
                end = self.projector.end_px(state, t_s)
                if end is not None:
                    self._draw_disc(level, end[0], item.radius_m * end[1], item.dark)

    def _knots_px(self, state: CableState, spacing_m: float, t_s: float) -> FloatArray:
        """Project the knots (N, 2) at t_s."""
        points = np.asarray(state.points_m) + state.position_m
        pieces_m = np.linalg.norm(np.diff(points, axis=0), axis=1)
        lengths = np.concatenate([[0.0], np.cumsum(pieces_m)])
        along = np.arange(spacing_m, lengths[-1], spacing_m)
        knots = np.stack([np.interp(along, lengths, part) for part in points.T], axis=1)
        pixels = self._pose.project(knots, t_s) if len(knots) else None
        return np.zeros((0, 2)) if pixels is None else pixels

    def _draw_disc(self, level: Image, place: FloatArray, radius_px: float, dark: float) -> None:
        drawn = shapes.disc(place, radius_px, self._canvas.blur_px, self._shape)
        if drawn is None:
            return
        box, share = drawn
        bright = np.float32((1.0 - dark) * self._camera.background)
        level[box] += share * (bright - level[box])

    def _draw_glare(self, level: Image, start_s: float) -> None:
        for item in self._camera.objects:
            if not isinstance(item, Glare) or not item.is_shown(start_s):
                continue
            moved = np.multiply(item.velocity_px_s, start_s)
            column, row = self._canvas.origin_px + item.at_px + moved
            across = _bell(np.arange(self._shape[1]) - column, item.radius_px)
            down = _bell(np.arange(self._shape[0]) - row, item.radius_px)
            level += np.outer(np.float32(item.level) * down, across)

    def _seen(self, axis: CableAxis, start_s: float) -> NDArray[np.bool_]:
        """Mark the rows (R,) of the first link in the picture that nothing covers."""
        width = self._shape[1]
        columns = axis.mean_px
        seen = (columns >= 0.0) & (columns <= width - 1.0)
        seen &= np.arange(columns.size) < axis.link_rows
        _, front = self._layers.at(start_s)
        if front is not None:
            near = np.clip(np.rint(columns), 0, width - 1).astype(np.intp)
            seen &= front.passed[axis.rows.astype(np.intp), near] > 1.0 - HIDDEN_SHARE
        return seen

    def _bound_rad(
        self, axis: CableAxis, state: CableState, seen: NDArray[np.bool_], start_s: float
    ) -> float | None:
        """Compute the Cramer-Rao bound from the white noise of every pixel near the cable."""
        if not self._sensor.is_noisy:
            return None
        strips = coverage(axis, self._cable, self._shape[1])
        if strips is None:
            return None
        change = derivative(strips, axis, self._cable)
        behind, front = self._layers.at(start_s)
        light = np.broadcast_to(self._screen(start_s), self._shape)[strips.rows, strips.columns]
        levels = self.levels(axis, state, start_s)
        information = np.zeros(axis.mean_px.size)  # on the column of each row [1/px^2]
        for plane, level in zip(self._planes, levels, strict=True):
            backdrop = self._screen_level(plane) * light
            if behind is not None:
                backdrop = backdrop * behind[strips.rows, strips.columns]
            slopes = (self._cable_level(plane) * light - backdrop) * change
            if front is not None:
                slopes = slopes * front.passed[strips.rows, strips.columns]
            variance = self._sensor.variance(level[strips.rows, strips.columns].astype(np.float64))
            sites = self._sensor.sites(plane, strips.rows, strips.columns)
            information += (sites * slopes**2 / variance).sum(axis=1)
        information[~seen] = 0.0
        bound = _slope_bound(axis.rows, information)
        if not math.isfinite(bound):
            return None
        return bound * float(np.mean(1.0 / (1.0 + axis.slope[seen] ** 2)))

    def _screen(self, start_s: float) -> Image:
        """Compute the light on the screen: a factor of shape (1 or height, 1 or width)."""
        screen = self._light.level(start_s)
        if self._light.gradient is not None:
            screen = screen * self._light.gradient
        return screen


def _slope_bound(rows: FloatArray, information: FloatArray) -> float:
    """Compute the smallest standard deviation of the slope of a line of unknown place."""
    total = float(information.sum())
    if total <= 0.0:
        return math.inf
    spread = rows - float(information @ rows) / total
    inertia = float(information @ spread**2)
    return 1.0 / math.sqrt(inertia) if inertia > 0.0 else math.inf


def _bell(distance_px: FloatArray, radius_px: float) -> Image:
    """Compute a normal curve of height 1."""
    return np.asarray(np.exp(-0.5 * (distance_px / radius_px) ** 2), np.float32)
