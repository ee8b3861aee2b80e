"""`rig compare`: comparison of our figures with the published tables of source 004."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from comms.clock import stopwatch_s
from planners.errors import unknown_name
from rig.errors import BAD_DATA, ConfigError
from rig.studies.thesis_tables import table as tables
from rig.studies.thesis_tables.published import TABLES
from rig.studies.thesis_tables.table import RowComparison, tolerance
from rig.ui.cli import compare_free_cart, compare_tables
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json, working
from rig.ui.cli.page import print_whole, print_written
from rig.ui.plots.picture_file import check_folder

CHOICES = (*TABLES, "all", "sensitivity", "free_cart")


def compare(
    table: Annotated[
        str,
        typer.Argument(
            help="Table 3.1 to 3.8 or 4.1 to 4.7, several separated by commas; 3, 4 or all; "
            "sensitivity; or free_cart.",
        ),
    ],
    csv_file: Annotated[
        Path | None,
        typer.Option("--csv", help="CSV file, one line a figure; of free_cart a sample."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Figure file of sensitivity (sensitivity.svg by default) or free_cart."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Compare published figures with ours: in the definitions of the source, and exact.

    Exit code 6 when a figure differs that should agree, or agrees that should differ.
    """
    if table == "sensitivity":
        return _sensitivity(plot, csv_file, as_json)
    if table == "free_cart":
        return compare_free_cart.run(plot, csv_file, as_json)
    if plot is not None:
        raise ConfigError(
            f"--plot {plot} with table {table}; must be with sensitivity or free_cart: omit it"
        )
    names = _tables(table)
    if csv_file is not None:
        check_folder("--csv", csv_file)
    seconds = tables.planning_time(stopwatch_s)
    every: list[RowComparison] = []
    for name in names:
        quiet = not as_json or len(names) == 1
        with working(f"table {name}: planning every row", quiet=quiet):
            comparisons = tables.compare_table(name, seconds)
        every += comparisons
        if not as_json:
            compare_tables.print_table(name, comparisons)
    if csv_file is not None:
        _write_csv(every, csv_file)
    if as_json:
        print_json({"rows": [_document(comparison) for comparison in every]})
    else:
        compare_tables.print_summary(every)
        print_written(csv_file)
    return 0 if all(comparison.as_expected for comparison in every) else BAD_DATA


def _tables(text: str) -> tuple[str, ...]:
    """Split a comma list of tables; `3` and `4` are all of a chapter. Raises PlanError."""
    names: list[str] = []
    for word in (part.strip() for part in text.split(",")):
        chapter = [name for name in TABLES if word == "all" or name.startswith(f"{word}.")]
        if word not in TABLES and not chapter:
            raise unknown_name("table", word, CHOICES)
        names += chapter or [word]
    return tuple(dict.fromkeys(names))


def _sensitivity(plot: Path | None, csv_file: Path | None, as_json: bool) -> int:
    if csv_file is not None:
        raise ConfigError(f"--csv {csv_file} with sensitivity; must be with a table: use --json")
    from rig.studies.thesis_tables.curves import sensitivity_document
    from rig.ui.plots import picture_file  # matplotlib is slow to import
    from rig.ui.plots.sensitivity import draw

    path = plot
    if path is None and not as_json:
        path = Path("sensitivity.svg")
    if path is not None:
        picture_file.check(path)
    with working("sensitivity curves of every plan, linear and nonlinear load: about 10 s"):
        document = sensitivity_document()
        if path is not None:
            draw(document, path)
    if as_json:
        print_json(document)
    else:
        print_whole(f"{len(document)} curves drawn into {path}")
    return 0


def _document(c: RowComparison) -> dict[str, object]:
    row = c.row
    return {
        "table": row.table,
        "technique": row.technique,
        "load": "two bars" if row.bars else "pendulum",
        "planner": row.method,
        "input": row.input,
        "robust": row.robust,
        "time_s": row.time_s,
        "verdict": row.verdict,
        "as_expected": c.as_expected,
        "reason": c.reason,
        "sampling": c.sampling,
        "refused": c.refused,
        "published_compute_s": row.compute_s,
        "compute_s": c.compute_s,
        "figures": {column: _entry(c, column) for column in row.columns},
    }


def _entry(c: RowComparison, column: str) -> dict[str, float | bool | None]:
    return {
        "published": c.row.published.get(column),
        "ours": c.ours.get(column),
        "exact": c.exact.get(column),
        "relative_error": c.errors.get(column),
        "tolerance": tolerance(column),
        "differs": column in c.off,
    }


def _write_csv(every: Iterable[RowComparison], path: Path) -> None:
    head = (
        "table",
        "technique",
        "planner",
        "input",
        "robust",
        "time_s",
        "verdict",
        "published_compute_s",
        "compute_s",
    )
    figure = ("published", "ours", "exact", "relative_error", "tolerance", "differs")
    with path.open("w", newline="") as file:
        lines = csv.writer(file)
        lines.writerow([*head, "column", *figure, "reason", "sampling"])
        for c in every:
            document = _document(c)
            for column in c.row.columns:
                entry = _entry(c, column)
                values = [
                    *(document[key] for key in head),
                    column,
                    *(entry[key] for key in figure),
                    c.reason,
                    c.sampling,
                ]
                lines.writerow(["" if value is None else value for value in values])
