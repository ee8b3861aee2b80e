"""The page on the terminal: its consoles, paragraphs that fold, and tables that drop columns.

A page is as wide as the terminal, or as COLUMNS says; into a file it has FILE_WIDTH columns.
No text steers the terminal: the consoles remove control characters from all they print.
"""

from __future__ import annotations

import os
import re
import shlex
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console, ConsoleDimensions, ConsoleOptions, JustifyMethod, RenderableType
from rich.measure import Measurement
from rich.segment import Segment
from rich.table import Table

from rig.errors import OK
from rig.ui.text import without_controls

FILE_WIDTH = 140  # columns of a line in a file; the widest table needs 134
PLAIN: Any = {"title_justify": "left", "box": None, "padding": (0, 2, 0, 0), "pad_edge": False}
BOXED: Any = {"title_justify": "left"}
COMMAND_INDENT = " " * 4
UNBROKEN = {"N m": "N\N{NO-BREAK SPACE}m"}  # words that stay on one line


class PageConsole(Console):
    """Console of a page; it ends with exit code 0 when its reader closes the pipe, e.g. `| head`.

    Text folds between words. soft_wrap=True leaves a line whole, to be copied.
    """

    @property  # type: ignore[misc]  # rich sets a size too, we do not
    def size(self) -> ConsoleDimensions:
        """Columns and lines of the page."""
        size = super().size
        if self.is_terminal or "COLUMNS" in os.environ:
            return size
        return ConsoleDimensions(FILE_WIDTH, size.height)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterator[Segment]:
        """Render, without control characters in any text."""
        for segment in super().render(renderable, options):
            if segment.control:  # of rich itself, e.g. to redraw a progress bar
                yield segment
            else:
                yield Segment(without_controls(segment.text), segment.style)

    def on_broken_pipe(self) -> None:
        """End the process with exit code 0."""
        try:
            super().on_broken_pipe()
        except SystemExit:
            raise SystemExit(OK) from None


out = PageConsole(highlight=False, markup=False, emoji=False)
err = PageConsole(stderr=True, highlight=False, markup=False, emoji=False)


class Column(NamedTuple):
    """A column of a table.

    header: name and unit, perhaps in several lines. drop: place in the order in which columns are
    dropped on a narrow page, 1 = first; 0 = never. folds: its cells may take several lines.
    """

    header: str
    drop: int = 0
    folds: bool = False


class PageTable(Table):
    """Table that knows in which order its columns may be dropped."""

    drop_order: Sequence[str] = ()  # headers


def plain_table(title: str, columns: Iterable[str | Column], left: int = 1) -> PageTable:
    """Create a table without lines; the first `left` columns are text, the others numbers."""
    return _page_table(PageTable(title=title, **PLAIN), columns, left)


def boxed_table(title: str, columns: Iterable[str | Column], left: int = 1) -> PageTable:
    """Create a table with lines; the first `left` columns are text, the others numbers."""
    return _page_table(PageTable(title=title, **BOXED), columns, left)


def _page_table(view: PageTable, columns: Iterable[str | Column], left: int) -> PageTable:
    described = [Column(column) if isinstance(column, str) else column for column in columns]
    most_breaks = max(column.header.count("\n") for column in described)
    droppable: list[tuple[int, str]] = []
    for k, column in enumerate(described):
        missing = most_breaks - column.header.count("\n")
        header = "\n" * missing + column.header  # the last lines share one row
        justify: JustifyMethod = "left" if k < left else "right"
        view.add_column(header, justify=justify, no_wrap=not column.folds, overflow="fold")
        if column.drop:
            droppable.append((column.drop, header))
    view.drop_order = [header for _, header in sorted(droppable)]
    return view


def print_table(view: Table) -> None:
    """Print a table; drop columns in their order until it fits the page, and say which.

    What does not fit even then is wider than the page, not cut: no digit is lost.
    """
    dropped: list[str] = []
    order = view.drop_order if isinstance(view, PageTable) else ()
    shown = view
    for header in order:
        if is_fitting(shown):
            break
        dropped.append(header)
        shown = _without(view, dropped)
    if not is_fitting(shown):
        shown.width = _least_width(shown)
    out.print(shown, crop=False)
    if dropped:
        names = "; ".join(_name(header) for header in dropped)
        print_paragraph(
            f"dropped for {out.width} columns, in this order: {names}. "
            "A wider terminal or --json shows them.",
            "dim",
        )


def is_fitting(view: Table) -> bool:
    """Tell whether a table fits the page without folding or cutting a cell that must not."""
    return _least_width(view) <= out.width


def _least_width(view: Table) -> int:
    """Width of a table [columns] whose folding cells have a line for each word."""
    options = out.options.update(width=10 * FILE_WIDTH)
    width = Measurement.get(out, options, view).maximum
    for column in view.columns:
        if column.no_wrap:
            continue
        needs = [Measurement.get(out, options, text) for text in (column.header, *column.cells)]
        widest_line = max(need.maximum for need in needs)
        longest_word = max(need.minimum for need in needs)
        width -= widest_line - longest_word
    return width


def _without(view: Table, headers: Sequence[str]) -> Table:
    """Copy a table without some columns."""
    narrow = Table(
        title=view.title, title_justify="left", box=view.box, padding=view.padding,
        pad_edge=view.pad_edge,
    )  # fmt: skip
    kept = [column for column in view.columns if column.header not in headers]
    for column in kept:
        narrow.add_column(
            column.header,
            justify=column.justify,
            vertical=column.vertical,
            no_wrap=column.no_wrap,
            overflow=column.overflow,
        )
    cells = [list(column.cells) for column in kept]
    for row, texts in zip(view.rows, zip(*cells, strict=True), strict=True):
        narrow.add_row(*texts, style=row.style, end_section=row.end_section)
    return narrow


def _name(header: str) -> str:
    """Name of a column in one line, without its unit."""
    return re.sub(r" ?\[[^]]*\](, ratio)?", "", " ".join(header.split()))


def print_paragraph(text: str, style: str = "", indent: str = "") -> None:
    """Print a paragraph, folded between words; `indent` starts its further lines."""
    unbroken = text
    for words, replacement in UNBROKEN.items():
        unbroken = unbroken.replace(words, replacement)
    lines = textwrap.wrap(
        unbroken,
        out.width,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    folded = "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")
    out.print(folded, style=style, soft_wrap=True)


def print_command(label: str, command: str) -> None:
    """Print a command below its label; a long one continues after a backslash, to be copied."""
    words = [shlex.quote(word).replace(" ", "\N{NO-BREAK SPACE}") for word in shlex.split(command)]
    lines = textwrap.wrap(
        " ".join(words),
        out.width - len(" \\"),
        initial_indent=COMMAND_INDENT,
        subsequent_indent=COMMAND_INDENT + "  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    folded = " \\\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")
    out.print(f"{label}\n{folded}", soft_wrap=True)


def print_whole(text: str, style: str = "") -> None:
    """Print a line that one may copy, a command or a path: it is not folded."""
    out.print(text, style=style, soft_wrap=True)


def print_written(*paths: Path | None) -> None:
    """Name the files that a verb has written; None is a file that was not asked for."""
    for path in paths:
        if path is not None:
            print_whole(f"written: {path}")
