"""Picture of a plain camera: level or pitched, sharp, global shutter, one evenly lit grey plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim_rig.cable_state import CableState
from sim_rig.camera import Pinhole
from sim_rig.camera_params import CameraParams
from sim_rig.params import BenchParams
from sim_rig.renderer import Cable, Renderer

# keys that a plain camera may change; all others have their default values
PLAIN_KEYS = (
    "pitch_deg",
    "noise",
    "psf_px",
    "exposure_ms",
    "pixels_per_m",
    "gain_drift_rel",
    "cable_width_px",
    "distance_m",
    "pivot_above_axis_m",
    "screen_m",
    "background",
    "contrast",
    "screen_colour",
    "cable_colour",
    "name",
    "rate_hz",
    "jitter_us",
    "faults",
)


def is_plain(camera: CameraParams) -> bool:
    """Tell if the fast renderer draws what this camera sees."""
    default = CameraParams()
    return camera.contrast >= 0.0 and all(
        getattr(camera, key) == getattr(default, key)
        for key in CameraParams.__struct_fields__
        if key not in PLAIN_KEYS
    )


class PlainImager:
    """Camera number `number`, from 0, of a plant, if it is plain."""

    def __init__(self, params: BenchParams, number: int) -> None:
        camera = params.cameras[number]
        exposure_ns = round(camera.exposure_ms * 1e6)
        self.instants_ns = [0, exposure_ns // 2, exposure_ns]
        self._pinhole = Pinhole(camera, params.view, params.home_m)
        seed = params.seed if number == 0 else (params.seed, number)
        self._renderer = Renderer(camera, params.view, seed)

    def picture(self, states: list[CableState], start_s: float, index: int) -> NDArray[np.uint8]:
        """Take the picture of the states at the start, the middle and the end of the exposure."""
        start, middle, end = (
            self._project(state, start_s + 1e-9 * instant_ns)
            for state, instant_ns in zip(states, self.instants_ns, strict=True)
        )
        return self._renderer.picture(index, start, middle, end)

    def _project(self, state: CableState, t_s: float) -> Cable | None:
        """Project the cable at t_s since the start of the simulation; a straight one to a line."""
        if state.bent_m or len(state.links) > 1:
            return self._pinhole.curve(state.position_m, state.points_m, t_s)
        link = state.links[0]
        return self._pinhole.line(state.position_m, link.angle_x_rad, link.angle_y_rad, t_s)
