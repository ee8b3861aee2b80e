"""What a motion law can do under limits, and the swing it leaves."""

from __future__ import annotations

import math
from typing import NamedTuple

from planners.laws import LAWS
from planners.laws.catalogue import coefficients, minimum_time_s
from planners.laws.rect_cascade import LIMITS, RectCascade
from planners.models.pendulum import PendulumModel
from planners.replay.wrong_parameters import residual_amplitudes
from planners.spectra.swing_free import MAX_CYCLES, MIN_CYCLES, swing_free_cycles
from planners.trajectories.trajectory import Trajectory

RECTS = {
    "trapezoidal": 2,
    "double_s": 3,
    "fifteen_segments": 4,
}  # laws whose shares of time follow from so many limits
MET = 1e-9  # share by which a limit that is reached may be missed
AHEAD = 3.0  # load periods after the minimum time in which a swing-free duration is looked for
WORDS = ("speed", "acceleration", "jerk", "snap")


class LawMove(NamedTuple):
    """A law at its least time under limits; inf and nan where it cannot keep them, with the reason."""

    name: str
    continuity: str
    time_s: float = math.inf
    shape: str = ""  # "limits": its shares of time chosen for these limits, "fixed": its own
    meets: tuple[str, ...] = ()  # limits that are reached
    peak_speed_m_s: float = math.nan
    peak_acceleration_m_s2: float = math.nan
    peak_jerk_m_s3: float = math.nan  # inf for a step in the acceleration
    residual_swing_rad: float = math.nan  # small swings
    residual_swing_nonlinear_rad: float = math.nan
    swing_free_time_s: float = (
        math.nan
    )  # the least one within the limits that leaves small swings at rest
    reason: str = ""


def law_move(name: str, distance: float, limits: tuple[float, ...], load: PendulumModel) -> LawMove:
    """The law's fastest move of that distance within limits of speed, acceleration, jerk and snap (4,), inf for none."""
    row = coefficients(name)
    order, smooth = (
        max(k for k, bound in enumerate(limits, start=1) if math.isfinite(bound)),
        int(row.continuity[1:]),
    )
    if smooth < order - 1:
        return LawMove(
            name,
            row.continuity,
            reason=f"its {WORDS[order - 2]} has a step: a {WORDS[order - 1]} without bound",
        )
    shaped = RECTS.get(name) == order
    path = (
        RectCascade.within(distance, limits[:order]).trajectory()
        if shaped
        else _fixed(name, distance, limits)
    )
    peaks = [path.peak(k).value if path.continuous(k - 1) else math.inf for k in range(1, 5)]
    linear, nonlinear = (
        float(residual_amplitudes([load], path, nonlinear=kind)[0]) for kind in (False, True)
    )
    return LawMove(
        name,
        row.continuity,
        time_s=path.duration_s,
        shape="limits" if shaped else "fixed",
        meets=tuple(
            key
            for key, peak, bound in zip(LIMITS, peaks, limits, strict=True)
            if bound * (1.0 - MET) <= peak < math.inf
        ),
        peak_speed_m_s=peaks[0],
        peak_acceleration_m_s2=peaks[1],
        peak_jerk_m_s3=peaks[2],
        residual_swing_rad=linear,
        residual_swing_nonlinear_rad=nonlinear,
        swing_free_time_s=_swing_free_s(path, period_s(load)),
    )


def _fixed(name: str, distance: float, limits: tuple[float, ...]) -> Trajectory:
    """The law with its own shares of time: as fast as the limits allow."""
    unit, (speed, acceleration, jerk, snap) = LAWS[name](1.0), limits
    time_s = (unit.peak(4).value * abs(distance) / snap) ** 0.25 if math.isfinite(snap) else 0.0
    if math.isfinite(min(speed, acceleration, jerk)):
        fast_s = minimum_time_s(
            name, distance, speed_m_s=speed, acceleration_m_s2=acceleration, jerk_m_s3=jerk
        )
        time_s = max(time_s, fast_s)
    return LAWS[name](time_s).scaled(distance)


def _swing_free_s(path: Trajectory, period_s: float) -> float:
    cycles = path.duration_s / period_s
    if cycles + AHEAD > MAX_CYCLES:
        return math.nan
    found = swing_free_cycles(path, cycles + AHEAD, max(MIN_CYCLES, cycles - MIN_CYCLES))
    later = found[found >= cycles * (1.0 - MET)]
    return float(later[0]) * period_s if later.size else math.nan


def period_s(load: PendulumModel) -> float:
    """Of the load's small swings."""
    return 2.0 * math.pi / load.natural_frequency_rad_s
