"""Planners of one `rig run`, one run each: table and JSON document."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import msgspec

from rig.analysis.summary import Summary
from rig.errors import EXIT_STATUS, REFUSED
from rig.ui.cli.page import Column, PageTable, boxed_table

COLUMNS = ("planner", "planned", "measured", "true", Column("verdict", folds=True))


class NotRun(NamedTuple):
    """A planner without a run, and the reason: it has no plan, or one that exceeds a limit."""

    planner: str
    reason: str


Result = Summary | NotRun


def exit_code(results: Sequence[Result]) -> int:
    """Highest exit code of the runs; that of a refusal when no planner could run."""
    codes = [result.exit_code for result in results if isinstance(result, Summary)]
    return max(codes, default=REFUSED)


def document(results: Sequence[Result]) -> dict[str, Any]:
    """Create the JSON document of several planners."""
    return {"runs": [_entry(result) for result in results]}


def _entry(result: Result) -> Any:
    if isinstance(result, Summary):
        return msgspec.to_builtins(result)
    return {
        "planner": result.planner,
        "exit_status": EXIT_STATUS[REFUSED],
        "exit_code": REFUSED,
        "verdict": "bad",
        "reasons": [result.reason],
    }


def comparison(results: Sequence[Result]) -> PageTable:
    """Create the table of the residual swing by planner."""
    table = boxed_table("residual swing [mrad] by planner", COLUMNS)
    table.columns[-1].justify = "left"
    for result in results:
        if isinstance(result, NotRun):
            table.add_row(result.planner, "-", "-", "-", f"not run: {result.reason}")
        else:
            table.add_row(result.planner, *_swings(result), result.verdict)
    return table


def _swings(summary: Summary) -> list[str]:
    """Format planned, measured and true residual swing [mrad]."""
    true_rad = summary.truth.residual_swing_rad if summary.truth else None
    values_rad = (
        summary.planned.residual_swing_rad,
        summary.measured.residual_swing_rad,
        true_rad,
    )
    return ["-" if value is None else f"{value * 1e3:.3f}" for value in values_rad]
