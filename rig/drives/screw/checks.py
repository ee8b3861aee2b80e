"""Whether a screw does for an axis: every check with its value, its bound and what is left (source 004, appendix C)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.demand import ShaftDemand, shaft_demand
from rig.drives.screw.lead_classes import LEAD_CLASSES, TABULATED, travel_deviation_m
from rig.drives.screw.life import dynamic_load_n, life_h
from rig.drives.screw.limits import RPM, greatest_lead_by_accuracy_m
from rig.drives.screw.preload import ball_load_n
from rig.drives.screw.remedies import (
    against_balls,
    against_buckling,
    against_heat,
    against_inaccuracy,
    against_sag,
    against_slowness,
    against_softness,
    against_torque,
    against_wear,
    against_whirl,
    for_want_of_a_rating,
    slower,
)
from rig.drives.screw.shaft import BallScrew
from rig.drives.screw.verdict import Assessment, LimitCheck

SOURCE = ", ".join(TABULATED)
WHIRL, BALLS, UNIT, MOTOR = (
    "whirling",
    "ball speed d n",
    "speed of the unit",
    "motor speed",
)  # all in proportion to the speed


def assess(axis: AxisSpec, candidate: CatalogueEntry) -> Assessment:
    """Every check of a candidate on an axis. Buckling takes the largest force for a push, whichever way it acts."""
    screw = candidate.screw(axis.mounting)
    shaft = shaft_demand(axis.cycle, axis.load, axis.drive(candidate), screw)
    checks = (
        *_shaft(axis, candidate, screw),
        *_nut(axis, candidate),
        *_accuracy(axis, candidate, screw),
        *_stiffness(axis, screw),
        *_motor(axis, candidate, screw, shaft),
    )
    return Assessment(candidate, screw, shaft, checks)


def _shaft(axis: AxisSpec, candidate: CatalogueEntry, screw: BallScrew) -> list[LimitCheck]:
    """Whirling, balls, buckling."""
    need, shares = axis.demand, axis.shares
    turns_rpm = need.peak_speed_m_s / screw.ratio_m_rad * RPM
    critical_rpm, load_n = (
        shares.whirl * screw.whirl_rad_s * RPM,
        shares.buckling * screw.buckling_load_n,
    )
    return [
        LimitCheck(WHIRL, turns_rpm, critical_rpm, "rpm", against_whirl(axis, screw)),
        LimitCheck(
            BALLS,
            turns_rpm * screw.circle_m,
            axis.balls_m_rpm(candidate),
            "m rpm",
            against_balls(axis, candidate, screw),
        ),
        LimitCheck("buckling", need.peak_force_n, load_n, "N", against_buckling(axis, screw)),
    ]


def _nut(axis: AxisSpec, candidate: CatalogueEntry) -> list[LimitCheck]:
    """Loads, life, and the unit's own limits."""
    need, factor, hours = axis.demand, axis.shares.service_factor, axis.wishes.life_h
    rated, lead, force = (
        candidate.dynamic_load_n,
        candidate.lead_m,
        axis.equivalent_load_n(candidate),
    )
    unrated = for_want_of_a_rating(axis, candidate)
    load = (
        None if hours is None else dynamic_load_n(hours, force, need.mean_speed_m_s, lead, factor)
    )
    life = None if rated is None else life_h(rated, force, need.mean_speed_m_s, lead, factor)
    pressed = factor * float(
        ball_load_n(np.array([need.peak_force_n]), axis.preload_n(candidate))[0]
    )
    limit, wear = candidate.speed_m_s, against_wear(axis, candidate)
    return [
        LimitCheck("dynamic load", load, rated, "N", wear, missing=unrated),
        LimitCheck("life", life, hours, "h", wear, at_least=True, missing=unrated),
        LimitCheck("static load", pressed, candidate.static_load_n, "N", "a stronger nut"),
        LimitCheck(
            UNIT, need.peak_speed_m_s, limit, "m/s", slower(axis.cycle, limit) if limit else ""
        ),
        LimitCheck("stroke of the unit", need.travel_m, candidate.stroke_m, "m", "a longer unit"),
    ]


