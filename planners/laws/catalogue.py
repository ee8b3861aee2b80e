"""What each law costs: its smoothness, its peaks and root mean squares in normalised form, its minimum time under limits."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from planners import bounds
from planners.errors import PlanError, unknown_name
from planners.laws import LAWS
from planners.trajectories.trajectory import Trajectory

SMOOTHEST = 6  # highest continuous derivative that is looked for


class Coefficients(NamedTuple):
    """A law's peaks and root mean squares over a move of 1 in a time of 1, exact: they grow with h/T, h/T^2 and h/T^3."""

    name: str
    continuity: str  # C1: the speed has no step, C2: nor the acceleration, ...
    cv: float  # max |speed| T / h
    ca: float  # max |acceleration| T^2 / h
    cv_rms: float
    ca_rms: float
    cj: float  # max |jerk| T^3 / h; inf when the acceleration has a step


@lru_cache(maxsize=len(LAWS))
def coefficients(name: str) -> Coefficients:
    """The named law's row. Raises PlanError for an unknown name."""
    if name not in LAWS:
        raise unknown_name("law", name, LAWS)
    law = LAWS[name](1.0)
    smooth = _continuity(law)
    return Coefficients(
        name=name,
        continuity=f"C{smooth}",
        cv=law.peak(1).value,
        ca=law.peak(2).value,
        cv_rms=law.rms(1),
        ca_rms=law.rms(2),
        cj=law.peak(3).value if smooth >= 2 else math.inf,
    )


def catalogue() -> list[Coefficients]:
    """A row for every law, in the order of LAWS."""
    return [coefficients(name) for name in LAWS]


def minimum_time_s(
    name: str,
    distance_m: float,
    *,
    speed_m_s: float = math.inf,
    acceleration_m_s2: float = math.inf,
    jerk_m_s3: float = math.inf,
) -> float:
    """The shortest time in which the law goes distance_m within the limits: kinematic scaling (source 000); 0 for 0 m.

    T = max(Cv h / v, sqrt(Ca h / a), cbrt(Cj h / j)). Laws with shares keep their defaults. Raises PlanError for an unknown
    name, a limit out of bounds, no finite limit, and a jerk limit for a law whose acceleration has a step.
    """
    row, h = coefficients(name), abs(bounds.distance(distance_m))
    limits = {
        "speed_m_s": speed_m_s,
        "acceleration_m_s2": acceleration_m_s2,
        "jerk_m_s3": jerk_m_s3,
    }
    if not any(math.isfinite(bounds.limit(*item)) for item in limits.items()):
        raise PlanError(
            f"limits {limits} of law {name}; one at least must be finite: give a speed or an acceleration"
        )
    if math.isfinite(jerk_m_s3) and math.isinf(row.cj):
        raise PlanError(
            f"jerk_m_s3 = {jerk_m_s3} for law {name} of class {row.continuity}; it must be C2 or smoother, as a step in the "
            "acceleration is an infinite jerk: take cycloidal, quintic or double_s"
        )
    jerk_time_s = float(math.cbrt(row.cj * h / jerk_m_s3)) if math.isfinite(jerk_m_s3) else 0.0
    return max(row.cv * h / speed_m_s, math.sqrt(row.ca * h / acceleration_m_s2), jerk_time_s)


def _continuity(law: Trajectory) -> int:
    """The highest derivative without a step, at the ends too."""
    return next(k for k in range(SMOOTHEST + 1) if not law.continuous(k + 1))
