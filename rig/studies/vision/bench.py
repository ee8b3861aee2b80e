"""Door to the simulated cameras: an experiment in, pictures with what is true in them out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from rig.errors import ConfigError
from rig.run.config import Experiment
from rig.run.runtime.bench import params
from sim_rig.imager import Imager, PictureTruth
from sim_rig.params import BenchParams
from sim_rig.synthetic import ColourPlanes, swinging_video

Position = tuple[float, float, float]


class CameraFrame(NamedTuple):
    """Picture of a simulated camera."""

    number: int  # of the exposure, from 0; a dropped one is missing
    t_s: float  # middle of the exposure of the first row, from the release of the load
    angle_rad: float  # true angle of the first link in the plane of the camera at that instant
    pixels: Any  # (height, width), or (height, width, 3) blue, green, red
    truth: PictureTruth  # in the picture


def read_plant(experiment: Experiment, number: int) -> BenchParams:
    """Read the plant of an experiment, with camera number, from 0, that takes pictures.

    Raises ConfigError for a camera without frame rate, or one that does not exist or is turned
    away.
    """
    plant = params(experiment)
    if number >= len(plant.cameras):
        raise ConfigError(
            f"camera {number + 1} of {len(plant.cameras)}; must be 1 to {len(plant.cameras)}: "
            "choose another, or add it to [[bench.cameras]]"
        )
    if plant.rate_hz(plant.cameras[number]) == 0.0:
        raise ConfigError("[camera] rate_hz = 0: no pictures to take; set it to 50")
    try:
        Imager(plant, number)
    except ValueError as error:
        raise ConfigError(str(error)) from None
    return plant


def rate_hz(plant: BenchParams, number: int) -> float:
    """Return the frame rate of a camera."""
    return plant.rate_hz(plant.cameras[number])


def colour_planes(plant: BenchParams, number: int) -> ColourPlanes:
    """Make what turns pictures of a camera into those of a colour video."""
    return ColourPlanes(plant, number)


def camera_frames(
    plant: BenchParams,
    seconds: float,
    number: int = 0,
    motion: Callable[[float], Position] | None = None,
) -> Iterator[CameraFrame]:
    """Generate the frames of camera number, from 0, of a load released at the start.

    motion: position of the platform at a time, at rest without it.
    """
    imager = Imager(plant, number)
    across = plant.cameras[number].plane == "y"
    for frame in swinging_video(plant, seconds, number, motion):
        exposure = frame.exposure
        yield CameraFrame(
            frame.number,
            frame.t_s,
            frame.angle_y_rad if across else frame.angle_rad,
            exposure.pixels,
            imager.truth(exposure.states, exposure.true_start_ns * 1e-9),
        )
