"""Bounds of the numbers that a motion may be made of. Each check returns the number.

Within these bounds powers of a time and of a rate neither overflow nor underflow.
"""

from __future__ import annotations

import math

from planners.errors import check_range

SHORTEST_S, LONGEST_S = 1e-9, 1e9  # 30 years
NEAREST_M, FARTHEST_M = 1e-30, 1e9
SLOWEST, FASTEST = 1e-9, 1e12  # speed [m/s], acceleration [m/s^2] and higher derivatives
DATUM = 1e12  # data of a drive: 1e-12 to 1e12


def duration(duration_s: float) -> float:
    """Check a duration [s]; PlanError if it is out of bounds."""
    check_range(
        "duration_s", duration_s, SHORTEST_S, LONGEST_S, "give the motion a time in seconds"
    )
    return duration_s


def distance(distance_m: float, name: str = "distance_m") -> float:
    """Check a displacement or a position [m], which may be 0 or negative; PlanError if not."""
    check_range(name, distance_m, -FARTHEST_M, FARTHEST_M, "give it in metres")
    if distance_m:
        check_range(
            f"size of {name}", abs(distance_m), NEAREST_M, FARTHEST_M, "take 0, as this is rounding"
        )
    return distance_m


def limit(name: str, value: float) -> float:
    """Check the limit of a derivative, inf for none; PlanError if it is out of bounds."""
    if value != math.inf:
        check_range(
            name, value, SLOWEST, FASTEST, "give the size without a sign, or inf for no limit"
        )
    return value


def rate(name: str, value: float) -> float:
    """Check a required speed, acceleration, ... of any sign; PlanError if it is out of bounds."""
    check_range(name, value, -FASTEST, FASTEST, "give it in SI units")
    return value


def half(name: str, value: float) -> float:
    """Check a share that a law contains twice: 1e-6 to 0.5; PlanError if it is out of bounds."""
    check_range(name, value, 1e-6, 0.5, "take a share between them, as it is needed twice")
    return value


def datum(name: str, value: float, *, zero: bool = False) -> float:
    """Check a number of a drive's data sheet; zero = True permits 0. PlanError if out of bounds."""
    if not (zero and value == 0.0):
        check_range(name, value, 1.0 / DATUM, DATUM, "read the catalogue or measure it")
    return value
