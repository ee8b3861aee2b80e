"""Speed as a cascade of moving averages: trapezoid (two), double S (three) and 15 segments (four) are one family.

speed = h rect(T1) * rect(T2) * ..., rects of unit area and length T_i convolved. Each of them bounds one derivative, and
each puts a zero of the acceleration's spectrum at every multiple of 1/T_i: a T_i that is a multiple of a load's period
leaves it without swing.
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

SHORTEST_S = 1e-45  # of a rect: the least distance at the highest speed takes 1e-42 s
LIMITS = ("speed_m_s", "acceleration_m_s2", "jerk_m_s3", "snap_m_s4")


@dataclass(frozen=True)
class RectCascade:
    """A move from rest at 0 to rest at distance_m: lengths of the rects, longest first, a length of 0 for none.

    Raises PlanError for a distance out of bounds and a length that is neither 0 nor SHORTEST_S to 1e9 s.
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
                    SHORTEST_S,
                    bounds.LONGEST_S,
                    "give the rect's length, or 0 for none",
                )
        if self.distance_m and not self.duration_s:
            raise PlanError(
                f"distance_m = {self.distance_m} in times_s of sum 0; the sum must be > 0: give it time"
            )

    @property
    def duration_s(self) -> float:
        """Sum of the lengths; 0 for a move of no length."""
        return math.fsum(self.times_s)

    @property
    def peaks(self) -> tuple[float, ...]:
        """Bounds of |speed|, |acceleration|, ... [m/s^k]; met when each length is >= the sum of those after it."""
        sizes, size = [], abs(self.distance_m)
        for time_s in self.times_s:
            size = size / time_s if time_s else (math.inf if size else 0.0)
            sizes.append(size)
        return tuple(sizes)

    def trajectory(self) -> Trajectory:
        """Up to 2^n - 1 polynomials of degree n for n rects; a move of no length and time stands still for a nanosecond."""
        times = [time_s for time_s in self.times_s if time_s]
        steps = [
            (Fraction(0), 1)
        ]  # of the derivative of order n: +-1 at every sum of some of the lengths, exactly
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
        """The fastest cascade of len(limits) rects within bounds of |speed|, |acceleration|, ... [m/s^k], inf for none.

        A limit that leaves no room for the ones after it is lowered until it just does: cases 1b, 2a and 2b of the
        double S and the triangular trapezoid are this rule. Raises PlanError for a limit out of bounds, for more than
        LIMITS names, and when none is finite.
        """
        if len(limits) > len(LIMITS):
            raise PlanError(
                f"{len(limits)} limits of a law; must be <= {len(LIMITS)}, up to the snap: leave the others out"
            )
        for name, value in zip(LIMITS, limits, strict=False):
            bounds.limit(name, value)
        if not any(map(math.isfinite, limits)):
            raise PlanError(
                f"limits = {tuple(limits)} of a law; one at least must be finite: give a speed or an acceleration"
            )
        while not math.isfinite(limits[-1]):
            limits = limits[:-1]
        distance = abs(bounds.distance(distance_m))
        return cls(distance_m, tuple(_rise(distance, tuple(limits))) if distance else ())


def _rise(value: float, limits: Sequence[float]) -> list[float]:
    """Lengths of the rects that bring a derivative from 0 to value under limits of the next ones, longest first."""
    if len(limits) == 1:
        return [value / limits[0]]
    rest = _rise(limits[0], limits[1:]) if math.isfinite(limits[0]) else [math.inf]
    if value / limits[0] >= math.fsum(rest):
        return [value / limits[0], *rest]
    size = _lowered(value, limits)
    return [value / size, *_rise(size, limits[1:])]


def _lowered(value: float, limits: Sequence[float]) -> float:
    """The limits[0] at which value / size just lasts as long as the rise to that size."""
    if len(limits) == 2:
        return math.sqrt(value * limits[1])
    from scipy.optimize import brentq

    def spare(size: float) -> float:
        return value / size - math.fsum(_rise(size, limits[1:]))

    # a rise to y under a bound L of the m-th next derivative lasts (y/L)^(1/m) or longer
    high = min((value**m * bound) ** (1.0 / (m + 1)) for m, bound in enumerate(limits))
    low = value / math.fsum(_rise(high, limits[1:]))
    return float(
        brentq(spare, low * (1.0 - 1e-12), high * (1.0 + 1e-12), xtol=1e-300, rtol=8.9e-16)
    )


def fifteen_segments(
    duration_s: float, alpha: float = 1 / 3, beta: float = 1 / 2, gamma: float = 1 / 2
) -> Trajectory:
    """Constant snap in 15 segments, from 0 to 1 in T = duration_s: Ta = alpha T, Tj = beta Ta, Ts = gamma Tj (source 000).

    Shares > 0 and <= 1/2. Speed h/(T-Ta), acceleration speed/(Ta-Tj), jerk acceleration/(Tj-Ts), snap jerk/Ts.
    """
    ramp_s = bounds.half("alpha", alpha) * bounds.duration(duration_s)
    jerk_s = bounds.half("beta", beta) * ramp_s
    snap_s = bounds.half("gamma", gamma) * jerk_s
    return RectCascade(
        1.0, (duration_s - ramp_s, ramp_s - jerk_s, jerk_s - snap_s, snap_s)
    ).trajectory()
