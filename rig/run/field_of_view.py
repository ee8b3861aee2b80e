"""Field of view, before a run: the planned move stays in the picture and the calibrated range."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from comms.messages import SwingPlane
from planners.problem import Plan
from planners.replay import replay
from planners.trajectories.trajectory import Trajectory
from rig.errors import Refused
from rig.run.config import Experiment
from vision.camera_model import CameraModel, CameraParameters
from vision.offset_table import TOLERANCE_M
from vision.task import VisionSettings

VIEW_INSTANTS = 200  # of a move
VIEW_POINTS = 60  # of a cable
MARGIN_PX = 12.0  # beside the cable, for its width and the brightness around it
FloatArray = npt.NDArray[np.float64]


class CableView(NamedTuple):
    """Ends of the cable that is in the picture, over the move."""

    t_s: FloatArray  # (N,)
    columns_px: FloatArray  # (N, 2) at the upper and the lower end


def check_field_of_view(experiment: Experiment, plan: Plan, vision: VisionSettings) -> None:
    """Raise Refused where the planned move takes the cable out of the picture of a camera.

    Belief alone: model of the load, plan, and camera file or pivot and scale of the calibration. A
    camera without a camera file is checked for moves along its own axis.
    """
    if experiment.camera.rate_hz == 0.0:
        return
    if vision.model is not None:
        _check_calibrated_range(plan, vision)
        _check_view(model_view(plan, vision, vision.model), vision)
        return
    is_x = vision.swing_plane is SwingPlane.X
    if is_x and plan.problem.axis == "x" and not experiment.move.waypoints:
        _check_calibrated_range(plan, vision)
        _check_view(cable_view(plan, vision), vision)


def _check_view(view: CableView, vision: VisionSettings) -> None:
    low_px = view.columns_px.min(axis=1) - MARGIN_PX
    high_px = view.columns_px.max(axis=1) + MARGIN_PX
    beyond_px = np.maximum(-low_px, high_px - (vision.width - 1))
    if np.isnan(beyond_px).any():
        at_s = view.t_s[int(np.argmax(np.isnan(beyond_px)))]
        raise Refused(
            f"the plan takes the cable above, below or behind the picture {at_s:.2f} s into the "
            "move; part of it must be in the picture: move less far, or turn the camera"
        )
    worst = int(np.argmax(beyond_px))
    if beyond_px[worst] <= 0.0:
        return
    lower, upper = view.columns_px[worst].min(), view.columns_px[worst].max()
    room_m = beyond_px[worst] / vision.pixels_per_m
    raise Refused(
        f"the plan takes the cable out of the picture {view.t_s[worst]:.2f} s into the move: it "
        f"spans the columns {lower:.0f} to {upper:.0f}; must be within {MARGIN_PX:.0f} to "
        f"{vision.width - 1 - MARGIN_PX:.0f}: move {room_m * 1e3:.0f} mm less far, start further "
        "away, give the move more time, or run without a camera (--set camera.rate_hz=0)"
    )


def _check_calibrated_range(plan: Plan, vision: VisionSettings) -> None:
    """Raise Refused where the plan leaves the range of the offset table."""
    if not vision.x_m:
        return
    is_x = vision.swing_plane is SwingPlane.X
    low_m, high_m = (plan.motion.x if is_x else plan.motion.y).extent(0)
    first_m, last_m = vision.x_m[0] - TOLERANCE_M, vision.x_m[-1] + TOLERANCE_M
    if first_m <= low_m and high_m <= last_m:
        return
    raise Refused(
        f"the plan goes from {low_m:.3f} to {high_m:.3f} m; the calibration of the camera must "
        f"cover it, and covers {vision.x_m[0]:.3f} to {vision.x_m[-1]:.3f} m: calibrate over a "
        "wider range with `rig calibrate offsets`, move less far, or run without a table (--set "
        "vision.calibration=none)"
    )


def cable_view(plan: Plan, vision: VisionSettings) -> CableView:
    """Project the first link of the planned load to the picture, as the tracker would."""
    swing = replay(plan.problem.model, plan.motion.x)
    x_m = plan.motion.x.at(swing.t_s)
    slope = np.tan(swing.angle_rad[:, 0])
    pivot_u, pivot_v = vision.pivot_home_px
    length_px = _first_link_m(plan) * vision.pixels_per_m * np.cos(swing.angle_rad[:, 0])
    rows = np.stack(
        [
            np.full(slope.size, max(0.0, pivot_v)),
            np.minimum(vision.height - 1.0, pivot_v + length_px),
        ],
        axis=1,
    )
    columns = pivot_u + vision.pixels_per_m * x_m[:, None] + slope[:, None] * (rows - pivot_v)
    return CableView(swing.t_s, columns)


def model_view(plan: Plan, vision: VisionSettings, parameters: CameraParameters) -> CableView:
    """Project the first link of the planned load by a camera model; NaN where none is in view.

    The swings along x and y are those of each axis by itself.
    """
    model = CameraModel(parameters)
    t_s = np.linspace(0.0, plan.motion.duration_s, VIEW_INSTANTS)
    places_m = plan.motion.at(t_s)
    slopes = np.stack([_slopes(plan, axis, t_s) for axis in (plan.motion.x, plan.motion.y)], axis=1)
    down_m = np.linspace(0.0, 1.0, VIEW_POINTS) * _first_link_m(plan)
    columns = []
    for place_m, (slope_x, slope_y) in zip(places_m, slopes, strict=True):
        along = np.array([slope_x, slope_y, -1.0]) / math.sqrt(1.0 + slope_x**2 + slope_y**2)
        pixels = model.project(place_m + down_m[:, None] * along)
        columns.append(_seen_columns(pixels, vision.height))
    return CableView(t_s, np.array(columns))


def _seen_columns(pixels: FloatArray, height: int) -> list[float]:
    """Find the smallest and the largest column within the rows of the picture; NaN without any."""
    seen = (pixels[:, 1] >= 0.0) & (pixels[:, 1] <= height - 1.0)
    if not seen.any():
        return [math.nan, math.nan]
    return [float(pixels[seen, 0].min()), float(pixels[seen, 0].max())]


def _slopes(plan: Plan, axis: Trajectory, t_s: FloatArray) -> FloatArray:
    """Compute the tangent of the first link's angle along an axis at t_s (N,)."""
    low_m, high_m = axis.extent(0)
    if high_m <= low_m:
        return np.zeros_like(t_s)
    swing = replay(plan.problem.model, axis)
    return np.interp(t_s, swing.t_s, np.tan(swing.angle_rad[:, 0]))


def _first_link_m(plan: Plan) -> float:
    parameters = plan.problem.model.parameters
    return parameters.get("length_1", parameters.get("length", 1.0))