def _accuracy(axis: AxisSpec, candidate: CatalogueEntry, screw: BallScrew) -> list[LimitCheck]:
    """Lead class, deviation over the travel, lead that is too great."""
    wishes, name, travel = axis.wishes, candidate.lead_class, axis.demand.travel_m
    silent = "" if name is not None else "no lead class in the catalogue; ask the maker"
    deviation = None if name is None else travel_deviation_m(name, travel)
    off_table = f"source 004 tabulates no deviation of {name} over {travel:g} m; ask the maker"
    note = (
        ""
        if name is None or name in TABULATED
        else f"{name} is outside the classes that source 004 tabulates, {SOURCE}"
    )
    wanted = wishes.travel_deviation_m
    lead = (
        None
        if wishes.position_error_m is None or wishes.angle_error_rad is None
        else greatest_lead_by_accuracy_m(wishes.position_error_m, wishes.angle_error_rad)
    )
    return [
        LimitCheck(
            "lead class",
            None if name is None else LEAD_CLASSES[name].per_300_mm_m * 1e6,
            None
            if wishes.lead_class is None
            else LEAD_CLASSES[wishes.lead_class].per_300_mm_m * 1e6,
            "µm per 300 mm",
            f"{name} is coarser than {wishes.lead_class}: take a finer screw, or set lead_class to what the work allows",
            missing=f"{silent} for {wishes.lead_class} or a finer one"
            if silent and wishes.lead_class
            else "",
            note=note,
            classes=True,
        ),
        LimitCheck(
            "lead over the travel",
            None if deviation is None else deviation * 1e6,
            None if wanted is None else wanted * 1e6,
            "µm",
            "a finer class",
            missing="" if wanted is None or deviation is not None else silent or off_table,
        ),
        LimitCheck(
            "lead for accuracy",
            candidate.lead_m,
            lead,
            "m",
            against_inaccuracy(screw, lead) if lead else "",
        ),
    ]


def _stiffness(axis: AxisSpec, screw: BallScrew) -> list[LimitCheck]:
    """Sag, stiffness, bandwidth."""
    wishes, stiffness = axis.wishes, axis.stiffness_n_m(screw)
    reach = axis.shares.bandwidth * screw.antiresonance_rad_s(axis.load.mass_kg, stiffness)
    wanted, fast, sag = wishes.stiffness_n_m, wishes.bandwidth_rad_s, wishes.sag_m
    softness = "" if wanted is None else against_softness(axis, screw, wanted)
    slowness = "" if fast is None else against_slowness(axis, screw, fast)
    return [
        LimitCheck(
            "sag",
            screw.sag_m(axis.load.slope_rad, axis.carried_kg),
            sag,
            "m",
            "" if sag is None else against_sag(axis, screw, sag),
        ),
        LimitCheck("stiffness", stiffness, wanted, "N/m", softness, at_least=True),
        LimitCheck("bandwidth", reach, fast, "rad/s", slowness, at_least=True),
    ]


def _motor(
    axis: AxisSpec, candidate: CatalogueEntry, screw: BallScrew, need: ShaftDemand
) -> list[LimitCheck]:
    """Torque, heat, speed and power; without a motor they are told, not judged."""
    motor, drive = axis.motor, axis.drive(candidate)
    peak, steady, top, power = (
        (
            motor.peak_torque_n_m,
            motor.continuous_torque_n_m,
            motor.max_speed_rad_s,
            motor.peak_power_w,
        )
        if motor
        else (None, None, None, None)
    )
    force = "" if peak is None else against_torque(axis, drive, screw, peak)
    heat = "" if steady is None else against_heat(axis, drive, screw, need.rms_torque_n_m, steady)
    return [
        LimitCheck("motor torque, peak", need.peak_torque_n_m, peak, "N m", force),
        LimitCheck("motor torque, rms", need.rms_torque_n_m, steady, "N m", heat),
        LimitCheck(
            MOTOR,
            need.peak_speed_rad_s * RPM,
            None if top is None else top * RPM,
            "rpm",
            "" if top is None else slower(axis.cycle, top * screw.ratio_m_rad),
        ),
        LimitCheck(
            "motor power",
            need.peak_power_w,
            None if power == math.inf else power,
            "W",
            "more time for the moves",
        ),
    ]


class AllowedSpeed(NamedTuple):
    """The greatest speed of the nut, and the check that sets it."""

    speed_m_s: float
    check: str


def allowed_speed(axis: AxisSpec, found: Assessment) -> AllowedSpeed:
    """What whirling, balls, unit and motor let the nut do; at its own lead, whatever the cycle asks."""
    speed = axis.demand.peak_speed_m_s
    return min(
        AllowedSpeed(speed * check.bound / check.value, check.name)
        for check in found.checks
        if check.name in (WHIRL, BALLS, UNIT, MOTOR) and check.value and check.bound
    )
