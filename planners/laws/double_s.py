"""Double-S law: constant jerk in seven segments, from limits or from shares of the duration."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from planners import bounds
from planners.errors import Infeasible, PlanError
from planners.laws.rect_cascade import RectCascade
from planners.laws.segments import integrated
from planners.trajectories.trajectory import Trajectory

BOUND_ROUNDING_REL = 1e-12  # of a bound: excess that is rounding


def double_s(duration_s: float, alpha: float = 1 / 3, beta: float = 1 / 2) -> Trajectory:
    """Compute the double S from 0 to 1 in T = duration_s (source 000).

    Ramps last Ta = alpha T, with jerk for Tj = beta Ta at their ends. Shares > 0 and <= 1/2.
    """
    ramp_s = bounds.half("alpha", alpha) * bounds.duration(duration_s)
    jerk_s = bounds.half("beta", beta) * ramp_s
    return double_s_by_ramp(1.0, duration_s, ramp_s, jerk_s).trajectory()


def double_s_by_ramp(
    distance_m: float, duration_s: float, ramp_s: float, jerk_s: float
) -> RectCascade:
    """Compute the double S with the given duration T, ramp time Ta and jerk time Tj.

    Speed h/(T-Ta), acceleration speed/(Ta-Tj), jerk acceleration/Tj.
    Raises PlanError unless 0 < ramp_s <= duration_s / 2 and 0 < jerk_s <= ramp_s / 2.
    """
    bounds.duration(duration_s)
    for name, value, whole in (("ramp_s", ramp_s, duration_s), ("jerk_s", jerk_s, ramp_s)):
        if not 0.0 < value <= whole / 2 * (1.0 + BOUND_ROUNDING_REL):
            raise PlanError(
                f"{name} = {value} in {whole} s; must be > 0 and <= {whole / 2:.9g}, "
                "as it is needed twice: shorten it"
            )
    return RectCascade(distance_m, (duration_s - ramp_s, ramp_s - jerk_s, jerk_s))


@dataclass(frozen=True)
class Ramp:
    """Change of speed by rise_m_s >= 0: jerk for jerk_s, constant acceleration, opposite jerk."""

    rise_m_s: float
    jerk_s: float
    duration_s: float

    @classmethod
    def within(cls, rise_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> Ramp:
        """Compute the fastest ramp under both limits.

        It has no constant acceleration when rise x jerk < acceleration^2.
        """
        if rise_m_s * jerk_m_s3 < acceleration_m_s2**2:
            jerk_s = math.sqrt(rise_m_s / jerk_m_s3)
            return cls(rise_m_s, jerk_s, 2.0 * jerk_s)
        jerk_s = acceleration_m_s2 / jerk_m_s3
        return cls(rise_m_s, jerk_s, jerk_s + rise_m_s / acceleration_m_s2)

    def segments(self, jerk_m_s3: float) -> list[tuple[float, float]]:
        """List (duration [s], jerk [m/s^3]) of the three segments."""
        return [
            (self.jerk_s, jerk_m_s3),
            (self.duration_s - 2.0 * self.jerk_s, 0.0),
            (self.jerk_s, -jerk_m_s3),
        ]


@dataclass(frozen=True)
class DoubleS:
    """Double-S move from 0 to distance_m: ramp up, constant peak speed, ramp down.

    It starts at start_speed_m_s and ends at the speed that `down` leaves. Speeds are unsigned.
    """

    distance_m: float
    start_speed_m_s: float
    peak_speed_m_s: float
    jerk_m_s3: float
    up: Ramp
    cruise_s: float
    down: Ramp

    @property
    def duration_s(self) -> float:
        """Duration [s]; 0 for a move over 0 m."""
        return self.up.duration_s + self.cruise_s + self.down.duration_s

    @property
    def peak_acceleration_m_s2(self) -> float:
        """Larger peak acceleration of the two ramps."""
        return self.jerk_m_s3 * max(self.up.jerk_s, self.down.jerk_s)

    def trajectory(self) -> Trajectory:
        """Compute the trajectory of up to seven cubics; a move over 0 m is a hold of 1 ns."""
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
    """Compute the fastest double S under three limits, with given speeds at the ends.

    The speeds at the ends point along the move or are 0. Cases of source 000: 1a (all limits
    reached), 1b (speed, not acceleration), 2a (acceleration, not speed), 2b (neither), for each
    ramp by itself, so that the ramps may differ.
    Raises PlanError for an end speed against the move or above the limit, and for a limit out
    of bounds; Infeasible for a distance too short for the change of speed.
    """
    _check_limits(speed_m_s, acceleration_m_s2, jerk_m_s3)
    h, sign = abs(bounds.distance(distance_m)), math.copysign(1.0, distance_m)
    start, end = sign * start_speed_m_s, sign * end_speed_m_s
    _check_end("start_speed_m_s", sign * start, start, speed_m_s, h)
    _check_end("end_speed_m_s", sign * end, end, speed_m_s, h)

    def ramps(peak: float) -> tuple[Ramp, Ramp, float]:
        """Compute both ramps and the distance [m] left between them."""
        up = Ramp.within(peak - start, acceleration_m_s2, jerk_m_s3)
        down = Ramp.within(peak - end, acceleration_m_s2, jerk_m_s3)
        return up, down, h - (start + peak) / 2 * up.duration_s - (end + peak) / 2 * down.duration_s

    least = max(start, end)
    cruise_m = ramps(least)[2]
    if cruise_m < -BOUND_ROUNDING_REL * h:
        raise Infeasible(
            f"distance_m = {distance_m} for a change of speed from {start_speed_m_s} to "
            f"{end_speed_m_s} m/s; its absolute value must be >= {h - cruise_m:.9g}: "
            "lengthen the move, or reduce the difference of the speeds"
        )
    up, down, cruise_m = ramps(speed_m_s)
    if cruise_m >= 0.0:
        return DoubleS(distance_m, start, speed_m_s, jerk_m_s3, up, cruise_m / speed_m_s, down)
    peak = _solve_peak_speed(lambda v: ramps(v)[2], least, speed_m_s)
    up, down, _ = ramps(peak)
    return DoubleS(distance_m, start, peak, jerk_m_s3, up, 0.0, down)


def _check_limits(speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> None:
    for name, value in (
        ("speed_m_s", speed_m_s),
        ("acceleration_m_s2", acceleration_m_s2),
        ("jerk_m_s3", jerk_m_s3),
    ):
        if not math.isfinite(bounds.limit(name, value)):
            raise PlanError(
                f"{name} = {value} of a double S; must be finite: "
                "give the limit, or use the trapezoidal law"
            )


def _check_end(name: str, value: float, along: float, speed_m_s: float, h: float) -> None:
    """Raise PlanError for a speed [m/s] that a move over h [m] cannot start or end with."""
    if not along >= 0.0:
        raise PlanError(
            f"{name} = {value} points against the move; must point along it or be 0: "
            "brake first, in a separate move"
        )
    if not along <= speed_m_s:
        raise PlanError(
            f"{name} = {value} with a limit of {speed_m_s} m/s; "
            "its absolute value must be within it: raise the limit"
        )
    if along and not h:
        raise PlanError(
            f"{name} = {value} over 0 m; must be 0, as the move lasts 0 s: leave the move out"
        )


def _solve_peak_speed(cruise_m: Callable[[float], float], low: float, high: float) -> float:
    """Find the peak speed without constant speed: cruise_m falls from >= 0 at low to < 0."""
    from scipy.optimize import brentq

    if cruise_m(low) <= 0.0:
        return low
    return float(brentq(cruise_m, low, high, xtol=1e-300, rtol=8.9e-16, maxiter=1000))
