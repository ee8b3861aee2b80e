"""Numbers as text with four digits, and in the units of a drawing (mm, mm rpm, N/µm)."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context

DIGITS = 4
FINE_DIGITS = 6  # of values that are close to each other
CLOSE_REL = 5e-3  # difference of close values, over the largest
EXPONENT_FROM = 1e6  # numbers from here on are printed with an exponent
FIELD_UNITS = {  # SI unit: factor and unit of the text; all others are unchanged
    "m": (1e3, "mm"),
    "m rpm": (1e3, "mm rpm"),
    "N/m": (1e-6, "N/µm"),
}


def number(value: float, digits: int = DIGITS) -> str:
    """Round a number; an exponent only for small ones and from a million on."""
    rounded = f"{value + 0.0:.{digits}g}"
    if abs(float(rounded)) < EXPONENT_FROM:
        return f"{float(rounded):.{FINE_DIGITS}g}"
    return rounded


def mm(value_m: float) -> str:
    """Format a length in mm, with its unit."""
    return f"{number(1e3 * value_m)} mm"


def shown(values: Sequence[float | None], unit: str) -> tuple[list[str], str]:
    """Format numbers that are compared with each other; returns the texts and their unit.

    Six digits where four hide a difference. The text of None is empty.
    """
    factor, name = FIELD_UNITS.get(unit, (1.0, unit))
    known = [value for value in values if value is not None]
    close = len(known) > 1 and 0.0 < max(known) - min(known) < CLOSE_REL * abs(max(known))
    digits = FINE_DIGITS if close else DIGITS
    texts = ["" if value is None else number(factor * value, digits) for value in values]
    return texts, name


def rounded_up(value: float) -> str:
    """Round a lower bound up to four digits, so that the text keeps the bound."""
    return _round(value, ROUND_CEILING)


def rounded_down(value: float) -> str:
    """Round an upper bound down to four digits, so that the text keeps the bound."""
    return _round(value, ROUND_FLOOR)


def _round(value: float, rounding: str) -> str:
    return number(float(Context(prec=DIGITS, rounding=rounding).create_decimal(value)))
