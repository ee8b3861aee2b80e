"""Door to the simulated camera: an experiment in, pictures with their true angle out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rig.errors import ConfigError
from rig.run.config import Experiment
from rig.run.runtime.bench import params
from sim_rig.camera import Pinhole

TruthRow = tuple[int, float, float, Any]  # frame, t_s, angle_rad, BGR picture


def pivot_px(experiment: Experiment) -> tuple[float, float]:
    """Compute the position of the pivot in the picture before any motion [px]."""
    plant = params(experiment)
    camera = Pinhole(plant.cameras[0], plant.view, plant.home_m)
    line = camera.line(plant.start_m, 0.0)
    if line is None:
        raise ConfigError(
            "[bench.camera] does not see the cable; it must lie in the picture: "
            "move the camera back or level it"
        )
    return line.column_px + line.slope * line.pivot_row_px, line.pivot_row_px


def synthetic_video(experiment: Experiment, seconds: float) -> Iterator[TruthRow]:
    """Generate the frames of a freely swinging load with their true angle."""
    from sim_rig.synthetic import swinging_video

    yield from swinging_video(params(experiment), seconds)
