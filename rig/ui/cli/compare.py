"""`rig compare`: the published tables of source 004 beside our own figures, and its sensitivity curves."""

from __future__ import annotations

import csv
import os
import shutil
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from comms.clock import stopwatch_s
from planners.errors import unknown_name
from rig.errors import BAD_DATA, ConfigError
from rig.studies.thesis_tables import table as tables
from rig.studies.thesis_tables.published import METHODS, TABLES
from rig.studies.thesis_tables.table import RowComparison, tolerance
from rig.ui.cli.output import out, print_json, working
from rig.ui.plots.picture_file import check_folder

CHOICES = (*TABLES, "all", "sensitivity")
WIDTH = 140  # characters of a line in a file: a table of two bars needs 134
SHOWN_AS_ZERO_RAD = 1e-12  # rad: a residual below it is rounding, shown as 0
STYLE = {"reproduced": "green", "partly": "yellow", "false": "red", "no entry": "dim"}
UNITS = {"_rad": ("mrad", 1e3), "_m_s2": ("m/s²", 1.0), "_m_s": ("m/s", 1.0), "_m": ("m", 1.0)}
WORDS = {  # of a technique as printed
    "acc": "commands acceleration",
    "forza": "commands force",
    "jerk": "commands the jerk model",
    "rob": "forgives a wrong length",
}
LEGEND = (
    "published: as printed. ours: in the source's definitions: signed maxima; θ res over as long again after the move; speed "
    "RMS over [0, 2T], hence 1/√2 of the move's; acceleration RMS unweighted over the technique's own nodes (DF: 201; bvp5c: "
    "2000 even points, in ours of the exact solution; Shooting: ode45's). Where a row is measured otherwise, a note says so.",
    "exact: the same problem solved exactly: absolute maxima, RMS over the move, amplitude of the swing left.",
    "≠: ours and published differ by more than 0.05 % (θ res: 2 %). reproduced: every figure agrees. partly: those marked do "
    "not, for the reason given. false: the source's figures are not the stated problem's. no entry: the source prints a dash.",
    "planned in: published, a whole MATLAB run on a computer not named; ours, one plan here, warm.",
)


