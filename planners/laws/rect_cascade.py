"""Moves whose speed is a cascade of moving averages (rects): trapezoidal, double S, 15 segments.

speed = h rect(T1) * rect(T2) * ..., a convolution of rects of unit area and length T_i: two for
the trapezoid, three for the double S, four for 15 segments. Each rect bounds one derivative and
puts a zero of the acceleration spectrum at every multiple of 1/T_i. A T_i that is a multiple of
the modal period of a load gives zero residual vibration.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

from planners import bounds
from planners.errors import PlanError, check_range
from planners.laws.segments import integrated
from planners.trajectories.trajectory import Trajectory

MIN_LENGTH_S = 1e-45  # of a rect: the least distance at the highest speed takes 1e-42 s
LIMITS = ("speed_m_s", "acceleration_m_s2", "jerk_m_s3", "snap_m_s4")


@dataclass(frozen=True)
class RectCascade:
    """Move from rest at 0 to rest at distance_m; lengths of the rects, longest first, 0 for none.

    Raises PlanError for a distance out of bounds and a length that is neither 0 nor MIN_LENGTH_S
    to 1e9 s.
    """

    distance_m: float
    times_s: tuple[float, ...]

    def __post_init__(self) -> None:
        bounds.distance(self.distance_m)
        for k, time_s in enumerate(self.times_s):
            if time_s:
                check_range(
                    f"times_s[{k}]",
                    time_s,
                    MIN_LENGTH_S,
                    bounds.LONGEST_S,
                    "give the length of the rect, or 0 for none",
                )
        if self.distance_m and not self.duration_s:
            raise PlanError(
                f"distance_m = {self.distance_m} with times_s of sum 0; the sum must be > 0: "
                "give at least one length"
            )

    @property
    def duration_s(self) -> float:
        """Duration [s], the sum of the lengths; 0 for a move over 0 m."""
        return math.fsum(self.times_s)

    @property
    def peaks(self) -> tuple[float, ...]:
        """Bounds of |speed|, |acceleration|, ... [m/s^k].

        They are reached when each length is >= the sum of those after it.
        """
        bounds_found, bound = [], abs(self.distance_m)
        for time_s in self.times_s:
            if time_s:
                bound = bound / time_s
            else:
                bound = math.inf if bound else 0.0
            bounds_found.append(bound)
        return tuple(bounds_found)

    def trajectory(self) -> Trajectory:
        """Compute the trajectory: up to 2^n - 1 polynomials of degree n for n rects.

        A move of distance and duration 0 is a hold of one nanosecond.
        """
        times = [time_s for time_s in self.times_s if time_s]
        # steps +-1 of the derivative of order n, at every sum of some of the lengths, exactly
        steps = [(Fraction(0), 1)]
        for time_s in times:
            steps += [(instant + Fraction(time_s), -sign) for instant, sign in steps]
        steps.sort()
        unit, height, segments = self.distance_m / math.prod(times), 0, []
        for (start, sign), (end, _) in pairwise(steps):
            height += sign
            segments.append((end - start, height * unit))
        return integrated([0.0] * max(1, len(times)), segments)

    @classmethod
    def within(cls, distance_m: float, limits: Sequence[float]) -> RectCascade:
        """Compute the fastest cascade of len(limits) rects under the limits.

        limits: bounds of |speed|, |acceleration|, ... [m/s^k], inf for none. A limit that cannot
        be reached under the limits after it is lowered to the value that is just reached; the
        cases 1b, 2a and 2b of the double S and the triangular trapezoid follow from this rule.
        Raises PlanError for a limit out of bounds, for more limits than LIMITS names, and when
        none is finite.
        """
        if len(limits) > len(LIMITS):
            raise PlanError(
                f"{len(limits)} limits of a law; must be <= {len(LIMITS)}, up to the snap: "
                "leave the others out"
            )
        for name, value in zip(LIMITS, limits, strict=False):
            bounds.limit(name, value)
        if not any(map(math.isfinite, limits)):
            raise PlanError(
                f"limits = {tuple(limits)} of a law; at least one must be finite: "
                "give a speed or an acceleration"
            )
        while not math.isfinite(limits[-1]):
            limits = limits[:-1]
        distance = abs(bounds.distance(distance_m))
        return cls(distance_m, tuple(_lengths(distance, tuple(limits))) if distance else ())


def _lengths(value: float, limits: Sequence[float]) -> list[float]:
    """Compute lengths of the rects that bring a derivative from 0 to value, longest first.

    limits bound the derivatives that follow it.
    """
    if len(limits) == 1:
        return [value / limits[0]]
    rest = _lengths(limits[0], limits[1:]) if math.isfinite(limits[0]) else [math.inf]
    if value / limits[0] >= math.fsum(rest):
        return [value / limits[0], *rest]
    peak = _reachable_peak(value, limits)
    return [value / peak, *_lengths(peak, limits[1:])]


def _reachable_peak(value: float, limits: Sequence[float]) -> float:
    """Compute the peak <= limits[0] at which value / peak equals the time of the rise to it."""
    if len(limits) == 2:
        return math.sqrt(value * limits[1])
    from scipy.optimize import brentq

    def excess_s(peak: float) -> float:
        return value / peak - math.fsum(_lengths(peak, limits[1:]))

    # a rise to y under a bound L of the m-th next derivative lasts (y/L)^(1/m) or longer
    high = min((value**m * bound) ** (1.0 / (m + 1)) for m, bound in enumerate(limits))
    low = value / math.fsum(_lengths(high, limits[1:]))
    peak = brentq(excess_s, low * (1.0 - 1e-12), high * (1.0 + 1e-12), xtol=1e-300, rtol=8.9e-16)
    return float(peak)


def fifteen_segments(
    duration_s: float, alpha: float = 1 / 3, beta: float = 1 / 2, gamma: float = 1 / 2
) -> Trajectory:
    """Compute the law of constant snap in 15 segments, from 0 to 1 in T = duration_s.

    Ta = alpha T, Tj = beta Ta, Ts = gamma Tj (source 000); shares > 0 and <= 1/2.
    Speed h/(T-Ta), acceleration speed/(Ta-Tj), jerk acceleration/(Tj-Ts), snap jerk/Ts.
    """
    ramp_s = bounds.half("alpha", alpha) * bounds.duration(duration_s)
    jerk_s = bounds.half("beta", beta) * ramp_s
    snap_s = bounds.half("gamma", gamma) * jerk_s
    times_s = (duration_s - ramp_s, ramp_s - jerk_s, jerk_s - snap_s, snap_s)
    return RectCascade(1.0, times_s).trajectory()
