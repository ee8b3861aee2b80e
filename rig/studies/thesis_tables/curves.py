"""Residual vibration versus parameter error (sensitivity curves).

The curves are those of source 004, sections 3.2 and 4.3.
"""

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


class CurveLoad(NamedTuple):
    """Load of the source with the parameters that are varied."""

    model: Model
    ranges: dict[str, tuple[float, float]]  # lowest and highest value by parameter
    robust: str  # parameter of the robust plans; any that changes a frequency gives the same plan


class PlannerFamily(NamedTuple):
    """Planner with its options, and the durations of its moves in the source."""

    planner: str
    times_s: tuple[float, ...]
    input: str = "acceleration"
    robust: bool = False


LOADS = {
    "pendulum": CurveLoad(PENDULUM, {"length": (0.7, 1.3)}, "length"),
    "two_bars": CurveLoad(
        TWO_BARS,
        {"length_1": (0.35, 0.65), "length_2": (0.35, 0.65), "stiffness_1": (5.0, 15.0)},
        "length_2",
    ),
}
FAMILIES = {
    "simple": PlannerFamily("convolution", (2.5, 2.0, 1.5)),
    "robust": PlannerFamily("convolution", (2.5, 2.0, 1.5), robust=True),
    "jerk": PlannerFamily("convolution", (2.0, 1.5), input="jerk"),
    "robust_jerk": PlannerFamily("convolution", (2.0, 1.5), input="jerk", robust=True),
    "ZV": PlannerFamily("zv", (2.5, 2.0, 1.5)),
    # the shaper alone takes 2.01 s for the pendulum, 2.03 s for the bars
    "ZVD": PlannerFamily("zvd", (2.5,)),
}


class SensitivityCurve(msgspec.Struct, frozen=True, kw_only=True):
    """Residual swing of one plan over the true value of one parameter."""

    load: str
    family: str
    time_s: float
    parameter: str
    nominal: float
    values: list[float]  # SI
    residual_rad: list[float]  # linear model
    residual_nonlinear_rad: list[float]


def sensitivity_document() -> dict[str, SensitivityCurve]:
    """Compute every curve by its name, e.g. "pendulum.robust_T2.length".

    The moves are 0.2 m from rest to rest.
    """
    document = {}
    for load in LOADS:
        for family, kind in FAMILIES.items():
            for time_s in kind.times_s:
                for curve in _curves(load, family, time_s):
                    name = f"{load}.{family}_T{time_s:g}.{curve.parameter}"
                    document[name] = curve
    return document


def _curves(load: str, family: str, time_s: float) -> Iterator[SensitivityCurve]:
    """Compute the curves of one plan, for all parameters at once."""
    model, ranges, _ = LOADS[load]
    trajectory = _plan(load, family, time_s)
    values = {
        name: np.linspace(low, high, CURVE_POINTS).tolist() for name, (low, high) in ranges.items()
    }
    true_models = [model.with_parameter(name, value) for name in values for value in values[name]]
    linear, nonlinear = (
        residual_amplitudes(true_models, trajectory, nonlinear=kind).reshape(-1, CURVE_POINTS)
        for kind in (False, True)
    )
    for name, small, full in zip(values, linear.tolist(), nonlinear.tolist(), strict=True):
        yield SensitivityCurve(
            load=load,
            family=family,
            time_s=time_s,
            parameter=name,
            nominal=model.parameters[name],
            values=values[name],
            residual_rad=small,
            residual_nonlinear_rad=full,
        )


def _plan(load: str, family: str, time_s: float) -> Trajectory:
    model, _, robust_parameter = LOADS[load]
    kind = FAMILIES[family]
    problem = Problem(
        distance_m=DISTANCE_M,
        time_s=time_s,
        model=model,
        input=kind.input,
        robust=(robust_parameter,) if kind.robust else (),
    )
    return plan(kind.planner, problem).motion.x
