"""Whether a screw does for an axis: every check with its value, its bound and what is left (source 004, appendix C)."""

from __future__ import annotations

import math
from typing import NamedTuple

from planners.drives.ball_screw import BallScrew
from planners.drives.lead_classes import LEAD_CLASSES, TABULATED, travel_deviation_m
from planners.drives.screw_axis import Axis, Candidate
from planners.drives.screw_cycle import Cycle
from planners.drives.screw_demand import ShaftDemand, shaft_demand
from planners.drives.screw_life import dynamic_load_n, life_h
from planners.drives.screw_limits import (
    RPM,
    greatest_lead_by_accuracy_m,
    least_diameter_by_buckling_m,
    least_lead_by_balls_m,
    least_lead_by_whirl_m,
)
from planners.drives.screw_verdict import Assessment, Check

WHIRL, BALLS, UNIT, MOTOR = "whirling", "ball speed d n", "speed of the unit", "motor speed"  # all in proportion to the speed


def assess(axis: Axis, candidate: Candidate) -> Assessment:
    """Every check of a candidate on an axis. Buckling takes the largest force for a push, whichever way it acts."""
    screw = candidate.screw(axis.mounting)
    shaft = shaft_demand(axis.cycle, axis.load, axis.transmission, screw)
    checks = (
        *_shaft(axis, screw),
        *_nut(axis, candidate),
        *_accuracy(axis, candidate),
        *_stiffness(axis, screw),
        *_motor(axis, screw, shaft),
    )
    return Assessment(candidate, screw, shaft, checks)


def _shaft(axis: Axis, screw: BallScrew) -> list[Check]:
    """Whirling, balls, buckling."""
    need, shares, d = axis.demand, axis.shares, screw.diameter_m
    turns_rpm = need.peak_speed_m_s / screw.ratio_m_rad * RPM
    by_whirl = least_lead_by_whirl_m(screw, need.peak_speed_m_s, shares.whirl)
    by_balls = least_lead_by_balls_m(d, need.peak_speed_m_s, axis.balls_m_rpm)
    thick = least_diameter_by_buckling_m(axis.mounting, need.peak_force_n, shares.buckling)
    return [
        Check(
            WHIRL,
            turns_rpm,
            shares.whirl * screw.whirl_rad_s * RPM,
            "rpm",
            f"a lead of {by_whirl:.6g} m at this diameter, a thicker screw or stiffer supports",
        ),
        Check(
            BALLS,
            turns_rpm * d,
            axis.balls_m_rpm,
            "m rpm",
            f"a lead of {by_balls:.6g} m at this diameter, a thinner screw or ceramic balls",
        ),
        Check(
            "buckling",
            need.peak_force_n,
            shares.buckling * screw.buckling_load_n,
            "N",
            f"a diameter of {thick:.4g} m or stiffer supports",
        ),
    ]


def _nut(axis: Axis, candidate: Candidate) -> list[Check]:
    """Loads, life, and the unit's own limits."""
    need, factor, hours = axis.demand, axis.shares.service_factor, axis.wishes.life_h
    rated, lead = candidate.dynamic_load_n, candidate.lead_m
    unrated = "" if rated is not None or hours is None else "no dynamic load in the catalogue; ask the maker"
    load = None if hours is None else dynamic_load_n(hours, need.equivalent_force_n, need.mean_speed_m_s, lead, factor)
    life = None if rated is None else life_h(rated, need.equivalent_force_n, need.mean_speed_m_s, lead, factor)
    still = "" if candidate.static_load_n is not None else "no static load in the catalogue; ask the maker"
    limit = candidate.speed_m_s
    return [
        Check("dynamic load", load, rated, "N", "a greater lead, a stronger nut or fewer hours", missing=unrated),
        Check("life", life, hours, "h", "a stronger nut, a greater lead or fewer hours", at_least=True, missing=unrated),
        Check("static load", factor * need.peak_force_n, candidate.static_load_n, "N", "a stronger nut", missing=still),
        Check(UNIT, need.peak_speed_m_s, limit, "m/s", slower(axis.cycle, limit) if limit else ""),
        Check("stroke of the unit", need.travel_m, candidate.stroke_m, "m", "a longer unit"),
    ]


