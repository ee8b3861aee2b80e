"""The next step where a check of a screw fails: one that helps; its numbers are rounded so that the check is kept."""

from __future__ import annotations

from planners.drives.ball_screw import SMALLEST_M, BallScrew
from planners.drives.screw import digits
from planners.drives.screw.axis import Axis
from planners.drives.screw.balls import BALLS_M_RPM
from planners.drives.screw.candidate import Candidate
from planners.drives.screw.cycle import Cycle
from planners.drives.screw.life import least_lead_by_life_m, life_h
from planners.drives.screw.limits import (
    RPM,
    greatest_lead_by_stiffness_m,
    least_diameter_by_buckling_m,
    least_diameter_by_sag_m,
    least_diameter_by_stiffness_m,
    least_lead_by_balls_m,
    least_lead_by_whirl_m,
    stiffness_for_bandwidth_n_m,
)
from planners.drives.screw.transmission import Transmission


def against_whirl(axis: Axis, screw: BallScrew) -> str:
    """Lead, diameter or supports."""
    lead = least_lead_by_whirl_m(screw, axis.demand.peak_speed_m_s, axis.shares.whirl)
    return f"a lead of {digits.least(lead)} m at this diameter{_or_supports(axis, ', a thicker screw', ' or a thicker screw')}"


def against_balls(axis: Axis, candidate: Candidate, screw: BallScrew) -> str:
    """Lead, diameter, or other balls where those do."""
    speed, limit = axis.demand.peak_speed_m_s, axis.balls_m_rpm(candidate)
    lead = least_lead_by_balls_m(screw.circle_m, speed, limit)
    faster = axis.shares.balls * BALLS_M_RPM["ceramic"][0]
    helps = axis.balls.material != "ceramic" and speed / screw.ratio_m_rad * RPM * screw.circle_m <= faster
    other = ", a thinner screw or ceramic balls" if helps else " or a thinner screw"
    return f"a lead of {digits.least(lead)} m at this diameter{other}"


def against_buckling(axis: Axis, screw: BallScrew) -> str:
    """Diameter or supports."""
    thick = least_diameter_by_buckling_m(axis.mounting, axis.demand.peak_force_n, axis.shares.buckling)
    return f"{_diameter(screw, thick)}{_or_supports(axis, '', '')}"


def against_wear(axis: Axis, candidate: Candidate) -> str:
    """Lead, hours, and what of preload and nut does; empty where there is nothing to compare."""
    hours, rated, need, factor = axis.wishes.life_h, candidate.dynamic_load_n, axis.demand, axis.shares.service_factor
    if hours is None or rated is None:
        return ""
    lead = least_lead_by_life_m(hours, rated, axis.equivalent_load_n(candidate), need.mean_speed_m_s, factor)
    loose_h = life_h(rated, need.equivalent_force_n, need.mean_speed_m_s, candidate.lead_m, factor)
    grows = candidate.preload_n is None and axis.shares.preload > 0.0  # a stronger nut is pressed harder
    steps = [
        f"a lead of {digits.least(lead)} m",
        *(["less preload"] if axis.preload_n(candidate) and loose_h >= hours else []),
        *([] if grows else ["a stronger nut"]),
    ]
    return f"{', '.join(steps)} or fewer hours"


def against_sag(axis: Axis, screw: BallScrew, sag_m: float) -> str:
    """Diameter or length."""
    thick = least_diameter_by_sag_m(axis.mounting, sag_m, axis.load.slope_rad, axis.carried_kg)
    return f"{_diameter(screw, thick)} or a shorter screw"


def against_softness(axis: Axis, screw: BallScrew, needed_n_m: float) -> str:
    """Bearing and nut where they are too soft by themselves, else lead and diameter."""
    if axis.held_n_m <= needed_n_m:
        return _too_soft(axis, needed_n_m)
    thick = least_diameter_by_stiffness_m(screw, needed_n_m, axis.held_n_m)
    return f"{_diameter(screw, thick)}{_smaller_lead(axis, screw, needed_n_m)} or a shorter screw"


def against_slowness(axis: Axis, screw: BallScrew, bandwidth_rad_s: float) -> str:
    """The same for a bandwidth; a thicker screw is stiffer but heavier, too."""
    mass, share = axis.load.mass_kg, axis.shares.bandwidth
    least = mass * (bandwidth_rad_s / share) ** 2
    if axis.held_n_m <= least:
        return _too_soft(axis, least)
    needed = stiffness_for_bandwidth_n_m(screw, mass, bandwidth_rad_s, share)
    return f"a shorter screw{_smaller_lead(axis, screw, needed)}"


def against_torque(axis: Axis, drive: Transmission, screw: BallScrew, peak_n_m: float) -> str:
    """More time, unless moving without any haste takes too much."""
    steady = max(drive.steady_torque_n_m(screw, axis.load, direction) for direction in (1.0, -1.0))
    if steady < peak_n_m:
        return "more time for the moves"
    return f"even speed alone takes {steady:.4g} N m: a stronger motor, a lighter or a counterweighted load, or a smaller lead"


def against_heat(axis: Axis, drive: Transmission, screw: BallScrew, rms_n_m: float, continuous_n_m: float) -> str:
    """Longer rests, unless holding the load in them takes too much."""
    hold = drive.steady_torque_n_m(screw, axis.load, 0.0)
    if hold >= continuous_n_m:
        return f"holding alone takes {hold:.4g} N m: a stronger motor, a brake, a counterweight, or a smaller lead"
    rest_s = axis.cycle.duration_s * (rms_n_m**2 - continuous_n_m**2) / (continuous_n_m**2 - hold**2)
    return f"{digits.least(max(0.0, rest_s))} s more of rest in a cycle"


def slower(cycle: Cycle, speed_m_s: float) -> str:
    """Which moves are too fast for a speed, and the time in which each keeps it; equal moves are named once."""
    return "; ".join(
        f"move {cycle.moves.index(move) + 1}{f' and {times - 1} like it' if times > 1 else ''} "
        f"reaches {move.peak_speed_m_s:.4g} m/s in {move.time_s:g} s and needs {digits.least(move.time_at(speed_m_s))} s"
        for move, times in cycle.counts.items()
        if move.peak_speed_m_s > speed_m_s
    )


def _or_supports(axis: Axis, others: str, last: str) -> str:
    return last if axis.mounting.support.stiffest else f"{others} or stiffer supports"


def _diameter(screw: BallScrew, diameter_m: float) -> str:
    return f"a {'diameter' if screw.core_diameter_m is None else 'core'} of {digits.least(diameter_m)} m"


def _too_soft(axis: Axis, needed_n_m: float) -> str:
    return (
        f"bearing and nut alone give {axis.held_n_m:.4g} N/m where {needed_n_m:.4g} N/m are needed, whatever the screw: "
        "take stiffer ones"
    )


def _smaller_lead(axis: Axis, screw: BallScrew, needed_n_m: float) -> str:
    """Empty where no lead does."""
    lead = greatest_lead_by_stiffness_m(screw, needed_n_m, axis.held_n_m)
    return f", a lead of {digits.greatest(lead)} m" if lead >= SMALLEST_M else ""
