"""The one door to the simulated bench: `[bench.*]` in, a task or its settings out. Nothing else in rig/ knows its insides."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import msgspec

from comms.task import Task
from rig.config import Experiment
from rig.errors import ConfigError, Refused
from rig.job import Plant
from rig.toml_file import convert
from sim_rig.camera import Pinhole
from sim_rig.elastic_joint import ElasticJoint
from sim_rig.joint_params import Joint
from sim_rig.params import BenchParams, Camera, Pendulum, Robot, View
from sim_rig.task import BenchTask

LINKS = 1  # the simulated load hangs on
TruthRow = tuple[int, float, float, Any]  # frame, t_s, angle_rad, BGR picture


def params(experiment: Experiment) -> BenchParams:
    """The world of an experiment; raises ConfigError naming section, key, value and bound."""
    bench, view = experiment.bench, experiment.camera
    if bench.kind != "simulated":
        raise Refused("[bench] kind = 'external': no other bench can be talked to yet; must be 'simulated'")
    try:
        return BenchParams(
            pendulum=convert(bench.pendulum, Pendulum, "bench.pendulum"),
            robot=convert(bench.robot, Robot, "bench.robot"),
            camera=convert(bench.camera, Camera, "bench.camera"),
            view=View(width=view.width, height=view.height, rate_hz=view.rate_hz),
            seed=experiment.experiment.seed,
        )
    except ValueError as error:
        raise ConfigError(str(error)) from None


def plant(experiment: Experiment) -> Plant:
    """The plant of an experiment as the preflight checks see it. Raises ConfigError as params() does."""
    return Plant(params(experiment), LINKS)


def task(settings: Any) -> Task:
    """The simulated bench as a task of this process."""
    return BenchTask(msgspec.convert(msgspec.to_builtins(settings), BenchParams))


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


def elastic_joint(tables: dict[str, Any], seed: int, section: str = "bench") -> ElasticJoint:
    """The world of a drive's study from that section; raises ConfigError naming section, key, value and bound."""
    try:
        return ElasticJoint(convert(tables, Joint, section), seed)
    except ValueError as error:
        raise ConfigError(str(error)) from None
