"""Next steps for the broken checks of a screw.

A number in a step is rounded so that the check is kept with it. A step that cannot help is left
out.
"""

from __future__ import annotations

from collections.abc import Callable

from rig.drives.screw import digits
from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.balls import BALLS_M_RPM
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.cycle import Cycle
from rig.drives.screw.life import least_lead_by_life_m, life_h
from rig.drives.screw.life_design import greatest_preload_n, required_dynamic_load_n
from rig.drives.screw.limits import (
    RPM_PER_RAD_S,
    greatest_lead_by_stiffness_m,
    least_diameter_by_buckling_m,
    least_diameter_by_sag_m,
    least_diameter_by_stiffness_m,
    least_lead_by_balls_m,
    least_lead_by_whirl_m,
    stiffness_for_bandwidth_n_m,
)
from rig.drives.screw.shaft import BallScrew, Thread
from rig.drives.screw.transmission import Transmission

LEAD_RATIOS = (0.05, 2.0)  # lead over diameter of screws that are made (general knowledge)


def remedy_whirling(axis: AxisSpec, screw: BallScrew) -> str:
    """Describe the lead, diameter, supports or speed that keep the critical speed."""
    lead = least_lead_by_whirl_m(screw, axis.demand.peak_speed_m_s, axis.utilisation.whirl)
    return _join_steps(
        _lead_step(screw, lead, digits.rounded_up),
        "a thicker screw",
        _support_step(axis),
        "slower moves",
    )


def remedy_ball_speed(axis: AxisSpec, candidate: CatalogueEntry, screw: BallScrew) -> str:
    """Describe the lead, diameter, speed or balls that keep d n."""
    speed, limit = axis.demand.peak_speed_m_s, axis.balls_m_rpm(candidate)
    lead = least_lead_by_balls_m(screw.circle_m, speed, limit)
    ceramic_m_rpm = axis.utilisation.balls * BALLS_M_RPM["ceramic"][0]
    required_m_rpm = speed / screw.ratio_m_rad * RPM_PER_RAD_S * screw.circle_m
    ceramic_helps = axis.balls.material != "ceramic" and required_m_rpm <= ceramic_m_rpm
    return _join_steps(
        _lead_step(screw, lead, digits.rounded_up),
        "a thinner screw",
        "ceramic balls" if ceramic_helps else "",
        "slower moves",
    )


def remedy_buckling(axis: AxisSpec, screw: BallScrew) -> str:
    """Describe the diameter or supports that carry the force."""
    diameter_m = least_diameter_by_buckling_m(
        axis.mounting, axis.demand.peak_force_n, axis.utilisation.buckling
    )
    return _join_steps(_diameter_step(screw, diameter_m), _support_step(axis))


def remedy_fatigue_life(axis: AxisSpec, candidate: CatalogueEntry) -> str:
    """Describe the lead, preload or nut that reaches the life.

    Empty if the life is reached or not required, or the rating is missing.
    """
    hours, rated = axis.requirements.life_h, candidate.dynamic_load_n
    if hours is None or rated is None:
        return ""
    force, speed = axis.equivalent_load_n(candidate), axis.demand.mean_speed_m_s
    factor = axis.utilisation.service_factor
    if life_h(rated, force, speed, candidate.lead_m, factor) >= hours:
        return ""
    lead_m = least_lead_by_life_m(hours, rated, force, speed, factor)
    preload = greatest_preload_n(axis, candidate, hours)
    load = required_dynamic_load_n(axis, candidate, hours)
    return _join_steps(
        _lead_step(candidate, lead_m, digits.rounded_up),
        "" if preload is None else f"less preload ({digits.rounded_down(preload)} N at most)",
        "" if load is None else f"a dynamic load of {digits.rounded_up(load)} N",
        "a shorter required life",
    )


def remedy_missing_rating(axis: AxisSpec, candidate: CatalogueEntry) -> str:
    """Describe the dynamic load rating to ask the maker for.

    Empty if the catalogue has the rating, or no life is required.
    """
    hours = axis.requirements.life_h
    if hours is None or candidate.dynamic_load_n is not None:
        return ""
    load = required_dynamic_load_n(axis, candidate, hours)
    enough = "" if load is None else f" for {digits.rounded_up(load)} N or more"
    return f"no dynamic load in the catalogue; ask the maker{enough}"


def remedy_lead_accuracy(screw: BallScrew, greatest_lead_m: float) -> str:
    """Describe the lead or encoder that keeps the position error."""
    return _join_steps(_lead_step(screw, greatest_lead_m, digits.rounded_down), "a finer encoder")


def remedy_sag(axis: AxisSpec, screw: BallScrew, sag_m: float) -> str:
    """Describe the diameter or length that keeps the sag."""
    diameter_m = least_diameter_by_sag_m(axis.mounting, sag_m, axis.load.slope_rad, axis.carried_kg)
    return _join_steps(_diameter_step(screw, diameter_m), "a shorter screw")


