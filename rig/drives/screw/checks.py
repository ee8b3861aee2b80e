"""Checks of a screw against the limits of an axis (source 004, appendix C)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.demand import ShaftDemand, shaft_demand
from rig.drives.screw.lead_classes import LEAD_CLASSES, TABULATED, travel_deviation_m
from rig.drives.screw.life import dynamic_load_n, life_h
from rig.drives.screw.limits import RPM_PER_RAD_S, greatest_lead_by_accuracy_m
from rig.drives.screw.preload import ball_load_n
from rig.drives.screw.remedies import (
    remedy_ball_speed,
    remedy_buckling,
    remedy_fatigue_life,
    remedy_lead_accuracy,
    remedy_low_bandwidth,
    remedy_low_stiffness,
    remedy_missing_rating,
    remedy_peak_torque,
    remedy_rms_torque,
    remedy_sag,
    remedy_speed,
    remedy_whirling,
)
from rig.drives.screw.shaft import BallScrew
from rig.drives.screw.verdict import Assessment, LimitCheck

WHIRLING = "whirling"
BALL_SPEED = "ball speed d n"
UNIT_SPEED = "speed of the unit"
MOTOR_SPEED = "motor speed"
SPEED_CHECKS = (WHIRLING, BALL_SPEED, UNIT_SPEED, MOTOR_SPEED)  # values proportional to the speed


def assess(axis: AxisSpec, candidate: CatalogueEntry) -> Assessment:
    """Check a candidate against all limits of an axis.

    Buckling takes the largest force as a push, in whichever direction it acts.
    """
    screw = candidate.screw(axis.mounting)
    shaft = shaft_demand(axis.cycle, axis.load, axis.transmission_for(candidate), screw)
    checks = (
        *_check_shaft(axis, candidate, screw),
        *_check_nut(axis, candidate),
        *_check_unit(axis, candidate),
        *_check_accuracy(axis, candidate, screw),
        *_check_stiffness(axis, screw),
        *_check_motor(axis, candidate, screw, shaft),
    )
    return Assessment(candidate, screw, shaft, checks)


def _check_shaft(axis: AxisSpec, candidate: CatalogueEntry, screw: BallScrew) -> list[LimitCheck]:
    """Check whirling, ball speed and buckling."""
    need, utilisation = axis.demand, axis.utilisation
    speed_rpm = need.peak_speed_m_s / screw.ratio_m_rad * RPM_PER_RAD_S
    critical_rpm = utilisation.whirl * screw.whirl_rad_s * RPM_PER_RAD_S
    load_n = utilisation.buckling * screw.buckling_load_n
    return [
        LimitCheck(WHIRLING, speed_rpm, critical_rpm, "rpm", remedy_whirling(axis, screw)),
        LimitCheck(
            BALL_SPEED,
            speed_rpm * screw.circle_m,
            axis.balls_m_rpm(candidate),
            "m rpm",
            remedy_ball_speed(axis, candidate, screw),
        ),
        LimitCheck("buckling", need.peak_force_n, load_n, "N", remedy_buckling(axis, screw)),
    ]


def _check_nut(axis: AxisSpec, candidate: CatalogueEntry) -> list[LimitCheck]:
    """Check dynamic load, life and static load."""
    need, factor, hours = axis.demand, axis.utilisation.service_factor, axis.requirements.life_h
    rated, lead = candidate.dynamic_load_n, candidate.lead_m
    force = axis.equivalent_load_n(candidate)
    load = life = None
    if hours is not None:
        load = dynamic_load_n(hours, force, need.mean_speed_m_s, lead, factor)
    if rated is not None:
        life = life_h(rated, force, need.mean_speed_m_s, lead, factor)
    pressed = ball_load_n(np.array([need.peak_force_n]), axis.preload_n(candidate))[0]
    static = factor * float(pressed)
    missing = remedy_missing_rating(axis, candidate)
    remedy = remedy_fatigue_life(axis, candidate)
    return [
        LimitCheck("dynamic load", load, rated, "N", remedy, missing=missing),
        LimitCheck("life", life, hours, "h", remedy, at_least=True, missing=missing),
        LimitCheck("static load", static, candidate.static_load_n, "N", "a stronger nut"),
    ]


def _check_unit(axis: AxisSpec, candidate: CatalogueEntry) -> list[LimitCheck]:
    """Check speed and stroke of a linear unit."""
    need, limit = axis.demand, candidate.speed_m_s
    remedy = remedy_speed(axis.cycle, limit) if limit else ""
    return [
        LimitCheck(UNIT_SPEED, need.peak_speed_m_s, limit, "m/s", remedy),
        LimitCheck("stroke of the unit", need.travel_m, candidate.stroke_m, "m", "a longer unit"),
    ]


def _check_accuracy(
    axis: AxisSpec, candidate: CatalogueEntry, screw: BallScrew
) -> list[LimitCheck]:
    """Check the lead class, the deviation over the travel, and the lead for accuracy."""
    required = axis.requirements
    lead_m = None
    if required.position_error_m is not None and required.angle_error_rad is not None:
        lead_m = greatest_lead_by_accuracy_m(required.position_error_m, required.angle_error_rad)
    remedy = remedy_lead_accuracy(screw, lead_m) if lead_m else ""
    return [
        _check_lead_class(candidate.lead_class, required.lead_class),
        _check_deviation(candidate.lead_class, axis.demand.travel_m, required.travel_deviation_m),
        LimitCheck("lead for accuracy", candidate.lead_m, lead_m, "m", remedy),
    ]


def _check_lead_class(name: str | None, required: str | None) -> LimitCheck:
    """Check the lead class of an entry by its deviation over 300 mm."""
    missing = note = ""
    if name is None and required is not None:
        missing = f"no lead class in the catalogue; ask the maker for {required} or a finer one"
    if name is not None and name not in TABULATED:
        classes = ", ".join(TABULATED)
        note = f"{name} is outside the classes that source 004 tabulates, {classes}"
    return LimitCheck(
        "lead class",
        _deviation_um(name),
        _deviation_um(required),
        "µm per 300 mm",
        f"{name} is coarser than {required}: take a finer screw, or set lead_class to what the "
        "work allows",
        missing=missing,
        note=note,
        discrete=True,
    )


def _deviation_um(lead_class: str | None) -> float | None:
    if lead_class is None:
        return None
    return LEAD_CLASSES[lead_class].per_300_mm_m * 1e6


def _check_deviation(
    lead_class: str | None, travel_m: float, required_m: float | None
) -> LimitCheck:
    """Check the deviation of the lead over the travel."""
    deviation_m = None if lead_class is None else travel_deviation_m(lead_class, travel_m)
    missing = ""
    if required_m is not None and deviation_m is None:
        missing = (
            "no lead class in the catalogue; ask the maker"
            if lead_class is None
            else f"source 004 tabulates no deviation of {lead_class} over {travel_m:g} m; "
            "ask the maker"
        )
    return LimitCheck(
        "lead over the travel",
        None if deviation_m is None else deviation_m * 1e6,
        None if required_m is None else required_m * 1e6,
        "µm",
        "a finer class",
        missing=missing,
    )


def _check_stiffness(axis: AxisSpec, screw: BallScrew) -> list[LimitCheck]:
    """Check sag, stiffness and bandwidth."""
    required = axis.requirements
    stiffness, bandwidth, sag = required.stiffness_n_m, required.bandwidth_rad_s, required.sag_m
    own_stiffness = axis.stiffness_n_m(screw)
    antiresonance = screw.antiresonance_rad_s(axis.load.mass_kg, own_stiffness)
    own_bandwidth = axis.utilisation.bandwidth * antiresonance
    own_sag = screw.sag_m(axis.load.slope_rad, axis.carried_kg)
    sag_remedy = stiffness_remedy = bandwidth_remedy = ""
    if sag is not None:
        sag_remedy = remedy_sag(axis, screw, sag)
    if stiffness is not None:
        stiffness_remedy = remedy_low_stiffness(axis, screw, stiffness)
    if bandwidth is not None:
        bandwidth_remedy = remedy_low_bandwidth(axis, screw, bandwidth)
    return [
        LimitCheck("sag", own_sag, sag, "m", sag_remedy),
        LimitCheck("stiffness", own_stiffness, stiffness, "N/m", stiffness_remedy, at_least=True),
        LimitCheck("bandwidth", own_bandwidth, bandwidth, "rad/s", bandwidth_remedy, at_least=True),
    ]


def _check_motor(
    axis: AxisSpec, candidate: CatalogueEntry, screw: BallScrew, need: ShaftDemand
) -> list[LimitCheck]:
    """Check peak torque, rms torque, speed and power of the motor; no bounds without a motor."""
    motor, drive = axis.motor, axis.transmission_for(candidate)
    speed_rpm = need.peak_speed_rad_s * RPM_PER_RAD_S
    peak = continuous = max_rpm = max_power = None
    peak_remedy = rms_remedy = speed_remedy = ""
    if motor:
        peak, continuous = motor.peak_torque_n_m, motor.continuous_torque_n_m
        max_rpm = motor.max_speed_rad_s * RPM_PER_RAD_S
        if motor.peak_power_w != math.inf:
            max_power = motor.peak_power_w
        peak_remedy = remedy_peak_torque(axis, drive, screw, peak)
        rms_remedy = remedy_rms_torque(axis, drive, screw, need.rms_torque_n_m, continuous)
        speed_remedy = remedy_speed(axis.cycle, motor.max_speed_rad_s * screw.ratio_m_rad)
    return [
        LimitCheck("motor torque, peak", need.peak_torque_n_m, peak, "N m", peak_remedy),
        LimitCheck("motor torque, rms", need.rms_torque_n_m, continuous, "N m", rms_remedy),
        LimitCheck(MOTOR_SPEED, speed_rpm, max_rpm, "rpm", speed_remedy),
        LimitCheck("motor power", need.peak_power_w, max_power, "W", "more time for the moves"),
    ]


class AllowedSpeed(NamedTuple):
    """Greatest speed of the nut, and the check that sets it."""

    speed_m_s: float
    check: str


def allowed_speed(axis: AxisSpec, found: Assessment) -> AllowedSpeed:
    """Compute the greatest speed that whirling, balls, unit and motor allow at the screw's lead."""
    speed = axis.demand.peak_speed_m_s
    return min(
        AllowedSpeed(speed * check.bound / check.value, check.name)
        for check in found.checks
        if check.name in SPEED_CHECKS and check.value and check.bound
    )