def compare(
    table: Annotated[
        str,
        typer.Argument(
            help="3.1 to 3.8, 4.1 to 4.7, several with commas; 3, 4 or all; or sensitivity."
        ),
    ],
    csv_file: Annotated[
        Path | None, typer.Option("--csv", help="Write one line for each figure.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="With sensitivity: the file to draw into; default sensitivity.svg."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
) -> int:
    """Show published figures, ours in the source's definitions and exactly, and both computation times.

    Exit 6 when a figure differs that should not, or the other way round.
    """
    if table == "sensitivity":
        return _sensitivity(plot, csv_file, as_json)
    if plot is not None:
        raise ConfigError(
            f"--plot {plot} with table {table}; must be with sensitivity: leave it out"
        )
    names = _tables(table)
    if csv_file is not None:
        check_folder("--csv", csv_file)
    seconds, every = tables.planning_time(stopwatch_s), list[RowComparison]()
    for name in names:
        with working(f"table {name}: planning every row", quiet=not as_json or len(names) == 1):
            comparisons = tables.compare_table(name, seconds)
        every += comparisons
        if not as_json:
            _print(name, comparisons)
    if csv_file is not None:
        _write_csv(every, csv_file)
    if as_json:
        print_json({"rows": [_document(comparison) for comparison in every]})
    else:
        _page().print("\n".join(LEGEND), style="dim")
        _page().print(_summary(every))
    return 0 if all(comparison.as_expected for comparison in every) else BAD_DATA


def _tables(text: str) -> tuple[str, ...]:
    """Names of tables with commas; `3` and `4` are all of a chapter."""
    names: list[str] = []
    for word in (part.strip() for part in text.split(",")):
        chapter = [name for name in TABLES if word == "all" or name.startswith(f"{word}.")]
        if word not in TABLES and not chapter:
            raise unknown_name("table", word, CHOICES)
        names += chapter or [word]
    return tuple(dict.fromkeys(names))


def _sensitivity(plot: Path | None, csv_file: Path | None, as_json: bool) -> int:
    if csv_file is not None:
        raise ConfigError(f"--csv {csv_file} with sensitivity; must be with a table: take --json")
    from rig.studies.thesis_tables.curves import sensitivity_document
    from rig.ui.plots import picture_file  # matplotlib takes its time, and no table needs it
    from rig.ui.plots.sensitivity import draw

    path = None if as_json and plot is None else plot or Path("sensitivity.svg")
    if path is not None:
        picture_file.check(path)
    with working("curves of every plan, on the linear and on the true load: about 10 s"):
        document = sensitivity_document()
        if path is not None:
            draw(document, path)
    if as_json:
        print_json(document)
    else:
        out.print(f"{len(document)} curves drawn into {path}")
    return 0


def _print(name: str, comparisons: Sequence[RowComparison]) -> None:
    page, notes = _page(), dict[str, int]()
    labels = [_label(c, notes) for c in comparisons]
    load = "two bars" if comparisons[0].row.bars else "pendulum"
    page.print(f"Table {name}: {load}, 0.2 m from rest to rest", style="italic")
    page.print(_glossary(comparisons), style="dim")
    wide = _wide(comparisons, labels)
    if (
        Measurement.get(Console(width=WIDTH), page.options.update(width=WIDTH), wide).maximum
        <= page.width
    ):
        page.print(wide)
    else:
        for c, label in zip(comparisons, labels, strict=True):
            page.print(_upright(c, label))
    for reason, number in notes.items():
        page.print(f"({number}) {reason}")
    for c in comparisons:
        if not c.as_expected:
            found, named = (", ".join(columns) or "nothing" for columns in (c.off, c.row.off))
            page.print(
                f"{c.row.technique} in {c.row.time_s:g} s: {found} differs, not {named} {c.refused}".rstrip(),
                style="bold red",
            )
    page.print()


def _page() -> Console:
    """As wide as the terminal or COLUMNS says; a file takes the widest table."""
    known = sys.stdout.isatty() or "COLUMNS" in os.environ
    return Console(
        width=shutil.get_terminal_size().columns if known else WIDTH, highlight=False, markup=False
    )


def _glossary(comparisons: Sequence[RowComparison]) -> str:
    """The source's words for its techniques in ours; a planner that is spelled alike is left out."""
    words = dict.fromkeys(word for c in comparisons for word in c.row.technique.split())
    meant = {word: WORDS.get(word.lower()) or f"planner {METHODS[word]}" for word in words}
    return "; ".join(f"{word} = {ours}" for word, ours in meant.items())


def _label(c: RowComparison, notes: dict[str, int]) -> Text:
    """The verdict and the numbers of its notes, which are given out in order."""
    numbers = [notes.setdefault(why, len(notes) + 1) for why in (c.reason, c.sampling) if why]
    note = f" ({','.join(map(str, numbers))})" if numbers else ""
    return Text(f"{c.row.verdict}{note}", STYLE[c.row.verdict])


def _wide(comparisons: Sequence[RowComparison], labels: Sequence[Text]) -> Table:
    """Three lines a row, a column for each figure."""
    view = Table(padding=(0, 1, 0, 0), box=None)
    for header in ("technique", "T [s]", ""):
        view.add_column(header, no_wrap=True)
    for header in (*map(_header, comparisons[0].row.columns), "planned in"):
        view.add_column(header, justify="right", no_wrap=True)
    for c, label in zip(comparisons, labels, strict=True):
        published, ours, exact = zip(
            *map(_three, [c] * len(c.row.columns), c.row.columns), strict=True
        )
        view.add_row(
            c.row.technique, f"{c.row.time_s:g}", "published", *published, _time(c.row.compute_s)
        )
        view.add_row(label, "", "ours", *ours, _time(c.compute_s))
        view.add_row("", "", "exact", *exact, end_section=True)
    return view


def _upright(c: RowComparison, label: Text) -> Table:
    """A line for each figure: one row of a table that is wider than the terminal."""
    title = Text(f"{c.row.technique}, T = {c.row.time_s:g} s: ") + label
    view = Table(title=title, title_justify="left", title_style="", padding=(0, 1, 0, 0), box=None)
    view.add_column("", no_wrap=True)
    for header in ("published", "ours", "exact"):
        view.add_column(header, justify="right", no_wrap=True)
    for column in c.row.columns:
        view.add_row(_header(column).replace("\n", " "), *_three(c, column))
    view.add_row("planned in", _time(c.row.compute_s), _time(c.compute_s), "")
    return view


def _three(c: RowComparison, column: str) -> tuple[Text, Text, Text]:
    """Published, ours, exact."""
    return (
        _figure(column, c.row.published.get(column)),
        _figure(column, c.ours.get(column), differs=column in c.off),
        _figure(column, c.exact.get(column)),
    )


def _header(column: str) -> str:
    symbol, what = column.split("_")[:2]
    unit, _ = _unit(column)
    return f"{symbol.replace('theta', 'θ')} {what}\n[{unit}]"


def _unit(column: str) -> tuple[str, float]:
    return next(unit for ending, unit in UNITS.items() if column.endswith(ending))


def _figure(column: str, value: float | None, *, differs: bool = False) -> Text:
    if value is None:
        return Text("-", "dim")
    scaled = (
        0.0 if "_res_" in column and abs(value) < SHOWN_AS_ZERO_RAD else value * _unit(column)[1]
    )
    return Text(f"{scaled:.5g}{'≠' if differs else ' '}", "yellow" if differs else "")


def _time(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    value, unit = (seconds, "s") if seconds >= 1.0 else (seconds * 1e3, "ms")
    return f"{value:.3g} {unit}" if value < 1e3 else f"{value:.0f} {unit}"


def _summary(every: Sequence[RowComparison]) -> str:
    verdicts = Counter(str(c.row.verdict) for c in every)
    counts = ", ".join(f"{verdicts[verdict]} {verdict}" for verdict in STYLE if verdicts[verdict])
    refused = sum(bool(c.refused) for c in every)
    dashes = (
        f"; {refused} of the dashes are moves too short for their shaper, which ours refuses too"
        if refused
        else ""
    )
    alike = f": {verdicts['reproduced'] + refused} rows come out as printed" if refused else ""
    return f"{len(every)} rows: {counts}{dashes}{alike}"


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