def remedy_low_stiffness(axis: AxisSpec, screw: BallScrew, required_n_m: float) -> str:
    """Describe the bearing and nut if they are too soft by themselves, else lead and diameter."""
    support_n_m = axis.support_stiffness_n_m
    if support_n_m <= required_n_m:
        return _soft_supports(axis, required_n_m)
    diameter_m = least_diameter_by_stiffness_m(screw, required_n_m, support_n_m)
    lead_m = greatest_lead_by_stiffness_m(screw, required_n_m, support_n_m)
    return _join_steps(
        _diameter_step(screw, diameter_m),
        _lead_step(screw, lead_m, digits.rounded_down),
        "a shorter screw",
    )


def remedy_low_bandwidth(axis: AxisSpec, screw: BallScrew, bandwidth_rad_s: float) -> str:
    """Describe the bearing and nut if they are too soft by themselves, else lead and length.

    No diameter is named: a thicker screw is stiffer, but heavier too.
    """
    mass, share = axis.load.mass_kg, axis.utilisation.bandwidth
    least_n_m = mass * (bandwidth_rad_s / share) ** 2
    if axis.support_stiffness_n_m <= least_n_m:
        return _soft_supports(axis, least_n_m)
    required_n_m = stiffness_for_bandwidth_n_m(screw, mass, bandwidth_rad_s, share)
    lead_m = greatest_lead_by_stiffness_m(screw, required_n_m, axis.support_stiffness_n_m)
    return _join_steps(_lead_step(screw, lead_m, digits.rounded_down), "a shorter screw")


def remedy_peak_torque(
    axis: AxisSpec, drive: Transmission, screw: BallScrew, peak_n_m: float
) -> str:
    """Describe the step for a peak torque: more time, unless constant speed takes too much."""
    steady = max(drive.steady_torque_n_m(screw, axis.load, direction) for direction in (1.0, -1.0))
    if steady < peak_n_m:
        return "more time for the moves"
    return (
        f"constant speed alone takes {steady:.4g} N m: a stronger motor, a lighter or a "
        "counterweighted load, or a smaller lead"
    )


def remedy_rms_torque(
    axis: AxisSpec, drive: Transmission, screw: BallScrew, rms_n_m: float, continuous_n_m: float
) -> str:
    """Describe the step for an rms torque: longer rests, unless holding the load takes too much."""
    hold = drive.steady_torque_n_m(screw, axis.load, 0.0)
    if hold >= continuous_n_m:
        return (
            f"holding alone takes {hold:.4g} N m: a stronger motor, a brake, a counterweight, or a "
            "smaller lead"
        )
    rest_s = (
        axis.cycle.duration_s * (rms_n_m**2 - continuous_n_m**2) / (continuous_n_m**2 - hold**2)
    )
    return f"{digits.rounded_up(max(0.0, rest_s))} s more rest per cycle"


def remedy_speed(cycle: Cycle, speed_m_s: float) -> str:
    """Describe the moves above a speed, with the time in which each keeps it.

    Equal moves are described once.
    """
    steps = []
    for move, times in cycle.counts.items():
        if move.peak_speed_m_s > speed_m_s:
            number = cycle.moves.index(move) + 1
            others = f" and {times - 1} like it" if times > 1 else ""
            time_s = digits.rounded_up(move.time_at(speed_m_s))
            steps.append(
                f"move {number}{others} reaches {move.peak_speed_m_s:.4g} m/s in "
                f"{move.time_s:g} s and needs {time_s} s"
            )
    return "; ".join(steps)


def _join_steps(*steps: str) -> str:
    """Join the steps that are not empty, the last one with "or"."""
    *others, last = filter(None, steps)
    return f"{', '.join(others)} or {last}" if others else last


def _support_step(axis: AxisSpec) -> str:
    return "" if axis.mounting.support.stiffest else "stiffer supports"


def _lead_step(screw: Thread, lead_m: float, rounded: Callable[[float], str]) -> str:
    """Name a lead; empty if no screw of the diameter is made with it."""
    least, most = (ratio * screw.diameter_m for ratio in LEAD_RATIOS)
    return f"a lead of {rounded(1e3 * lead_m)} mm" if least <= lead_m <= most else ""


def _diameter_step(screw: BallScrew, diameter_m: float) -> str:
    part = "diameter" if screw.core_diameter_m is None else "core"
    return f"a {part} of {digits.rounded_up(1e3 * diameter_m)} mm"


def _soft_supports(axis: AxisSpec, required_n_m: float) -> str:
    values = (axis.support_stiffness_n_m, required_n_m)
    (support, required), unit = digits.shown(values, "N/m")
    return (
        f"bearing and nut alone give {support} {unit} where {required} {unit} are needed, whatever "
        "the screw: take stiffer ones"
    )
