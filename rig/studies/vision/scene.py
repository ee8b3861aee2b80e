"""Scenes for `rig track --benchmark`: pictures of a swinging cable with their true angle."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from rig.errors import ConfigError
from rig.run.toml_file import Section, nearest
from rig.studies.vision.score import Bars, Expect

FloatArray = np.ndarray[Any, np.dtype[np.float64]]

WIDTH, HEIGHT = 640, 480
PIVOT_PX = (320.0, -40.0)
CABLE_PX, BLUR_PX = 2.5, 0.8  # width; standard deviation of lens and pixel
BACKGROUND, CONTRAST, NOISE = 200.0, 160.0, 2.5  # grey levels
SWING_RAD, SWING_HZ = 0.3, 0.55
RATE_HZ = 50.0


class SceneFrame(NamedTuple):
    """Picture with its truth."""

    number: int  # from 0
    t_s: float  # middle of the exposure of the first row, from the release of the load
    picture: NDArray[np.uint8]  # (height, width) or (height, width, 3) blue, green, red
    pivot_px: tuple[float, float]  # upper end of the cable as given to a tracker
    # slope angle of the least-squares line of the cable axis; None = cable not visible
    angle_rad: float | None
    bound_rad: float | None  # Cramer-Rao bound of that angle, free intercept; None = not defined


class Scene(Section, frozen=True, kw_only=True):
    """Table [scene] of a scene file."""

    name: str
    about: str
    expect: Expect = "angle"
    bars: Bars | None = None


SCENES = (
    Scene(
        name="clean",
        about="Sharp dark cable before an even screen.",
        bars=Bars(max_std_over_bound=1.3),
    ),
    Scene(name="hidden", about="Even screen without a cable.", expect="refuse"),
)


def shipped_scenes() -> list[str]:
    """List the names of the scenes that are shipped."""
    return [scene.name for scene in SCENES]


def read_scene(name_or_path: str) -> Scene:
    """Read a scene; raises ConfigError for an unknown one."""
    for scene in SCENES:
        if scene.name == name_or_path:
            return scene
    names = shipped_scenes()
    raise ConfigError(
        f"scene '{name_or_path}'; must be one of {', '.join(names)}{nearest(name_or_path, names)}"
    )


def picture_size(scene: Scene) -> tuple[int, int]:
    """Return width and height of the pictures of a scene [px]."""
    return WIDTH, HEIGHT


def scene_frames(scene: Scene, frames: int) -> Iterator[SceneFrame]:
    """Render the frames of a scene."""
    random = np.random.default_rng(1)
    for number in range(frames):
        t_s = number / RATE_HZ
        angle_rad = SWING_RAD * math.cos(2.0 * math.pi * SWING_HZ * t_s)
        noise = NOISE * random.standard_normal((HEIGHT, WIDTH))
        light = np.full((HEIGHT, WIDTH), BACKGROUND)
        truth = bound = None
        if scene.name != "hidden":
            light = _light(angle_rad, PIVOT_PX[0])
            truth, bound = angle_rad, _bound_rad(angle_rad)
        picture = np.clip(light + noise + 0.5, 0.0, 255.0).astype(np.uint8)
        yield SceneFrame(number, t_s, picture, PIVOT_PX, truth, bound)


def _light(angle_rad: float, pivot_column_px: float) -> FloatArray:
    """Draw the grey levels (HEIGHT, WIDTH) without noise."""
    down = np.arange(HEIGHT)[:, None] - PIVOT_PX[1]
    axis = pivot_column_px + math.tan(angle_rad) * down
    distance = (np.arange(WIDTH) - axis) * math.cos(angle_rad)
    inner = ndtr((distance + CABLE_PX / 2.0) / BLUR_PX) - ndtr(
        (distance - CABLE_PX / 2.0) / BLUR_PX
    )
    return np.asarray(BACKGROUND - CONTRAST * inner)


def _bound_rad(angle_rad: float) -> float:
    """Compute the Cramer-Rao bound of the angle, by differences of the picture."""
    turned = _light(angle_rad + 1e-5, PIVOT_PX[0]) - _light(angle_rad - 1e-5, PIVOT_PX[0])
    moved = _light(angle_rad, PIVOT_PX[0] + 1e-3) - _light(angle_rad, PIVOT_PX[0] - 1e-3)
    jacobian = np.stack([turned.ravel() / 2e-5, moved.ravel() / 2e-3])
    information = jacobian @ jacobian.T / NOISE**2
    return math.sqrt(np.linalg.inv(information)[0, 0])
