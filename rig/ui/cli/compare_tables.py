"""Tables of `rig compare`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from rig.studies.thesis_tables.published import METHODS
from rig.studies.thesis_tables.table import RowComparison
from rig.ui.cli import page
from rig.ui.cli.page import is_fitting, out, print_paragraph

SHOWN_AS_ZERO_RAD = 1e-12  # a residual below it is rounding, shown as 0
STYLE = {"reproduced": "green", "partly": "yellow", "false": "red", "no entry": "dim"}
UNITS = {  # ending of a column name: unit shown, scale
    "_rad": ("mrad", 1e3),
    "_m_s2": ("m/s²", 1.0),
    "_m_s": ("m/s", 1.0),
    "_m": ("m", 1.0),
}
TECHNIQUE_WORDS = {  # words of a printed technique: meaning
    "acc": "acceleration input",
    "forza": "force input",
    "jerk": "jerk model",
    "rob": "robust to the length",
}
LEGEND = (
    "published: as printed. ours: in the definitions of the source: signed maxima; θ res over as "
    "long again after the move; speed RMS over [0, 2T], hence 1/√2 of that of the move; "
    "acceleration RMS unweighted over the nodes of the technique (DF: 201; bvp5c: 2000 even "
    "points, in ours of the exact solution; Shooting: those of ode45). Notes name the exceptions.",
    "exact: exact solution of the same problem: absolute maxima, RMS over the move, amplitude of "
    "the residual swing.",
    "≠: ours and published differ by more than 0.05 % (θ res: 2 %). reproduced: no figure differs. "
    "partly: some figures differ, for the reason given. false: the printed figures are not those "
    "of the stated problem. no entry: the source prints a dash.",
    "computing time: published, a whole MATLAB run on a computer not named; ours, one plan on this "
    "machine after the first.",
)


def print_table(name: str, comparisons: Sequence[RowComparison]) -> None:
    """Print one published table; as one block a row where the page is too narrow."""
    notes: dict[str, int] = {}
    labels = [_label(c, notes) for c in comparisons]
    load = "two bars" if comparisons[0].row.bars else "pendulum"
    title = f"Table {name}: {load}, 0.2 m from rest to rest; {_counts(comparisons)}"
    print_paragraph(title, "italic")
    print_paragraph(_glossary(comparisons), "dim")
    table = _wide_table(comparisons, labels)
    if is_fitting(table):
        out.print(table)
    else:
        for c, label in zip(comparisons, labels, strict=True):
            page.print_table(_narrow_table(c, label))
    for reason, number in notes.items():
        print_paragraph(f"({number}) {reason}")
    for c in comparisons:
        if not c.as_expected:
            print_paragraph(_unexpected_line(c), "bold red")
    out.print()


def print_summary(every: Sequence[RowComparison]) -> None:
    """Print the legend and the number of rows by verdict."""
    for line in LEGEND:
        print_paragraph(line, "dim")
    print_paragraph(_summary(every))


def _unexpected_line(c: RowComparison) -> str:
    found = ", ".join(c.off) or "nothing"
    expected = ", ".join(c.row.off) or "nothing"
    line = f"{c.row.technique} in {c.row.time_s:g} s: {found} differs, not {expected} {c.refused}"
    return line.rstrip()


def _glossary(comparisons: Sequence[RowComparison]) -> str:
    """Explain the words in the techniques of a table."""
    words = dict.fromkeys(word for c in comparisons for word in c.row.technique.split())
    meanings = []
    for word in words:
        meaning = TECHNIQUE_WORDS.get(word.lower()) or f"planner {METHODS[word]}"
        meanings.append(f"{word} = {meaning}")
    return "; ".join(meanings)


def _label(c: RowComparison, notes: dict[str, int]) -> Text:
    """Create a label of verdict and note numbers; new notes get the next numbers."""
    reasons = [reason for reason in (c.reason, c.sampling) if reason]
    numbers = [str(notes.setdefault(reason, len(notes) + 1)) for reason in reasons]
    suffix = f" ({','.join(numbers)})" if numbers else ""
    return Text(f"{c.row.verdict}{suffix}", STYLE[c.row.verdict])


def _wide_table(comparisons: Sequence[RowComparison], labels: Sequence[Text]) -> Table:
    """Create a table with three lines a row: published, ours and exact."""
    view = Table(padding=(0, 1, 0, 0), box=None)
    for header in ("technique", "T [s]", ""):
        view.add_column(header, no_wrap=True)
    for header in (*map(_header, comparisons[0].row.columns), "computing\ntime"):
        view.add_column(header, justify="right", no_wrap=True)
    for c, label in zip(comparisons, labels, strict=True):
        figures = [_figures(c, column) for column in c.row.columns]
        published, ours, exact = zip(*figures, strict=True)
        time = f"{c.row.time_s:g}"
        view.add_row(c.row.technique, time, "published", *published, _time(c.row.compute_s))
        view.add_row(label, "", "ours", *ours, _time(c.compute_s))
        view.add_row("", "", "exact", *exact, end_section=True)
    return view


def _narrow_table(c: RowComparison, label: Text) -> Table:
    """Create the table of one row: one line a figure."""
    title = Text(f"{c.row.technique}, T = {c.row.time_s:g} s: ") + label
    view = Table(title=title, title_justify="left", title_style="", padding=(0, 1, 0, 0), box=None)
    view.add_column("", no_wrap=True)
    for header in ("published", "ours", "exact"):
        view.add_column(header, justify="right", no_wrap=True)
    for column in c.row.columns:
        view.add_row(_header(column).replace("\n", " "), *_figures(c, column))
    view.add_row("computing time", _time(c.row.compute_s), _time(c.compute_s), "")
    return view


def _figures(c: RowComparison, column: str) -> tuple[Text, Text, Text]:
    """Format published, our and exact figure of a column."""
    return (
        _figure(column, c.row.published.get(column)),
        _figure(column, c.ours.get(column), differs=column in c.off),
        _figure(column, c.exact.get(column)),
    )


def _header(column: str) -> str:
    symbol, quantity = column.split("_")[:2]
    unit, _ = _unit(column)
    return f"{symbol.replace('theta', 'θ')} {quantity}\n[{unit}]"


def _unit(column: str) -> tuple[str, float]:
    """Look up unit and scale of a column."""
    return next(unit for ending, unit in UNITS.items() if column.endswith(ending))


def _figure(column: str, value: float | None, *, differs: bool = False) -> Text:
    if value is None:
        return Text("-", "dim")
    is_rounding = "_res_" in column and abs(value) < SHOWN_AS_ZERO_RAD
    _, scale = _unit(column)
    shown = 0.0 if is_rounding else value * scale
    if differs:
        return Text(f"{shown:.5g}≠", "yellow")
    return Text(f"{shown:.5g} ", "")


def _time(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    value, unit = (seconds, "s") if seconds >= 1.0 else (seconds * 1e3, "ms")
    return f"{value:.3g} {unit}" if value < 1e3 else f"{value:.0f} {unit}"


def _counts(comparisons: Sequence[RowComparison]) -> str:
    """Count the rows by verdict."""
    verdicts = Counter(str(c.row.verdict) for c in comparisons)
    counts = ", ".join(f"{verdicts[verdict]} {verdict}" for verdict in STYLE if verdicts[verdict])
    return f"{len(comparisons)} rows: {counts}"


def _summary(every: Sequence[RowComparison]) -> str:
    refused = sum(bool(c.refused) for c in every)
    text = _counts(every)
    if refused:
        reproduced = sum(c.row.verdict == "reproduced" for c in every)
        text += (
            f"; {refused} of the dashes are moves too short for their shaper, refused here too: "
            f"{reproduced + refused} rows agree with the source"
        )
    return text
