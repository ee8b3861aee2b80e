"""What is worth a line below the tables of a sizing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from rig.drives.screw import digits
from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.balls import BALLS_M_RPM
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.checks import allowed_speed
from rig.drives.screw.limits import RPM
from rig.drives.screw.remedies import slower
from rig.drives.screw.verdict import Assessment

CORE = 0.9  # of the nominal diameter: about what is left below a thread


class Note(NamedTuple):
    """A line; a dim one is an aside."""

    text: str
    dim: bool = False


def notes(axis: AxisSpec, judged: Assessment, figures: dict[str, float]) -> Iterator[Note]:
    """Of a screw with its figures."""
    f = {name: digits.number(value) for name, value in figures.items()}
    whirl, balls = digits.mm(figures["lead_min_whirl_m"]), digits.mm(figures["lead_min_balls_m"])
    yield Note(f"least lead at this diameter: {whirl} by whirling, {balls} by the balls")
    yield from _aside(axis, judged.candidate, figures)
    yield from map(Note, judged.notes)
    yield Note(
        f"antiresonance {f['antiresonance_rad_s']} rad/s, resonance {f['resonance_rad_s']} rad/s: a bandwidth of "
        f"{f['bandwidth_low_rad_s']} to {f['bandwidth_high_rad_s']} rad/s"
    )
    yield Note(
        f"motor: drives with at most {f['driving_power_w']} W, on average {f['mean_driving_power_w']} W; brakes with at most "
        f"{f['braking_power_w']} W, on average {f['mean_braking_power_w']} W"
    )
    yield from _preload(axis, judged.candidate, f)
    speed, by = allowed_speed(axis, judged)
    late = slower(axis.cycle, speed)
    yield Note(f"allowed speed: {digits.number(speed)} m/s by {by}{f'; {late}' if late else ''}")


def _preload(axis: AxisSpec, nut: CatalogueEntry, f: dict[str, str]) -> Iterator[Note]:
    """What it costs, or what the usual one would."""
    if axis.preload_n(nut):
        yield Note(
            f"preload {f['preload_n']} N: an equivalent load of {f['equivalent_load_n']} N in place of "
            f"{f['equivalent_force_n']} N; drag {f['drag_torque_n_m']} N m"
            + ("" if axis.transmission.drag_torque_n_m is None else ", as given")
        )
    elif nut.dynamic_load_n is not None:
        hours = axis.wishes.life_h
        asked = "" if hours is None else f" of the {digits.number(hours)} h asked for"
        yield Note(
            f"preload: none; 5 to 10 % of the dynamic load, {f['preload_low_n']} to {f['preload_high_n']} N, leave a life of "
            f"{f['life_at_preload_low_h']} to {f['life_at_preload_high_h']} h{asked}"
        )


def _aside(axis: AxisSpec, nut: CatalogueEntry, figures: dict[str, float]) -> Iterator[Note]:
    """What is taken for granted."""
    if nut.core_diameter_m is None:
        thin = replace(nut, core_diameter_m=CORE * nut.diameter_m)
        rpm, needed_rpm = (
            axis.shares.whirl * thin.screw(axis.mounting).whirl_rad_s * RPM,
            figures["peak_speed_rpm"],
        )
        short = rpm < needed_rpm <= figures["critical_speed_rpm"]
        yield Note(
            f"the core is taken to be as thick as the screw: one of {CORE:g} d, {digits.mm(thin.core_m)}, has a critical speed "
            f"of {digits.number(rpm)} in place of {digits.number(figures['critical_speed_rpm'])} rpm"
            + (
                f", too low for {digits.number(needed_rpm)} rpm: give core_diameter_m"
                if short
                else ""
            ),
            dim=not short,
        )
    if nut.limit_m_rpm is None and not axis.balls.usual:
        values = (axis.balls.allowed_m_rpm, *BALLS_M_RPM[axis.balls.material])
        (given, low, high), unit = digits.shown(values, "m rpm")
        yield Note(
            f"d n of {given} {unit} is not the {low} to {high} of {axis.balls.material} balls",
            dim=True,
        )