def _accuracy(axis: Axis, candidate: Candidate) -> list[Check]:
    """Lead class, deviation over the travel, lead that is too great."""
    wishes, name, travel = axis.wishes, candidate.lead_class, axis.demand.travel_m
    silent = "" if name is not None else "no lead class in the catalogue; ask the maker"
    coarse = (
        f"{name} is coarser than {wishes.lead_class} (travel deviations are tabulated for {', '.join(TABULATED)}): take a "
        "finer screw, or set lead_class to what the work allows"
    )
    deviation = None if name is None else travel_deviation_m(name, travel)
    off_table = f"no deviation of {name} over {travel:g} m in the table; ask the maker"
    wanted = wishes.travel_deviation_m
    lead = (
        None
        if wishes.position_error_m is None or wishes.angle_error_rad is None
        else greatest_lead_by_accuracy_m(wishes.position_error_m, wishes.angle_error_rad)
    )
    return [
        Check(
            "lead class",
            None if name is None else LEAD_CLASSES[name].per_300_mm_m * 1e6,
            LEAD_CLASSES[wishes.lead_class].per_300_mm_m * 1e6,
            "µm",
            coarse,
            missing=silent,
        ),
        Check(
            "lead over the travel",
            None if deviation is None else deviation * 1e6,
            None if wanted is None else wanted * 1e6,
            "µm",
            "a finer class",
            missing="" if wanted is None or deviation is not None else silent or off_table,
        ),
        Check("lead for accuracy", candidate.lead_m, lead, "m", "a smaller lead or a finer encoder"),
    ]


def _stiffness(axis: Axis, screw: BallScrew) -> list[Check]:
    """Sag, stiffness, bandwidth."""
    wishes, stiffness = axis.wishes, axis.stiffness_n_m(screw)
    reach = axis.shares.bandwidth * screw.antiresonance_rad_s(axis.load.mass_kg, stiffness)
    thicker = "a thicker screw, a smaller lead or a shorter one"
    return [
        Check("sag", screw.sag_m(axis.load.slope_rad, axis.carried_kg), wishes.sag_m, "m", "a thicker or a shorter screw"),
        Check("stiffness", stiffness, wishes.stiffness_n_m, "N/m", thicker, at_least=True),
        Check("bandwidth", reach, wishes.bandwidth_rad_s, "rad/s", thicker, at_least=True),
    ]


def _motor(axis: Axis, screw: BallScrew, need: ShaftDemand) -> list[Check]:
    """Torque, heat, speed and power; without a motor they are told, not judged."""
    motor = axis.motor
    peak, steady, top, power = (
        (motor.peak_torque_n_m, motor.continuous_torque_n_m, motor.max_speed_rad_s, motor.peak_power_w)
        if motor
        else (None, None, None, None)
    )
    return [
        Check("motor torque, peak", need.peak_torque_n_m, peak, "N m", "more time for the moves"),
        Check("motor torque, rms", need.rms_torque_n_m, steady, "N m", "longer rests or more time"),
        Check(
            MOTOR,
            need.peak_speed_rad_s * RPM,
            None if top is None else top * RPM,
            "rpm",
            "" if top is None else slower(axis.cycle, top * screw.ratio_m_rad),
        ),
        Check("motor power", need.peak_power_w, None if power == math.inf else power, "W", "more time for the moves"),
    ]


class AllowedSpeed(NamedTuple):
    """The greatest speed of the nut, and the check that sets it."""

    speed_m_s: float
    check: str


def allowed_speed(axis: Axis, found: Assessment) -> AllowedSpeed:
    """What whirling, balls, unit and motor let the nut do; at its own lead, whatever the cycle asks."""
    speed = axis.demand.peak_speed_m_s
    return min(
        AllowedSpeed(speed * check.bound / check.value, check.name)
        for check in found.checks
        if check.name in (WHIRL, BALLS, UNIT, MOTOR) and check.value and check.bound
    )


def slower(cycle: Cycle, speed_m_s: float) -> str:
    """Which moves are too fast for a speed, and the time in which each keeps it."""
    return "; ".join(
        f"move {number} reaches {move.peak_speed_m_s:.4g} m/s in {move.time_s:g} s and needs {move.time_at(speed_m_s):.4g} s"
        for number, move in enumerate(cycle.moves, start=1)
        if move.peak_speed_m_s > speed_m_s
    )
