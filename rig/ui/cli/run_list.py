"""`rig run --list`: the shipped experiments, a row each."""

from __future__ import annotations

from collections.abc import Sequence

from rig.run.catalogue import ShippedExperiment, shipped_experiments
from rig.ui.cli.output import print_json
from rig.ui.cli.page import Column, PageTable, plain_table, print_table

COLUMNS = ("experiment", "move\nplanner", Column("purpose", folds=True))


def list_experiments(as_json: bool) -> int:
    """Print the shipped experiments as a table or as one JSON document; returns exit code 0."""
    rows = shipped_experiments()
    if as_json:
        print_json({"exit_status": "ok", "experiments": rows})
    else:
        print_table(_table(rows))
    return 0


def _table(rows: Sequence[ShippedExperiment]) -> PageTable:
    table = plain_table("shipped experiments, run by `rig run NAME`", COLUMNS, left=len(COLUMNS))
    for row in rows:
        lines = [_move(row), row.planner or ""]
        table.add_row(row.name, "\n".join(line for line in lines if line), row.purpose)
    return table


def _move(row: ShippedExperiment) -> str:
    if row.load_angle_deg is not None:
        return f"{row.load_angle_deg:g}° in {row.time_s:g} s"
    if row.distance_m is not None:
        return f"{row.distance_m:g} m in {row.time_s:g} s"
    return "no move"
