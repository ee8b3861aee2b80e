"""Admissible region of diameters and leads: a limit curve for each limit of an axis.

See source 004, figs. C.5 and C.11.
"""

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
    """Least or greatest admissible lead over the diameter."""

    name: str
    lead_m: FloatArray  # (N,)
    greatest: bool = False
    # of a vertical line: smaller diameters are not admissible, lead_m is inf there, else 0
    diameter_m: float | None = None


class Region(NamedTuple):
    """Limit curves, and the admissible leads; none at a diameter where low_m > high_m."""

    diameter_m: FloatArray  # (N,)
    lines: tuple[LimitCurve, ...]
    low_m: FloatArray  # (N,)
    high_m: FloatArray  # (N,), inf without a greatest lead


def region(axis: AxisSpec, diameter_m: FloatArray, nut: CatalogueEntry | None = None) -> Region:
    """Compute the limit curves over diameters > 0, (N,), for shafts of one diameter.

    Balls and life are those of the nut where one is given; life needs its dynamic load rating. A
    requirement has a curve only where it is specified. Limits of motor and unit have none.
    """
    shafts = [
        BallScrew(diameter_m=d, lead_m=1.0, mounting=axis.mounting) for d in diameter_m.tolist()
    ]
    lines = (
        *_speed_curves(axis, shafts, nut),
        *_strength_curves(axis, diameter_m, nut),
        *_requirement_curves(axis, shafts, diameter_m),
    )
    low = np.max([line.lead_m for line in lines if not line.greatest], axis=0)
    high = np.min(
        [np.full_like(diameter_m, math.inf), *(line.lead_m for line in lines if line.greatest)],
        axis=0,
    )
    return Region(diameter_m, lines, low, high)


def _speed_curves(
    axis: AxisSpec, shafts: list[BallScrew], nut: CatalogueEntry | None
) -> list[LimitCurve]:
    speed, share = axis.demand.peak_speed_m_s, axis.utilisation.whirl
    balls = axis.balls_m_rpm(nut)
    by_whirl = [least_lead_by_whirl_m(shaft, speed, share) for shaft in shafts]
    by_balls = [least_lead_by_balls_m(shaft.diameter_m, speed, balls) for shaft in shafts]
    return [
        LimitCurve("whirling", np.array(by_whirl)),
        LimitCurve("balls", np.array(by_balls)),
    ]


def _strength_curves(
    axis: AxisSpec, diameter_m: FloatArray, nut: CatalogueEntry | None
) -> list[LimitCurve]:
    need, utilisation, hours = axis.demand, axis.utilisation, axis.requirements.life_h
    least_m = least_diameter_by_buckling_m(axis.mounting, need.peak_force_n, utilisation.buckling)
    lines = [_vertical("buckling", diameter_m, least_m)]
    if hours is not None and nut is not None and nut.dynamic_load_n is not None:
        force = axis.equivalent_load_n(nut)
        least = least_lead_by_life_m(
            hours, nut.dynamic_load_n, force, need.mean_speed_m_s, utilisation.service_factor
        )
        lines.append(LimitCurve("life", np.full_like(diameter_m, least)))
    return lines


def _requirement_curves(
    axis: AxisSpec, shafts: list[BallScrew], diameter_m: FloatArray
) -> list[LimitCurve]:
    required = axis.requirements
    lines = []
    if required.sag_m is not None:
        least_m = least_diameter_by_sag_m(
            axis.mounting, required.sag_m, axis.load.slope_rad, axis.carried_kg
        )
        lines.append(_vertical("sag", diameter_m, least_m))
    if required.position_error_m is not None and required.angle_error_rad is not None:
        lead_m = greatest_lead_by_accuracy_m(required.position_error_m, required.angle_error_rad)
        lines.append(LimitCurve("accuracy", np.full_like(diameter_m, lead_m), greatest=True))
    if required.stiffness_n_m is not None:
        stiffness = [required.stiffness_n_m] * len(shafts)
        lines.append(_stiffness_curve("stiffness", axis, shafts, stiffness))
    if required.bandwidth_rad_s is not None:
        mass, share = axis.load.mass_kg, axis.utilisation.bandwidth
        stiffness = [
            stiffness_for_bandwidth_n_m(shaft, mass, required.bandwidth_rad_s, share)
            for shaft in shafts
        ]
        lines.append(_stiffness_curve("bandwidth", axis, shafts, stiffness))
    return lines


def _stiffness_curve(
    name: str, axis: AxisSpec, shafts: list[BallScrew], stiffness_n_m: list[float]
) -> LimitCurve:
    """Compute the greatest leads of shafts that have to reach a stiffness each."""
    leads = [
        greatest_lead_by_stiffness_m(shaft, k, axis.support_stiffness_n_m)
        for shaft, k in zip(shafts, stiffness_n_m, strict=True)
    ]
    return LimitCurve(name, np.array(leads), greatest=True)


def _vertical(name: str, diameter_m: FloatArray, least_m: float) -> LimitCurve:
    return LimitCurve(name, np.where(diameter_m < least_m, math.inf, 0.0), diameter_m=least_m)
