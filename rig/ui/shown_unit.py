"""Units in which signals are shown: those that are easily read."""

from __future__ import annotations

_SHOWN = {"rad": ("mrad", 1e3), "m": ("mm", 1e3), "V": ("mV", 1e3), "none": ("", 1.0)}


def shown_unit(unit: str) -> tuple[str, float]:
    """Choose the name of the shown unit, and the factor on values in the given one."""
    return _SHOWN.get(unit, (unit, 1.0))
