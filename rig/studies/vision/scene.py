"""Scene: what a camera sees, and what a tracker must do with it.

A scene file has a table [scene] and the tables [camera] and [bench.*] of an experiment.
"""

from __future__ import annotations

import copy
import math
import tomllib
import warnings
import zlib
from collections.abc import Callable, Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from rig.errors import ConfigError, StrangeValue
from rig.run.config import Experiment, Pixel
from rig.run.toml_file import Section, convert, nearest, override, read_toml
from rig.studies.vision import bench
from rig.studies.vision.score import Bars, Expect
from rig.studies.vision.stamps import Stamps

TABLES = ("scene", "camera", "bench")
# of every scene, where its file gives nothing else: a swing of 0.3 rad at 0.55 Hz, sharp
BASE: dict[str, Any] = {
    "experiment": {"name": "scene", "kind": "free_decay"},
    "bench": {
        "robot": {"kind": "cartesian"},
        "pendulum": {"length_m": 0.82, "initial_swing_rad": 0.3},
        "camera": {"pitch_deg": 0.0, "exposure_ms": 2.0},
    },
}


class PlatformSine(Section, frozen=True, kw_only=True):
    """`[scene.motion]`: the platform moves along x as a sine."""

    amplitude_m: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.05
    frequency_hz: Annotated[float, Meta(gt=0.0, le=5.0)] = 0.5

    def position_m(self, t_s: float) -> tuple[float, float, float]:
        """Compute the setpoint of the platform at a time [s]."""
        return self.amplitude_m * math.sin(math.tau * self.frequency_hz * t_s), 0.0, 0.0


class SceneSection(Section, frozen=True, kw_only=True):
    """`[scene]`: what is special, and what a tracker must do."""

    about: str
    # angle: measure it where the cable is seen; refuse: give no angle at all
    expect: Expect = "angle"
    frames: Annotated[int, Meta(ge=1, le=100_000)] = 300
    stamps: Stamps = "cfr"  # of the video
    camera: Annotated[int, Meta(ge=1, le=3)] = 1
    # of the noise; by default another one for each name
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] | None = None
    # what a tracker is told about the pivot, less the truth
    pivot_error_px: tuple[Pixel, Pixel] = (0.0, 0.0)
    motion: PlatformSine | None = None
    bars: Bars = Bars()  # a tracker passes if it keeps them


class SceneFrame(NamedTuple):
    """Picture of a scene with what is true in it."""

    number: int  # from 0; a dropped one is missing
    t_s: float  # middle of the exposure of the first row, from the release of the load
    picture: NDArray[np.uint8]  # (height, width), or (height, width, 3) blue, green, red
    pivot_px: tuple[float, float]  # upper end of the cable as it is given to a tracker
    # slope angle of the straight line through the axis of the cable; None where it is not seen
    angle_rad: float | None
    bound_rad: float | None  # Cramer-Rao bound of that angle; None without noise
    cable_rad: float  # true angle of the cable at t_s


class Scene(NamedTuple):
    """Scene by name."""

    name: str
    section: SceneSection
    plant: Any  # with its cameras

    @property
    def about(self) -> str:
        """Special property of the scene."""
        return self.section.about

    @property
    def expect(self) -> Expect:
        """Required result of a tracker."""
        return self.section.expect

    @property
    def bars(self) -> Bars:
        """Bounds that a tracker must keep."""
        return self.section.bars

    @property
    def rate_hz(self) -> float:
        """Frame rate of the camera."""
        return bench.rate_hz(self.plant, self.section.camera - 1)


def shipped_scenes() -> list[str]:
    """List the names of the scenes that come with the program."""
    names = [file.name for file in _folder().iterdir()]
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def read_scene(name_or_path: str, overrides: Sequence[str] = ()) -> Scene:
    """Read a scene by shipped name or TOML file, with `section.key=value` overrides.

    Raises ConfigError naming section, key, value, bound and the nearest known key.
    """
    known = shipped_scenes()
    if name_or_path in known:
        name = name_or_path
        tables = tomllib.loads((_folder() / f"{name}.toml").read_text())
    elif Path(name_or_path).is_file():
        name = Path(name_or_path).stem
        tables = read_toml(Path(name_or_path), "scene")
    else:
        raise ConfigError(
            f"scene '{name_or_path}': no such file and not a shipped scene"
            f"{nearest(name_or_path, known)}; `rig sim --list-scenes` names the shipped ones"
        )
    for text in overrides:
        override(tables, text)
    return make_scene(name, tables)


def make_scene(name: str, tables: dict[str, Any]) -> Scene:
    """Make a scene from the tables of a file. Raises ConfigError."""
    for table in tables:
        if table not in TABLES:
            raise ConfigError(
                f"[{table}] in scene '{name}': unknown table{nearest(table, TABLES)}; must be one "
                f"of {', '.join(TABLES)}: remove it"
            )
    section = convert(tables.get("scene", {}), SceneSection, "scene")
    experiment = convert(_over_base(tables, _seed(name, section)), Experiment)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StrangeValue)  # a scene may well swing by 0.9 rad
        plant = bench.read_plant(experiment, section.camera - 1)
    return Scene(name, section, plant)


def scene_frames(scene: Scene, frames: int) -> Iterator[SceneFrame]:
    """Generate the first frames of a scene; fewer where the camera drops some."""
    section = scene.section
    motion: Callable[[float], bench.Position] | None = None
    if section.motion is not None:
        motion = section.motion.position_m
    number = section.camera - 1
    seconds = frames / scene.rate_hz
    error_x, error_y = section.pivot_error_px
    for frame in bench.camera_frames(scene.plant, seconds, number, motion):
        if frame.number >= frames:
            return
        x, y = frame.truth.pivot_px
        yield SceneFrame(
            frame.number,
            frame.t_s,
            frame.pixels,
            (x + error_x, y + error_y),
            frame.truth.angle_rad,
            frame.truth.bound_rad,
            frame.angle_rad,
        )


def colour_planes(scene: Scene) -> Any:
    """Make what turns pictures into those of a colour video: colour(picture, number of frame)."""
    return bench.colour_planes(scene.plant, scene.section.camera - 1)


def picture_size(scene: Scene) -> tuple[int, int]:
    """Return width and height of the pictures."""
    return scene.plant.view.width, scene.plant.view.height


def _seed(name: str, section: SceneSection) -> int:
    return zlib.crc32(name.encode()) if section.seed is None else section.seed


def _over_base(tables: dict[str, Any], seed: int) -> dict[str, Any]:
    """Put the tables of a scene over those that every scene has."""
    merged = _merged(BASE, {key: tables[key] for key in ("camera", "bench") if key in tables})
    merged["experiment"]["seed"] = seed
    own = tables.get("bench", {})
    replaced = {"links": "pendulum", "cameras": "camera"}
    for key, base_key in replaced.items():
        if isinstance(own, dict) and key in own and base_key not in own:
            del merged["bench"][base_key]
    return merged


def _merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Merge tables key by key; a table of over that is none in base replaces it."""
    merged = copy.deepcopy(base)
    for key, value in over.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _merged(merged[key], value) if both else value
    return merged


def _folder() -> Any:
    return resources.files("rig.studies.vision") / "scenes"
