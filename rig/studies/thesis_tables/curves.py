"""What a plan leaves on a load that is not the planned one: the source's sensitivity figures, as numbers and drawn."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import numpy as np

from planners.catalog import plan
from planners.models.model import Model
from planners.problem import Problem
from planners.replay.wrong_parameters import residual_amplitudes
from planners.trajectories.trajectory import Trajectory
from rig.studies.thesis_tables.loads import PENDULUM, TWO_BARS

DISTANCE_M = 0.2
CURVE_POINTS = 49  # of a curve, the nominal value among them


class Load(NamedTuple):
    """A load of the source, the parameters that may be wrong with their lowest and highest value, and one to be robust in."""

    model: Model
    ranges: dict[str, tuple[float, float]]
    robust: str  # any that moves the frequencies gives the same plan


class Family(NamedTuple):
    """A planner with its options, and the times the source gives it."""

    planner: str
    times_s: tuple[float, ...]
    input: str = "acceleration"
    robust: bool = False


LOADS = {
    "pendulum": Load(PENDULUM, {"length": (0.7, 1.3)}, "length"),
    "two_bars": Load(
        TWO_BARS,
        {"length_1": (0.35, 0.65), "length_2": (0.35, 0.65), "stiffness_1": (5.0, 15.0)},
        "length_2",
    ),
}
FAMILIES = {
    "simple": Family("convolution", (2.5, 2.0, 1.5)),
    "robust": Family("convolution", (2.5, 2.0, 1.5), robust=True),
    "jerk": Family("convolution", (2.0, 1.5), input="jerk"),
    "robust_jerk": Family("convolution", (2.0, 1.5), input="jerk", robust=True),
    "ZV": Family("zv", (2.5, 2.0, 1.5)),
    "ZVD": Family("zvd", (2.5,)),  # the shaper alone lasts 2.01 s, that of the bars 2.03 s
}


class Series(msgspec.Struct, frozen=True, kw_only=True):
    """Swing left at the end of one plan over the values of one parameter."""

    load: str
    family: str
    time_s: float
    parameter: str
    nominal: float
    values: list[float]  # SI
    residual_rad: list[float]  # small swings
    residual_nonlinear_rad: list[float]


def sensitivity_document() -> dict[str, Series]:
    """Every curve by its name, e.g. "pendulum.robust_T2.length" (source 004, sections 3.2 and 4.3; 0.2 m from rest to rest)."""
    return {
        f"{load}.{family}_T{time_s:g}.{series.parameter}": series
        for load in LOADS
        for family, kind in FAMILIES.items()
        for time_s in kind.times_s
        for series in _series(load, family, time_s)
    }


def _series(load: str, family: str, time_s: float) -> Iterator[Series]:
    """Curves of one plan, all parameters at once."""
    model, ranges, _ = LOADS[load]
    trajectory = _plan(load, family, time_s)
    values = {
        name: np.linspace(low, high, CURVE_POINTS).tolist() for name, (low, high) in ranges.items()
    }
    real = [model.with_parameter(name, value) for name in values for value in values[name]]
    small, full = (
        residual_amplitudes(real, trajectory, nonlinear=kind).reshape(-1, CURVE_POINTS)
        for kind in (False, True)
    )
    for name, linear, nonlinear in zip(values, small.tolist(), full.tolist(), strict=True):
        yield Series(
            load=load,
            family=family,
            time_s=time_s,
            parameter=name,
            nominal=model.parameters[name],
            values=values[name],
            residual_rad=linear,
            residual_nonlinear_rad=nonlinear,
        )


def _plan(load: str, family: str, time_s: float) -> Trajectory:
    model, _, robust = LOADS[load]
    planner, _, input, forgiving = FAMILIES[family]
    problem = Problem(
        distance_m=DISTANCE_M,
        time_s=time_s,
        model=model,
        input=input,
        robust=(robust,) if forgiving else (),
    )
    return plan(planner, problem).motion.x
