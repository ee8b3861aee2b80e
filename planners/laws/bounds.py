"""What the numbers of a law must be; each check hands the number back."""

from __future__ import annotations

import math

from planners.errors import PlanError


def duration(duration_s: float) -> float:
    """A time to move in: finite and > 0 [s]."""
    if not 0.0 < duration_s < math.inf:
        raise PlanError(f"duration_s = {duration_s} of a law; must be finite and > 0: give it more time")
    return duration_s


def distance(distance_m: float) -> float:
    """A way to go: any finite number [m], 0 and negative ones included."""
    if not math.isfinite(distance_m):
        raise PlanError(f"distance_m = {distance_m} of a law; must be finite: give it in metres")
    return distance_m


def limit(name: str, value: float) -> float:
    """A bound of a rate of change: > 0, inf for none."""
    if not value > 0.0:
        raise PlanError(f"{name} = {value} of a law; must be > 0: give the size without a sign, or leave it out for no limit")
    return value


def half(name: str, value: float) -> float:
    """A share of which a law has room for two: 0 < value <= 1/2."""
    if not 0.0 < value <= 0.5:
        raise PlanError(f"{name} = {value} of a law; must be > 0 and <= 0.5, as it is needed twice: take a share between them")
    return value
