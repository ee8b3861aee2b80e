"""Numbers as a drawing has them: four digits, lengths in mm; those of a next step are rounded to the side that helps."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context

DIGITS = 4
FINE = 6  # where a value all but meets its bound
CLOSE = 5e-3  # of the bound
PLAIN = 1e6  # from here on with an exponent
SHOWN = {
    "m": (1e3, "mm"),
    "m rpm": (1e3, "mm rpm"),
    "N/m": (1e-6, "N/µm"),
}  # factor and unit; all others as they are


def number(value: float, digits: int = DIGITS) -> str:
    """Rounded, and without an exponent where it is neither small nor a million."""
    rounded = f"{value + 0.0:.{digits}g}"
    return f"{float(rounded):.{FINE}g}" if abs(float(rounded)) < PLAIN else rounded


def mm(value_m: float) -> str:
    """A length in mm, with its unit."""
    return f"{number(1e3 * value_m)} mm"


def shown(values: Sequence[float | None], unit: str) -> tuple[list[str], str]:
    """Numbers to be compared, in the unit of the field, and that unit; more digits where four hide a difference."""
    factor, name = SHOWN.get(unit, (1.0, unit))
    known = [value for value in values if value is not None]
    close = len(known) > 1 and 0.0 < max(known) - min(known) < CLOSE * abs(max(known))
    return [
        "" if v is None else number(factor * v, FINE if close else DIGITS) for v in values
    ], name


def least(value: float) -> str:
    """Four digits of a number that must be reached: rounded up."""
    return _printed(value, ROUND_CEILING)


def greatest(value: float) -> str:
    """Four digits of a number that must not be passed: rounded down."""
    return _printed(value, ROUND_FLOOR)


def _printed(value: float, rounding: str) -> str:
    return number(float(Context(prec=DIGITS, rounding=rounding).create_decimal(value)))
