"""Rows of the uncertainty of a run, for the terminal and the report."""

from __future__ import annotations

from rig.analysis.summary import QUANTITIES, Quantity, Summary

SIGNIFICANT = 2
BUDGET_HEADS = (
    "standard deviation by",
    "peak [mrad]",
    "residual [mrad]",
    "frequency [Hz]",
    "damping ratio",
    "length [m]",
)


def budget_rows(summary: Summary) -> list[tuple[str, ...]]:
    """List the terms of the uncertainty, and the whole; [] of a run without measured values."""
    if not any(getattr(summary.sigma, one.key) for one in QUANTITIES):
        return []
    rows = [
        (term.term, *(_cell(one, getattr(term, one.key)) for one in QUANTITIES))
        for term in summary.budget
    ]
    whole = (_cell(one, getattr(summary.sigma, one.key)) for one in QUANTITIES)
    return [*rows, ("whole", *whole)]


def _cell(quantity: Quantity, value: float | None) -> str:
    return f"{value * quantity.factor:.{SIGNIFICANT}g}" if value else ""
