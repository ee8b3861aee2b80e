"""Door to the simulated plant: `[bench.*]` in, a task or its settings out.

Other modules of rig/run do not import sim_rig.
"""

from __future__ import annotations

from typing import Any

import msgspec

from comms.task import Task
from rig.errors import ConfigError, Refused
from rig.run.config import Experiment
from rig.run.job import Plant, safety_envelope
from rig.run.tasks.controller.task import COUNTING_POLICY
from rig.run.toml_file import convert
from rig.run.units import CABLE, SWING, suspect
from sim_rig.input_check import InputBounds
from sim_rig.params import BenchParams, CameraParams, PendulumParams, RobotParams, View
from sim_rig.task import BenchTask

LINKS = 1  # of the simulated load


def params(experiment: Experiment) -> BenchParams:
    """Read the parameters of the plant; raises ConfigError naming section, key, value and bound."""
    bench, view = experiment.bench, experiment.camera
    if bench.kind != "simulated":
        raise Refused(
            "[bench] kind = 'external': there is no driver for an external plant; "
            "must be 'simulated'"
        )
    for key, usual in (("length_m", CABLE), ("initial_swing_rad", SWING)):
        value = bench.pendulum.get(key)
        if isinstance(value, int | float):
            suspect(f"[bench.pendulum] {key} =", value, usual)
    try:
        return BenchParams(
            pendulum=convert(bench.pendulum, PendulumParams, "bench.pendulum"),
            robot=convert(bench.robot, RobotParams, "bench.robot"),
            camera=convert(bench.camera, CameraParams, "bench.camera"),
            view=View(width=view.width, height=view.height, rate_hz=view.rate_hz),
            seed=experiment.experiment.seed,
        )
    except ValueError as error:
        raise ConfigError(str(error)) from None


def plant(experiment: Experiment) -> Plant:
    """Describe the plant for the checks before a run. Raises ConfigError as params() does."""
    settings = msgspec.structs.replace(params(experiment), input=_input_bounds(experiment))
    return Plant(settings, LINKS)


def _input_bounds(experiment: Experiment) -> InputBounds:
    envelope = safety_envelope(experiment)
    return InputBounds(
        lower_m=(envelope.position_min_m, -envelope.depth_m, -envelope.height_m),
        upper_m=(envelope.position_max_m, envelope.depth_m, envelope.height_m),
        speed_m_s=envelope.speed_m_s,
        acceleration_m_s2=envelope.acceleration_m_s2,
        stops=experiment.controller.policy != COUNTING_POLICY,
    )


def task(settings: Any) -> Task:
    """Make the simulated plant a task of this process."""
    return BenchTask(msgspec.convert(msgspec.to_builtins(settings), BenchParams))
