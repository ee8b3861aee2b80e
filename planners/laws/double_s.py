"""Speed as two S: constant jerk in seven segments, from limits (also with speeds at the ends) or from shares of the time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from planners import bounds
from planners.errors import Infeasible, PlanError
from planners.laws.rect_cascade import RectCascade
from planners.laws.segments import integrated
from planners.trajectories.trajectory import Trajectory

BOUND_ROUNDING_REL = 1e-12  # a share of a bound that a number may miss it by


def double_s(duration_s: float, alpha: float = 1 / 3, beta: float = 1 / 2) -> Trajectory:
    """From 0 to 1 in T = duration_s: ramps of Ta = alpha T with jerk for Tj = beta Ta at their ends (source 000).

    Shares > 0 and <= 1/2.
    """
    ramp_s = bounds.half("alpha", alpha) * bounds.duration(duration_s)
    return double_s_by_ramp(
        1.0, duration_s, ramp_s, bounds.half("beta", beta) * ramp_s
    ).trajectory()


def double_s_by_ramp(
    distance_m: float, duration_s: float, ramp_s: float, jerk_s: float
) -> RectCascade:
    """Given T, Ta and Tj: speed h/(T-Ta), acceleration speed/(Ta-Tj), jerk acceleration/Tj.

    Raises PlanError unless 0 < ramp_s <= duration_s / 2 and 0 < jerk_s <= ramp_s / 2.
    """
    bounds.duration(duration_s)
    for name, value, whole in (("ramp_s", ramp_s, duration_s), ("jerk_s", jerk_s, ramp_s)):
        if not 0.0 < value <= whole / 2 * (1.0 + BOUND_ROUNDING_REL):
            raise PlanError(
                f"{name} = {value} in {whole} s; must be > 0 and <= {whole / 2:.9g}, as it is needed twice: shorten it"
            )
    return RectCascade(distance_m, (duration_s - ramp_s, ramp_s - jerk_s, jerk_s))


@dataclass(frozen=True)
class Ramp:
    """A change of speed by `rise` [m/s] >= 0: jerk for jerk_s, constant acceleration, jerk back."""

    rise_m_s: float
    jerk_s: float
    duration_s: float

    @classmethod
    def within(cls, rise_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> Ramp:
        """The fastest under both limits; without constant acceleration when rise x jerk < acceleration^2."""
        if rise_m_s * jerk_m_s3 < acceleration_m_s2**2:
            jerk_s = math.sqrt(rise_m_s / jerk_m_s3)
            return cls(rise_m_s, jerk_s, 2.0 * jerk_s)
        jerk_s = acceleration_m_s2 / jerk_m_s3
        return cls(rise_m_s, jerk_s, jerk_s + rise_m_s / acceleration_m_s2)

    def segments(self, jerk_m_s3: float) -> list[tuple[float, float]]:
        """(duration [s], jerk [m/s^3]) of its three parts."""
        return [
            (self.jerk_s, jerk_m_s3),
            (self.duration_s - 2.0 * self.jerk_s, 0.0),
            (self.jerk_s, -jerk_m_s3),
        ]


@dataclass(frozen=True)
class DoubleS:
    """From start_speed_m_s at 0 up to the peak speed, along, and down to end_speed_m_s at distance_m; speeds without sign."""

    distance_m: float
    start_speed_m_s: float
    peak_speed_m_s: float
    jerk_m_s3: float
    up: Ramp
    cruise_s: float
    down: Ramp

    @property
    def duration_s(self) -> float:
        """Time from start to end; 0 for a move of no length."""
        return self.up.duration_s + self.cruise_s + self.down.duration_s

    @property
    def peak_acceleration_m_s2(self) -> float:
        """The larger one of both ramps."""
        return self.jerk_m_s3 * max(self.up.jerk_s, self.down.jerk_s)

    def trajectory(self) -> Trajectory:
        """Up to seven cubics; a move of no length stands still for a nanosecond."""
        sign = math.copysign(1.0, self.distance_m)
        jerk = sign * self.jerk_m_s3
        segments = [*self.up.segments(jerk), (self.cruise_s, 0.0), *self.down.segments(-jerk)]
        return integrated((0.0, sign * self.start_speed_m_s, 0.0), segments)


def double_s_within(
    distance_m: float,
    speed_m_s: float,
    acceleration_m_s2: float,
    jerk_m_s3: float,
    *,
    start_speed_m_s: float = 0.0,
    end_speed_m_s: float = 0.0,
) -> DoubleS:
    """The fastest move under the three limits, with speeds at the ends that point along the move, or are 0.

    Cases 1a (all limits reached), 1b (speed, not acceleration), 2a (acceleration, not speed) and 2b (neither) of source 000,
    for each ramp by itself, so that ends may differ. Refused by name: an end speed against the move or above the limit, a
    distance too short for the change of speed. Raises PlanError, Infeasible.
    """
    for name, value in (
        ("speed_m_s", speed_m_s),
        ("acceleration_m_s2", acceleration_m_s2),
        ("jerk_m_s3", jerk_m_s3),
    ):
        if not math.isfinite(bounds.limit(name, value)):
            raise PlanError(
                f"{name} = {value} of a double S; must be finite: give the limit, or take a trapezoid"
            )
    h, sign = abs(bounds.distance(distance_m)), math.copysign(1.0, distance_m)
    start, end = sign * start_speed_m_s, sign * end_speed_m_s
    for name, value in (("start_speed_m_s", start), ("end_speed_m_s", end)):
        _check_end(name, sign * value, value, speed_m_s, h)

    def ramps(peak: float) -> tuple[Ramp, Ramp, float]:
        up, down = (Ramp.within(peak - v, acceleration_m_s2, jerk_m_s3) for v in (start, end))
        return up, down, h - (start + peak) / 2 * up.duration_s - (end + peak) / 2 * down.duration_s

    least = max(start, end)
    spare = ramps(least)[2]
    if spare < -BOUND_ROUNDING_REL * h:
        raise Infeasible(
            f"distance_m = {distance_m} for a change of speed from {start_speed_m_s} to {end_speed_m_s} m/s; its size must be "
            f">= {h - spare:.9g}: lengthen the move, or bring the speeds together"
        )
    up, down, spare = ramps(speed_m_s)
    if spare >= 0.0:
        return DoubleS(distance_m, start, speed_m_s, jerk_m_s3, up, spare / speed_m_s, down)
    peak = _root(lambda v: ramps(v)[2], least, speed_m_s)
    up, down, _ = ramps(peak)
    return DoubleS(distance_m, start, peak, jerk_m_s3, up, 0.0, down)


def _check_end(name: str, value: float, along: float, speed_m_s: float, h: float) -> None:
    if not along >= 0.0:
        raise PlanError(
            f"{name} = {value} points against the move; must point along it or be 0: brake first, in a move of its own"
        )
    if not along <= speed_m_s:
        raise PlanError(
            f"{name} = {value} with a limit of {speed_m_s} m/s; its size must be within it: raise the limit"
        )
    if along and not h:
        raise PlanError(
            f"{name} = {value} over 0 m; must be 0, as the move lasts 0 s: leave the move out"
        )


def _root(spare: Callable[[float], float], low: float, high: float) -> float:
    """The peak speed that uses up the distance: spare falls from >= 0 at low to < 0 at high."""
    from scipy.optimize import brentq

    if spare(low) <= 0.0:
        return low
    return float(brentq(spare, low, high, xtol=1e-300, rtol=8.9e-16, maxiter=1000))
