"""Characteristics of the motion laws: smoothness, normalised peaks and rms, minimum time."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from planners import bounds
from planners.errors import PlanError, unknown_name
from planners.laws import LAWS
from planners.trajectories.trajectory import Trajectory

MAX_CONTINUITY_ORDER = 6  # highest derivative tested for steps


class Coefficients(NamedTuple):
    """Peaks and root mean squares of a law for distance 1 in time 1, exact.

    Speeds scale with h/T, accelerations with h/T^2, jerks with h/T^3.
    """

    name: str
    continuity: str  # C1: the speed has no step, C2: nor the acceleration, ...
    cv: float  # max |speed| T / h
    ca: float  # max |acceleration| T^2 / h
    cv_rms: float
    ca_rms: float
    cj: float  # max |jerk| T^3 / h; inf when the acceleration has a step


@lru_cache(maxsize=len(LAWS))
def coefficients(name: str) -> Coefficients:
    """Compute the coefficients of the named law. Raises PlanError for an unknown name."""
    if name not in LAWS:
        raise unknown_name("law", name, LAWS)
    law = LAWS[name](1.0)
    order = _continuity_order(law)
    return Coefficients(
        name=name,
        continuity=f"C{order}",
        cv=law.peak(1).value,
        ca=law.peak(2).value,
        cv_rms=law.rms(1),
        ca_rms=law.rms(2),
        cj=law.peak(3).value if order >= 2 else math.inf,
    )


def catalogue() -> list[Coefficients]:
    """Compute the coefficients of every law, in the order of LAWS."""
    return [coefficients(name) for name in LAWS]


def minimum_time_s(
    name: str,
    distance_m: float,
    *,
    speed_m_s: float = math.inf,
    acceleration_m_s2: float = math.inf,
    jerk_m_s3: float = math.inf,
) -> float:
    """Compute the minimum time of a law over distance_m within the limits; 0 for 0 m.

    Kinematic scaling (source 000): T = max(Cv h / v, sqrt(Ca h / a), cbrt(Cj h / j)). Laws with
    shares of the duration keep their default shares.
    Raises PlanError for an unknown name, a limit out of bounds, no finite limit, and a jerk
    limit for a law whose acceleration has a step.
    """
    row, h = coefficients(name), abs(bounds.distance(distance_m))
    limits = {
        "speed_m_s": speed_m_s,
        "acceleration_m_s2": acceleration_m_s2,
        "jerk_m_s3": jerk_m_s3,
    }
    if not any(math.isfinite(bounds.limit(*item)) for item in limits.items()):
        raise PlanError(
            f"limits {limits} of law {name}; at least one must be finite: "
            "give a speed or an acceleration"
        )
    if math.isfinite(jerk_m_s3) and math.isinf(row.cj):
        raise PlanError(
            f"jerk_m_s3 = {jerk_m_s3} for law {name} of class {row.continuity}; it must be C2 or "
            "smoother, as a step in the acceleration is an infinite jerk: "
            "use cycloidal, quintic or double_s"
        )
    jerk_time_s = float(math.cbrt(row.cj * h / jerk_m_s3)) if math.isfinite(jerk_m_s3) else 0.0
    return max(row.cv * h / speed_m_s, math.sqrt(row.ca * h / acceleration_m_s2), jerk_time_s)


def _continuity_order(law: Trajectory) -> int:
    """Compute the highest order up to which no derivative has a step, ends included."""
    return next(k for k in range(MAX_CONTINUITY_ORDER + 1) if not law.continuous(k + 1))
