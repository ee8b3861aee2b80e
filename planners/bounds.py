"""The one place that says how large a number a motion may be made of; each check hands the number back.

Within these sizes powers of a time and of a rate neither overflow nor vanish.
"""

from __future__ import annotations

import math

from planners.errors import check_range

SHORTEST_S, LONGEST_S = 1e-9, 1e9  # 30 years
NEAREST_M, FARTHEST_M = 1e-30, 1e9
SLOWEST, FASTEST = 1e-9, 1e12  # limits of speed, acceleration, ...
DATUM = 1e12  # of a motor: 1e-12 to 1e12


def duration(duration_s: float) -> float:
    """A time to move in [s]."""
    check_range(
        "duration_s", duration_s, SHORTEST_S, LONGEST_S, "give the motion a time in seconds"
    )
    return duration_s


def distance(distance_m: float, name: str = "distance_m") -> float:
    """A way to go or a place [m], 0 and negative ones included."""
    check_range(name, distance_m, -FARTHEST_M, FARTHEST_M, "give it in metres")
    if distance_m:
        check_range(
            f"size of {name}", abs(distance_m), NEAREST_M, FARTHEST_M, "take 0, as this is rounding"
        )
    return distance_m


def limit(name: str, value: float) -> float:
    """A bound of a rate of change, inf for none."""
    if value != math.inf:
        check_range(
            name, value, SLOWEST, FASTEST, "give the size without a sign, or inf for no limit"
        )
    return value


def rate(name: str, value: float) -> float:
    """A speed, acceleration, ... to be met, of any sign."""
    check_range(name, value, -FASTEST, FASTEST, "give it in SI units")
    return value


def half(name: str, value: float) -> float:
    """A share of which a law has room for two."""
    check_range(name, value, 1e-6, 0.5, "take a share between them, as it is needed twice")
    return value


def datum(name: str, value: float, *, zero: bool = False) -> float:
    """A number from a drive's data sheet; some may be 0."""
    if not (zero and value == 0.0):
        check_range(name, value, 1.0 / DATUM, DATUM, "read the catalogue or measure it")
    return value
