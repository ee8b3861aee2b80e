"""The admissible region of diameters and leads: one line for each limit that an axis sets (source 004, figs. C.5 and C.11)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.life import least_lead_by_life_m
from rig.drives.screw.limits import (
    greatest_lead_by_accuracy_m,
    greatest_lead_by_stiffness_m,
    least_diameter_by_buckling_m,
    least_diameter_by_sag_m,
    least_lead_by_balls_m,
    least_lead_by_whirl_m,
    stiffness_for_bandwidth_n_m,
)
from rig.drives.screw.shaft import BallScrew


class LimitCurve(NamedTuple):
    """A limit over diameters: leads below a least one, or above a greatest one, are not admissible."""

    name: str
    lead_m: FloatArray  # (N,)
    greatest: bool = False
    diameter_m: float | None = (
        None  # of an upright line, thinner screws are not admissible: lead_m is inf there, else 0
    )


class Region(NamedTuple):
    """All lines, and the leads between them; a region that is empty at a diameter has low_m > high_m there."""

    diameter_m: FloatArray  # (N,)
    lines: tuple[LimitCurve, ...]
    low_m: FloatArray  # (N,)
    high_m: FloatArray  # (N,), inf without a greatest lead


def region(axis: AxisSpec, diameter_m: FloatArray, nut: CatalogueEntry | None = None) -> Region:
    """Lines over diameters > 0, (N,), of the core and of the balls' circle, too.

    Balls and life are those of the nut where one is given, and life needs its dynamic load; wishes have lines where asked.

    Limits of the motor and of a unit are no part of it.
    """
    shafts = [
        BallScrew(diameter_m=d, lead_m=1.0, mounting=axis.mounting) for d in diameter_m.tolist()
    ]
    lines = (
        *_speed(axis, shafts, nut),
        *_strength(axis, diameter_m, nut),
        *_work(axis, shafts, diameter_m),
    )
    low = np.max([line.lead_m for line in lines if not line.greatest], axis=0)
    high = np.min(
        [np.full_like(diameter_m, math.inf), *(line.lead_m for line in lines if line.greatest)],
        axis=0,
    )
    return Region(diameter_m, lines, low, high)


def _speed(axis: AxisSpec, shafts: list[BallScrew], nut: CatalogueEntry | None) -> list[LimitCurve]:
    speed, balls = axis.demand.peak_speed_m_s, axis.balls_m_rpm(nut)
    return [
        LimitCurve(
            "whirling",
            np.array([least_lead_by_whirl_m(shaft, speed, axis.shares.whirl) for shaft in shafts]),
        ),
        LimitCurve(
            "balls",
            np.array([least_lead_by_balls_m(shaft.diameter_m, speed, balls) for shaft in shafts]),
        ),
    ]


def _strength(
    axis: AxisSpec, diameter_m: FloatArray, nut: CatalogueEntry | None
) -> list[LimitCurve]:
    need, shares, hours = axis.demand, axis.shares, axis.wishes.life_h
    lines = [
        _upright(
            "buckling",
            diameter_m,
            least_diameter_by_buckling_m(axis.mounting, need.peak_force_n, shares.buckling),
        )
    ]
    if hours is not None and nut is not None and nut.dynamic_load_n is not None:
        force = axis.equivalent_load_n(nut)
        least = least_lead_by_life_m(
            hours, nut.dynamic_load_n, force, need.mean_speed_m_s, shares.service_factor
        )
        lines.append(LimitCurve("life", np.full_like(diameter_m, least)))
    return lines


def _work(axis: AxisSpec, shafts: list[BallScrew], diameter_m: FloatArray) -> list[LimitCurve]:
    wishes, mass = axis.wishes, axis.load.mass_kg
    lines = []
    if wishes.sag_m is not None:
        thin = least_diameter_by_sag_m(
            axis.mounting, wishes.sag_m, axis.load.slope_rad, axis.carried_kg
        )
        lines.append(_upright("sag", diameter_m, thin))
    if wishes.position_error_m is not None and wishes.angle_error_rad is not None:
        most = greatest_lead_by_accuracy_m(wishes.position_error_m, wishes.angle_error_rad)
        lines.append(LimitCurve("accuracy", np.full_like(diameter_m, most), greatest=True))
    stiff: dict[str, list[float]] = {}
    if wishes.stiffness_n_m is not None:
        stiff["stiffness"] = [wishes.stiffness_n_m] * len(shafts)
    if wishes.bandwidth_rad_s is not None:
        stiff["bandwidth"] = [
            stiffness_for_bandwidth_n_m(shaft, mass, wishes.bandwidth_rad_s, axis.shares.bandwidth)
            for shaft in shafts
        ]
    for name, needed in stiff.items():
        leads = [
            greatest_lead_by_stiffness_m(shaft, k, axis.support_stiffness_n_m)
            for shaft, k in zip(shafts, needed, strict=True)
        ]
        lines.append(LimitCurve(name, np.array(leads), greatest=True))
    return lines


def _upright(name: str, diameter_m: FloatArray, least_m: float) -> LimitCurve:
    return LimitCurve(name, np.where(diameter_m < least_m, math.inf, 0.0), diameter_m=least_m)
