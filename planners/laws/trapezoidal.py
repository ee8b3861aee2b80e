"""Trapezoidal law: constant acceleration, speed and deceleration, from any two of its data."""

from __future__ import annotations

import math

from planners import bounds
from planners.errors import Infeasible, PlanError
from planners.laws.rect_cascade import RectCascade
from planners.trajectories.trajectory import Trajectory

BOUND_ROUNDING_REL = 1e-12  # of a bound: excess that is rounding


def trapezoidal(duration_s: float, alpha: float = 1 / 3) -> Trajectory:
    """Compute the trapezoidal law from 0 to 1 in T = duration_s (source 000).

    Each ramp lasts alpha T, 0 < alpha <= 1/2.
    """
    bounds.duration(duration_s)
    ramp_s = bounds.half("alpha", alpha) * duration_s
    return trapezoidal_by_ramp(1.0, duration_s, ramp_s).trajectory()


def triangular(duration_s: float) -> Trajectory:
    """Compute the triangular law from 0 to 1 in duration_s, without constant speed.

    It has the least peak acceleration of all rest-to-rest moves.
    """
    return trapezoidal(duration_s, alpha=0.5)


def trapezoidal_within(
    distance_m: float, speed_m_s: float, acceleration_m_s2: float
) -> RectCascade:
    """Compute the fastest trapezoidal move under limits of speed and acceleration.

    It is triangular when |distance| < speed^2 / acceleration (missing in source 002). The
    distance may have any sign; 0 gives a duration of 0. Raises PlanError for a limit out of
    bounds.
    """
    if not math.isfinite(acceleration_m_s2):
        raise PlanError(
            f"acceleration_m_s2 = {acceleration_m_s2} of a trapezoid; must be > 0 and finite: "
            "give the limit of the drive"
        )
    return RectCascade.within(distance_m, (speed_m_s, acceleration_m_s2))


def trapezoidal_by_ramp(distance_m: float, duration_s: float, ramp_s: float) -> RectCascade:
    """Compute the trapezoidal move with the given duration T and ramp time Ta.

    Speed h / (T - Ta). Raises PlanError unless 0 < ramp_s <= duration_s / 2.
    """
    bounds.duration(duration_s)
    if not 0.0 < ramp_s <= duration_s / 2 * (1.0 + BOUND_ROUNDING_REL):
        raise PlanError(
            f"ramp_s = {ramp_s} in {duration_s} s; must be > 0 and <= {duration_s / 2:.9g}, "
            "half the duration: shorten it"
        )
    return RectCascade(distance_m, (duration_s - ramp_s, ramp_s))


def trapezoidal_by_acceleration(
    distance_m: float, duration_s: float, acceleration_m_s2: float
) -> RectCascade:
    """Compute the trapezoidal move with the given duration T and acceleration a.

    Over 0 m it holds its position for T. Raises Infeasible with the minimum time when
    a < 4 |h| / T^2.
    """
    bounds.duration(duration_s)
    a, h = bounds.limit("acceleration_m_s2", acceleration_m_s2), abs(bounds.distance(distance_m))
    least = 4.0 * h / duration_s**2
    if not least * (1.0 - BOUND_ROUNDING_REL) <= a < math.inf:
        raise Infeasible(
            f"acceleration_m_s2 = {a} over {h} m in {duration_s} s; must be finite and "
            f">= {least:.9g}: lengthen the move",
            minimum_time_s=2.0 * math.sqrt(h / a),
        )
    if not h:
        return RectCascade(distance_m, (duration_s / 2.0, duration_s / 2.0))
    cruise_s = duration_s * math.sqrt(max(0.0, 1.0 - least / a))  # time at constant speed
    ramp_s = h / a / ((duration_s + cruise_s) / 2.0)
    return RectCascade(distance_m, (duration_s - ramp_s, ramp_s))


def trapezoidal_by_speed(distance_m: float, duration_s: float, speed_m_s: float) -> RectCascade:
    """Compute the trapezoidal move with the given duration T and speed v.

    Over 0 m it holds its position for T. Raises Infeasible unless |h| / T < v <= 2 |h| / T.
    """
    bounds.duration(duration_s)
    v, h = bounds.limit("speed_m_s", speed_m_s), abs(bounds.distance(distance_m))
    mean = h / duration_s
    if not h:
        return RectCascade(distance_m, (duration_s / 2.0, duration_s / 2.0))
    if not mean < v <= 2.0 * mean * (1.0 + BOUND_ROUNDING_REL):
        raise Infeasible(
            f"speed_m_s = {v} over {h} m in {duration_s} s; must be > {mean:.9g} and "
            f"<= {2.0 * mean:.9g}: change the duration or the speed",
            minimum_time_s=h / v,
        )
    braking_start_s = h / v
    return RectCascade(distance_m, (braking_start_s, duration_s - braking_start_s))
