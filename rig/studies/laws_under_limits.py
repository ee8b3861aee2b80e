"""Fastest moves of the motion laws under limits, and their residual swing."""

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

# laws whose shares of time follow from this number of limits
LIMITS_OF_LAW = {"trapezoidal": 2, "double_s": 3, "fifteen_segments": 4}
REACHED_REL = 1e-9  # share by which an active limit may be missed
SEARCH_PERIODS = 3.0  # after the minimum time, for a zero-residual duration
DERIVATIVE_NAMES = ("speed", "acceleration", "jerk", "snap")


class LawMove(NamedTuple):
    """Move of a law in its least time under limits.

    inf and nan where the law cannot keep the limits; `reason` says why.
    """

    name: str
    continuity: str
    time_s: float = math.inf
    shape: str = ""  # "limits": shares of time chosen for these limits, "fixed": the law's own
    meets: tuple[str, ...] = ()  # active limits
    peak_speed_m_s: float = math.nan
    peak_acceleration_m_s2: float = math.nan
    peak_jerk_m_s3: float = math.nan  # inf for a step in the acceleration
    residual_swing_rad: float = math.nan  # linear model
    residual_swing_nonlinear_rad: float = math.nan
    swing_free_time_s: float = math.nan  # least zero-residual duration within the limits
    reason: str = ""


def law_move(name: str, distance: float, limits: tuple[float, ...], load: PendulumModel) -> LawMove:
    """Compute the fastest move of a law over a distance.

    limits are those of speed, acceleration, jerk and snap (4,), inf for none.
    """
    continuity = coefficients(name).continuity
    order = max(k for k, bound in enumerate(limits, start=1) if math.isfinite(bound))
    if int(continuity[1:]) < order - 1:
        step, unbounded = DERIVATIVE_NAMES[order - 2], DERIVATIVE_NAMES[order - 1]
        reason = f"its {step} has a step: a {unbounded} without bound"
        return LawMove(name, continuity, reason=reason)
    shaped = LIMITS_OF_LAW.get(name) == order
    if shaped:
        path = RectCascade.within(distance, limits[:order]).trajectory()
    else:
        path = _fixed_shape(name, distance, limits)
    peaks = [path.peak(k).value if path.continuous(k - 1) else math.inf for k in range(1, 5)]
    linear, nonlinear = (
        float(residual_amplitudes([load], path, nonlinear=kind)[0]) for kind in (False, True)
    )
    return LawMove(
        name,
        continuity,
        time_s=path.duration_s,
        shape="limits" if shaped else "fixed",
        meets=_active_limits(peaks, limits),
        peak_speed_m_s=peaks[0],
        peak_acceleration_m_s2=peaks[1],
        peak_jerk_m_s3=peaks[2],
        residual_swing_rad=linear,
        residual_swing_nonlinear_rad=nonlinear,
        swing_free_time_s=_swing_free_s(path, period_s(load)),
    )


def period_s(load: PendulumModel) -> float:
    """Compute the period of the load's small swings."""
    return 2.0 * math.pi / load.natural_frequency_rad_s


def _active_limits(peaks: list[float], limits: tuple[float, ...]) -> tuple[str, ...]:
    """List the limits that the peaks reach, by name."""
    active = []
    for key, peak, bound in zip(LIMITS, peaks, limits, strict=True):
        if bound * (1.0 - REACHED_REL) <= peak < math.inf:
            active.append(key)
    return tuple(active)


def _fixed_shape(name: str, distance: float, limits: tuple[float, ...]) -> Trajectory:
    """Compute the fastest move within the limits with the law's own shares of time."""
    unit = LAWS[name](1.0)
    speed, acceleration, jerk, snap = limits
    time_s = 0.0
    if math.isfinite(snap):
        time_s = (unit.peak(4).value * abs(distance) / snap) ** 0.25
    if math.isfinite(min(speed, acceleration, jerk)):
        fast_s = minimum_time_s(
            name, distance, speed_m_s=speed, acceleration_m_s2=acceleration, jerk_m_s3=jerk
        )
        time_s = max(time_s, fast_s)
    return LAWS[name](time_s).scaled(distance)


def _swing_free_s(path: Trajectory, period_s: float) -> float:
    """Compute the least zero-residual duration of the law, not below the path's; nan if none."""
    cycles = path.duration_s / period_s
    if cycles + SEARCH_PERIODS > MAX_CYCLES:
        return math.nan
    found = swing_free_cycles(path, cycles + SEARCH_PERIODS, max(MIN_CYCLES, cycles - MIN_CYCLES))
    later = found[found >= cycles * (1.0 - REACHED_REL)]
    return float(later[0]) * period_s if later.size else math.nan
