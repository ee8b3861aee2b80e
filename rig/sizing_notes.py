"""What is worth a line below the tables of a sizing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from planners.drives.screw.axis import Axis
from planners.drives.screw.balls import BALLS_M_RPM
from planners.drives.screw.candidate import Candidate
from planners.drives.screw.checks import allowed_speed
from planners.drives.screw.limits import RPM
from planners.drives.screw.remedies import slower
from planners.drives.screw.verdict import Assessment

CORE = 0.9  # of the nominal diameter: about what is left below a thread


class Note(NamedTuple):
    """A line; a dim one is an aside."""

    text: str
    dim: bool = False


def notes(axis: Axis, judged: Assessment, figures: dict[str, float]) -> Iterator[Note]:
    """Of a screw with its figures."""
    f = {name: f"{value:.5g}" for name, value in figures.items()}
    nut = judged.candidate
    yield Note(f"least lead at this diameter: {f['lead_min_whirl_m']} m by whirling, {f['lead_min_balls_m']} m by the balls")
    yield from _aside(axis, nut, f["critical_speed_rpm"])
    yield from map(Note, judged.notes)
    yield Note(
        f"antiresonance {f['antiresonance_rad_s']} rad/s, resonance {f['resonance_rad_s']} rad/s: a bandwidth of "
        f"{f['bandwidth_low_rad_s']} to {f['bandwidth_high_rad_s']} rad/s"
    )
    yield Note(
        f"motor: drives with at most {f['driving_power_w']} W, on average {f['mean_driving_power_w']} W; brakes with at most "
        f"{f['braking_power_w']} W, on average {f['mean_braking_power_w']} W"
    )
    if axis.preload_n(nut):
        yield Note(
            f"preload {f['preload_n']} N: an equivalent load of {f['equivalent_load_n']} N in place of "
            f"{f['equivalent_force_n']} N; drag {f['drag_torque_n_m']} N m"
            + ("" if axis.transmission.drag_torque_n_m is None else ", as given")
        )
    elif nut.dynamic_load_n is not None:
        yield Note(
            f"preload: none; 5 to 10 % of the dynamic load, {f['preload_low_n']} to {f['preload_high_n']} N, leave a life of "
            f"{f['life_at_preload_low_h']} to {f['life_at_preload_high_h']} h"
        )
    speed, by = allowed_speed(axis, judged)
    late = slower(axis.cycle, speed)
    yield Note(f"allowed speed: {speed:.6g} m/s by {by}{f'; {late}' if late else ''}")


def _aside(axis: Axis, nut: Candidate, critical_rpm: str) -> Iterator[Note]:
    """What is taken for granted."""
    if nut.core_diameter_m is None:
        thin = replace(nut, core_diameter_m=CORE * nut.diameter_m)
        rpm = axis.shares.whirl * thin.screw(axis.mounting).whirl_rad_s * RPM
        yield Note(
            f"the core is taken to be as thick as the screw: one of {CORE:g} d, {thin.core_m:.4g} m, has a critical speed of "
            f"{rpm:.5g} in place of {critical_rpm} rpm",
            dim=True,
        )
    if nut.limit_m_rpm is None and not axis.balls.usual:
        low, high = BALLS_M_RPM[axis.balls.material]
        yield Note(
            f"d n of {axis.balls.allowed_m_rpm:g} m rpm is not the {low:g} to {high:g} of {axis.balls.material} balls", dim=True
        )
