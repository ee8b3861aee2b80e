"""Door to the simulated camera: an experiment in, pictures with their truth out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rig.errors import ConfigError
from rig.run.config import Experiment
from rig.run.runtime.bench import params
from sim_rig.camera import Pinhole

TruthRow = tuple[int, float, float, Any]  # frame, t_s, angle_rad, BGR picture


def pivot_px(experiment: Experiment) -> tuple[float, float]:
    """Where the cable's upper end is in the picture before anything moves [px]."""
    world = params(experiment)
    line = Pinhole(world.camera, world.view, world.home_m).line(world.start_m, 0.0)
    if line is None:
        raise ConfigError("[bench.camera] does not see the cable: move it back or level it")
    return line.column_px + line.slope * line.pivot_row_px, line.pivot_row_px


def synthetic_video(experiment: Experiment, seconds: float) -> Iterator[TruthRow]:
    """Frames of a freely swinging load with their truth."""
    from sim_rig.synthetic import swinging_video

    yield from swinging_video(params(experiment), seconds)
