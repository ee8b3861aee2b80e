"""ISO classes of lead accuracy (source 004, fig. C.8; ISO 3408-3)."""

from __future__ import annotations

from typing import NamedTuple

from planners.errors import PlanError


class LeadClass(NamedTuple):
    """Deviations of the lead that a class allows at 20 degrees C."""

    per_300_mm_m: float  # V_300p: band of the deviation over any 300 mm
    # rows of the table: greatest useful travel [m], and deviation e_p over it [m]
    travel: tuple[tuple[float, float], ...] = ()


LEAD_CLASSES = {
    "ISO 1": LeadClass(6e-6, ((0.315, 6e-6), (0.4, 7e-6), (0.5, 8e-6))),
    "ISO 3": LeadClass(12e-6, ((0.315, 12e-6), (0.4, 13e-6), (0.5, 15e-6))),
    "ISO 5": LeadClass(23e-6, ((0.315, 23e-6), (0.4, 25e-6), (0.5, 27e-6))),
    "ISO 7": LeadClass(52e-6),  # beyond the source's table; general knowledge of ISO 3408-3
    "ISO 10": LeadClass(210e-6),  # likewise
}
TABULATED = tuple(name for name, row in LEAD_CLASSES.items() if row.travel)


def lead_class(name: str) -> LeadClass:
    """Return the class of that name. Raises PlanError for an unknown one."""
    if name not in LEAD_CLASSES:
        raise PlanError(
            f"lead_class = {name!r}; must be one of {', '.join(LEAD_CLASSES)}, from fine to "
            "coarse: take the next finer one"
        )
    return LEAD_CLASSES[name]


def travel_deviation_m(name: str, travel_m: float) -> float | None:
    """Look up the deviation e_p of a class over a useful travel.

    None where the table has no row. Raises PlanError for an unknown class.
    """
    for greatest_travel_m, deviation_m in lead_class(name).travel:
        if travel_m <= greatest_travel_m:
            return deviation_m
    return None
