"""Remarks below the tables of a sizing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from rig.drives.screw import digits
from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.balls import BALLS_M_RPM
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.checks import allowed_speed
from rig.drives.screw.limits import RPM_PER_RAD_S
from rig.drives.screw.remedies import remedy_speed
from rig.drives.screw.verdict import Assessment

CORE_RATIO = 0.9  # typical core diameter over nominal diameter


class Note(NamedTuple):
    """One remark; a dim one is secondary."""

    text: str
    dim: bool = False


def notes(axis: AxisSpec, judged: Assessment, figures: dict[str, float]) -> Iterator[Note]:
    """List the remarks on a sized screw; figures are those of the sizing, by name."""
    f = {name: digits.number(value) for name, value in figures.items()}
    whirl, balls = digits.mm(figures["lead_min_whirl_m"]), digits.mm(figures["lead_min_balls_m"])
    yield Note(f"least lead at this diameter: {whirl} by whirling, {balls} by the balls")
    yield from _core_notes(axis, judged.candidate, figures)
    yield from _ball_notes(axis, judged.candidate)
    yield from map(Note, judged.notes)
    yield Note(
        f"antiresonance {f['antiresonance_rad_s']} rad/s, resonance {f['resonance_rad_s']} rad/s: "
        f"a bandwidth of {f['bandwidth_low_rad_s']} to {f['bandwidth_high_rad_s']} rad/s"
    )
    yield Note(
        f"motor: drives with at most {f['driving_power_w']} W, on average "
        f"{f['mean_driving_power_w']} W; brakes with at most {f['braking_power_w']} W, on average "
        f"{f['mean_braking_power_w']} W"
    )
    yield from _preload_notes(axis, judged.candidate, f)
    speed, check = allowed_speed(axis, judged)
    too_fast = remedy_speed(axis.cycle, speed)
    moves = f"; {too_fast}" if too_fast else ""
    yield Note(f"allowed speed: {digits.number(speed)} m/s by {check}{moves}")


def _preload_notes(axis: AxisSpec, nut: CatalogueEntry, f: dict[str, str]) -> Iterator[Note]:
    """State the effect of the preload; without one, that of the usual preload on the life."""
    if axis.preload_n(nut):
        given = "" if axis.transmission.drag_torque_n_m is None else ", as given"
        yield Note(
            f"preload {f['preload_n']} N: an equivalent load of {f['equivalent_load_n']} N in "
            f"place of {f['equivalent_force_n']} N; drag {f['drag_torque_n_m']} N m{given}"
        )
    elif nut.dynamic_load_n is not None:
        hours = axis.requirements.life_h
        required = "" if hours is None else f"; required: {digits.number(hours)} h"
        yield Note(
            f"preload: none; 5 to 10 % of the dynamic load, {f['preload_low_n']} to "
            f"{f['preload_high_n']} N, leave a life of {f['life_at_preload_low_h']} to "
            f"{f['life_at_preload_high_h']} h{required}"
        )


def _core_notes(axis: AxisSpec, nut: CatalogueEntry, figures: dict[str, float]) -> Iterator[Note]:
    """State the critical speed of a typical core, if the core diameter is not given."""
    if nut.core_diameter_m is not None:
        return
    thin = replace(nut, core_diameter_m=CORE_RATIO * nut.diameter_m)
    whirl_rad_s = thin.screw(axis.mounting).whirl_rad_s
    rpm = axis.utilisation.whirl * whirl_rad_s * RPM_PER_RAD_S
    required_rpm = figures["peak_speed_rpm"]
    too_slow = rpm < required_rpm <= figures["critical_speed_rpm"]
    text = (
        f"the core is taken to be as thick as the screw: one of {CORE_RATIO:g} d, "
        f"{digits.mm(thin.core_m)}, has a critical speed of {digits.number(rpm)} in place of "
        f"{digits.number(figures['critical_speed_rpm'])} rpm"
    )
    if too_slow:
        text += f", too low for {digits.number(required_rpm)} rpm: give core_diameter_m"
    yield Note(text, dim=not too_slow)


def _ball_notes(axis: AxisSpec, nut: CatalogueEntry) -> Iterator[Note]:
    """State a limit of the ball speed that is outside the usual range of the material."""
    if nut.limit_m_rpm is not None or axis.balls.usual:
        return
    values = (axis.balls.allowed_m_rpm, *BALLS_M_RPM[axis.balls.material])
    (given, low, high), unit = digits.shown(values, "m rpm")
    yield Note(
        f"d n of {given} {unit} is outside the usual {low} to {high} of "
        f"{axis.balls.material} balls",
        dim=True,
    )
