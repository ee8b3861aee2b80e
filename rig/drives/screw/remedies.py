"""The next step where a check of a screw fails: one that helps; its numbers are rounded so that the check is kept."""

from __future__ import annotations

from collections.abc import Callable

from rig.drives.screw import digits
from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.balls import BALLS_M_RPM
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.cycle import Cycle
from rig.drives.screw.life import least_lead_by_life_m, life_h
from rig.drives.screw.limits import (
    RPM,
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
from rig.drives.screw.wear import lasting_load_n, lasting_preload_n

LEADS = (0.05, 2.0)  # of the diameter, that screws are made with (general knowledge)


def against_whirl(axis: AxisSpec, screw: BallScrew) -> str:
    """Lead, diameter, supports or time."""
    lead = least_lead_by_whirl_m(screw, axis.demand.peak_speed_m_s, axis.shares.whirl)
    return _either(
        _lead(screw, lead, digits.least), "a thicker screw", _supports(axis), "slower moves"
    )


def against_balls(axis: AxisSpec, candidate: CatalogueEntry, screw: BallScrew) -> str:
    """Lead, diameter, time, or other balls where those do."""
    speed, limit = axis.demand.peak_speed_m_s, axis.balls_m_rpm(candidate)
    lead = least_lead_by_balls_m(screw.circle_m, speed, limit)
    faster = axis.shares.balls * BALLS_M_RPM["ceramic"][0]
    helps = (
        axis.balls.material != "ceramic"
        and speed / screw.ratio_m_rad * RPM * screw.circle_m <= faster
    )
    return _either(
        _lead(screw, lead, digits.least),
        "a thinner screw",
        "ceramic balls" if helps else "",
        "slower moves",
    )


def against_buckling(axis: AxisSpec, screw: BallScrew) -> str:
    """Diameter or supports."""
    thick = least_diameter_by_buckling_m(
        axis.mounting, axis.demand.peak_force_n, axis.shares.buckling
    )
    return _either(_diameter(screw, thick), _supports(axis))


def against_wear(axis: AxisSpec, candidate: CatalogueEntry) -> str:
    """Lead, preload, nut or hours; empty where nothing is broken or there is nothing to compare."""
    hours, rated, need, factor = (
        axis.wishes.life_h,
        candidate.dynamic_load_n,
        axis.demand,
        axis.shares.service_factor,
    )
    if hours is None or rated is None:
        return ""
    force, speed = axis.equivalent_load_n(candidate), need.mean_speed_m_s
    if life_h(rated, force, speed, candidate.lead_m, factor) >= hours:
        return ""
    preload, load = (
        lasting_preload_n(axis, candidate, hours),
        lasting_load_n(axis, candidate, hours),
    )
    return _either(
        _lead(candidate, least_lead_by_life_m(hours, rated, force, speed, factor), digits.least),
        "" if preload is None else f"less preload ({digits.greatest(preload)} N at most)",
        "" if load is None else f"a dynamic load of {digits.least(load)} N",
        "fewer hours",
    )


def for_want_of_a_rating(axis: AxisSpec, candidate: CatalogueEntry) -> str:
    """What to ask of a nut whose dynamic load is not told; empty where it is, or where no life is asked."""
    hours = axis.wishes.life_h
    if hours is None or candidate.dynamic_load_n is not None:
        return ""
    load = lasting_load_n(axis, candidate, hours)
    enough = "" if load is None else f" for {digits.least(load)} N or more"
    return f"no dynamic load in the catalogue; ask the maker{enough}"


def against_inaccuracy(screw: BallScrew, greatest_lead_m: float) -> str:
    """Lead or encoder."""
    return _either(_lead(screw, greatest_lead_m, digits.greatest), "a finer encoder")


def against_sag(axis: AxisSpec, screw: BallScrew, sag_m: float) -> str:
    """Diameter or length."""
    thick = least_diameter_by_sag_m(axis.mounting, sag_m, axis.load.slope_rad, axis.carried_kg)
    return _either(_diameter(screw, thick), "a shorter screw")


def against_softness(axis: AxisSpec, screw: BallScrew, needed_n_m: float) -> str:
    """Bearing and nut where they are too soft by themselves, else lead and diameter."""
    if axis.support_stiffness_n_m <= needed_n_m:
        return _too_soft(axis, needed_n_m)
    thick = least_diameter_by_stiffness_m(screw, needed_n_m, axis.support_stiffness_n_m)
    lead = greatest_lead_by_stiffness_m(screw, needed_n_m, axis.support_stiffness_n_m)
    return _either(_diameter(screw, thick), _lead(screw, lead, digits.greatest), "a shorter screw")


def against_slowness(axis: AxisSpec, screw: BallScrew, bandwidth_rad_s: float) -> str:
    """The same for a bandwidth; a thicker screw is stiffer but heavier, too."""
    mass, share = axis.load.mass_kg, axis.shares.bandwidth
    least = mass * (bandwidth_rad_s / share) ** 2
    if axis.support_stiffness_n_m <= least:
        return _too_soft(axis, least)
    needed = stiffness_for_bandwidth_n_m(screw, mass, bandwidth_rad_s, share)
    lead = greatest_lead_by_stiffness_m(screw, needed, axis.support_stiffness_n_m)
    return _either(_lead(screw, lead, digits.greatest), "a shorter screw")


def against_torque(axis: AxisSpec, drive: Transmission, screw: BallScrew, peak_n_m: float) -> str:
    """More time, unless moving without any haste takes too much."""
    steady = max(drive.steady_torque_n_m(screw, axis.load, direction) for direction in (1.0, -1.0))
    if steady < peak_n_m:
        return "more time for the moves"
    return f"even speed alone takes {steady:.4g} N m: a stronger motor, a lighter or a counterweighted load, or a smaller lead"


def against_heat(
    axis: AxisSpec, drive: Transmission, screw: BallScrew, rms_n_m: float, continuous_n_m: float
) -> str:
    """Longer rests, unless holding the load in them takes too much."""
    hold = drive.steady_torque_n_m(screw, axis.load, 0.0)
    if hold >= continuous_n_m:
        return f"holding alone takes {hold:.4g} N m: a stronger motor, a brake, a counterweight, or a smaller lead"
    rest_s = (
        axis.cycle.duration_s * (rms_n_m**2 - continuous_n_m**2) / (continuous_n_m**2 - hold**2)
    )
    return f"{digits.least(max(0.0, rest_s))} s more of rest in a cycle"


def slower(cycle: Cycle, speed_m_s: float) -> str:
    """Which moves are too fast for a speed, and the time in which each keeps it; equal moves are named once."""
    return "; ".join(
        f"move {cycle.moves.index(move) + 1}{f' and {times - 1} like it' if times > 1 else ''} "
        f"reaches {move.peak_speed_m_s:.4g} m/s in {move.time_s:g} s and needs {digits.least(move.time_at(speed_m_s))} s"
        for move, times in cycle.counts.items()
        if move.peak_speed_m_s > speed_m_s
    )


def _either(*steps: str) -> str:
    """Those that are any, the last one after "or"."""
    *others, last = filter(None, steps)
    return f"{', '.join(others)} or {last}" if others else last


def _supports(axis: AxisSpec) -> str:
    return "" if axis.mounting.support.stiffest else "stiffer supports"


def _lead(screw: Thread, lead_m: float, rounded: Callable[[float], str]) -> str:
    """Empty where no screw of the diameter has it."""
    least, most = (share * screw.diameter_m for share in LEADS)
    return f"a lead of {rounded(1e3 * lead_m)} mm" if least <= lead_m <= most else ""


def _diameter(screw: BallScrew, diameter_m: float) -> str:
    return f"a {'diameter' if screw.core_diameter_m is None else 'core'} of {digits.least(1e3 * diameter_m)} mm"


def _too_soft(axis: AxisSpec, needed_n_m: float) -> str:
    (held, needed), unit = digits.shown((axis.support_stiffness_n_m, needed_n_m), "N/m")
    return f"bearing and nut alone give {held} {unit} where {needed} {unit} are needed, whatever the screw: take stiffer ones"
