"""A number in a next step: rounded to the side on which the step still does what it says."""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, Context

DIGITS = 4


def least(value: float) -> str:
    """Four digits of a number that must be reached: rounded up."""
    return _printed(value, ROUND_CEILING)


def greatest(value: float) -> str:
    """Four digits of a number that must not be passed: rounded down."""
    return _printed(value, ROUND_FLOOR)


def _printed(value: float, rounding: str) -> str:
    return f"{float(Context(prec=DIGITS, rounding=rounding).create_decimal(value)):.{DIGITS}g}"
