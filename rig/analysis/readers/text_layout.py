"""Layout of a text table: delimiter, decimal mark, header and first line of the numbers.

Every pair of delimiter and decimal mark splits the first lines; the pair that makes most of
them rows of numbers of one length is taken.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from rig.analysis.readers.text_header import TextHeader, read_header

POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.I)
COMMA = re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.I)
POINT_THOUSANDS = re.compile(r"[+-]?\d{1,3}(,\d{3})+\.\d+")
COMMA_THOUSANDS = re.compile(r"[+-]?\d{1,3}(\.\d{3})+,\d+")
CLOCK = re.compile(r"(\d{4}-\d\d-\d\d[ T])?\d{1,2}:\d\d:\d\d([.,]\d+)?(Z|[+-]\d\d:?\d\d)?")
WHITESPACE = ""
DELIMITERS = ("\t", ";", ",", "|", WHITESPACE)
NAMES = {"\t": "tab", ";": "semicolon", ",": "comma", "|": "|", WHITESPACE: "spaces"}
MIN_ROWS = 3
AHEAD = 5  # rows after the first one that must look alike
ALIKE_SHARE = 0.6
TABLE_SHARE = 0.5  # rows of one length in a table with text columns
COMMENTS = "#%!"


class CellKind(NamedTuple):
    """Counts of the kinds of cells in a line."""

    cells: int
    numbers: int
    empty: int
    clocks: int

    @property
    def is_row(self) -> bool:
        """All cells are numbers, times of day or empty, and one of them is a number."""
        return self.numbers > 0 and self.numbers + self.empty + self.clocks == self.cells


@dataclass(frozen=True)
class NumberFormat:
    """Delimiter and decimal mark."""

    delimiter: str  # "" for spaces, or for a single column
    decimal: str

    def split(self, line: str) -> list[str]:
        """Split a line into cells without quotes and outer spaces."""
        if self.delimiter == WHITESPACE:
            return [cell.strip('"') for cell in line.split()]
        if '"' not in line:
            return [cell.strip() for cell in line.split(self.delimiter)]
        rows = list(csv.reader([line], delimiter=self.delimiter, skipinitialspace=True))
        return [cell.strip() for cell in rows[0]] if rows else []

    def is_number(self, cell: str) -> bool:
        """Tell if a cell is a number with this decimal mark."""
        if self.decimal == ",":
            return bool(COMMA.fullmatch(cell) or COMMA_THOUSANDS.fullmatch(cell))
        return bool(POINT.fullmatch(cell) or POINT_THOUSANDS.fullmatch(cell))

    def kind(self, cells: Sequence[str]) -> CellKind:
        """Count the kinds of the cells of a line."""
        numbers = sum(1 for cell in cells if self.is_number(cell))
        empty = sum(1 for cell in cells if not cell)
        clocks = sum(1 for cell in cells if CLOCK.fullmatch(cell))
        return CellKind(len(cells), numbers, empty, clocks)

    def number(self, cell: str) -> float:
        """Convert a cell; raises ValueError for one that is no number."""
        try:
            return float(_without_underscores(cell).replace(self.decimal, "."))
        except ValueError:
            if not self.has_thousands(cell.strip()):
                raise
        mark = "." if self.decimal == "," else ","
        return float(cell.replace(mark, "").replace(self.decimal, "."))

    def has_thousands(self, cell: str) -> bool:
        """Tell if a cell is a number with marks between the thousands."""
        pattern = COMMA_THOUSANDS if self.decimal == "," else POINT_THOUSANDS
        return pattern.fullmatch(cell) is not None


def _without_underscores(cell: str) -> str:
    """Return a cell unchanged; raises ValueError for "1_000", a number in Python alone."""
    if "_" in cell:
        raise ValueError(f"'{cell}' is no number")
    return cell


@dataclass(frozen=True)
class TextLayout:
    """Place and form of the numbers in a text."""

    form: NumberFormat
    columns: int
    header: TextHeader
    first_line: int  # of the numbers, from 0
    clocks: frozenset[int]  # columns that hold times of day
    texts: frozenset[int]  # columns that hold no numbers
    is_ending_empty: bool  # lines end in a delimiter
    has_thousands: bool

    @property
    def words(self) -> str:
        """Account of the layout for the user."""
        mark = ", decimal comma" if self.form.decimal == "," else ""
        delimiter = NAMES[self.form.delimiter] if self.columns > 1 else "one column"
        return f"{delimiter}{mark}, numbers from line {self.first_line + 1}"


def find_layout(lines: Sequence[str]) -> TextLayout | None:
    """Find the layout of a text from its first lines; None where there is no table."""
    form = _best_form(lines)
    if form is None:
        return None
    rows = [form.split(line) for line in lines]
    columns, is_clean = _usual_length(form, lines, rows)
    first = _first_row(form, lines, rows, columns, is_clean)
    if first is None:
        return None
    body = [row for row in rows[first:] if len(row) == columns]
    ends = [row[-1] == "" for row in body]
    is_ending_empty = columns > 1 and all(ends)
    columns -= int(is_ending_empty)
    return TextLayout(
        form=form,
        columns=columns,
        header=read_header(lines[:first], form.delimiter, columns, is_ending_empty),
        first_line=first,
        clocks=_columns_of(body, columns, lambda cell: bool(CLOCK.fullmatch(cell))),
        texts=_columns_of(body, columns, lambda cell: not _is_any_number(form, cell)),
        is_ending_empty=is_ending_empty,
        has_thousands=any(form.has_thousands(cell) for row in body for cell in row),
    )


def _is_any_number(form: NumberFormat, cell: str) -> bool:
    return not cell or form.is_number(cell) or bool(CLOCK.fullmatch(cell))


def _columns_of(
    body: Sequence[Sequence[str]], columns: int, test: Callable[[str], bool]
) -> frozenset[int]:
    """Find the columns of which most filled cells pass a test."""
    found = set()
    for column in range(columns):
        cells = [row[column] for row in body if row[column]]
        passed = sum(1 for cell in cells if test(cell))
        if passed > len(cells) / 2:
            found.add(column)
    return frozenset(found)


def _best_form(lines: Sequence[str]) -> NumberFormat | None:
    """Choose delimiter and decimal mark; None where no pair makes a table."""
    scores = []
    for order, form in enumerate(_forms(lines)):
        rows = [form.split(line) for line in lines if line.strip()]
        kinds = [form.kind(row) for row in rows]
        lengths = Counter(kind.cells for kind in kinds if kind.is_row)
        length, clean = lengths.most_common(1)[0] if lengths else (0, 0)
        scores.append((clean, length > 1, -order, form))
    clean, _, _, best = max(scores, key=lambda score: score[:3])
    if clean >= MIN_ROWS:
        return _without_ambiguity(best, lines)
    return _form_with_texts(lines)


def _forms(lines: Sequence[str]) -> list[NumberFormat]:
    """List the pairs to try; commas are both only where quotes keep them apart."""
    has_quotes = any('"' in line for line in lines)
    forms = [NumberFormat(delimiter, mark) for mark in (".", ",") for delimiter in DELIMITERS]
    return [form for form in forms if form.delimiter != form.decimal or has_quotes]


def _without_ambiguity(form: NumberFormat, lines: Sequence[str]) -> NumberFormat:
    """Decide if "1,25" is two cells or one number: by a header, by zeros, by the first cells."""
    if form != NumberFormat(",", "."):
        return form
    rows = [form.split(line) for line in lines if line.strip()]
    pairs = [row for row in rows if len(row) == 2 and form.kind(row).numbers == 2]
    others = [row for row in rows if form.kind(row).numbers == 0]
    is_pair = len(pairs) >= MIN_ROWS and all(_is_decimal(*pair) for pair in pairs)
    has_pair_header = bool(others) and len(others[-1]) == 2
    if not is_pair or has_pair_header:
        return form
    first = [int(whole) for whole, _ in pairs]
    is_counting = all(b > a for a, b in pairwise(first))
    has_leading_zero = any(len(part) > 1 and part[0] == "0" for _, part in pairs)
    if is_counting and not has_leading_zero:
        return form
    return NumberFormat(WHITESPACE, ",")


def _is_decimal(whole: str, part: str) -> bool:
    """Tell if two cells may be the halves of a decimal number."""
    digits = re.fullmatch(r"\d+([eE][+-]?\d+)?", part)
    return digits is not None and re.fullmatch(r"[+-]?\d+", whole) is not None


def _form_with_texts(lines: Sequence[str]) -> NumberFormat | None:
    """Choose the pair for a table with columns of text; None where most lines differ."""
    best: tuple[int, int, NumberFormat] | None = None
    for order, form in enumerate(_forms(lines)):
        kinds = [form.kind(form.split(line)) for line in lines if line.strip()]
        lengths = Counter(kind.cells for kind in kinds if kind.numbers and kind.cells > 1)
        count = lengths.most_common(1)[0][1] if lengths else 0
        enough = max(MIN_ROWS, TABLE_SHARE * len(kinds))
        if count >= enough and (best is None or (count, -order) > best[:2]):
            best = (count, -order, form)
    return best[2] if best else None


def _usual_length(
    form: NumberFormat, lines: Sequence[str], rows: Sequence[Sequence[str]]
) -> tuple[int, bool]:
    """Find the usual number of cells of a row, and if rows hold numbers alone."""
    kinds = [form.kind(row) for row in rows]
    clean = Counter(kind.cells for kind in kinds if kind.is_row)
    if clean and clean.most_common(1)[0][1] >= MIN_ROWS:
        return clean.most_common(1)[0][0], True
    mixed = Counter(kind.cells for kind in kinds if kind.numbers)
    return mixed.most_common(1)[0][0], False


def _first_row(
    form: NumberFormat,
    lines: Sequence[str],
    rows: Sequence[Sequence[str]],
    columns: int,
    is_clean: bool,
) -> int | None:
    """Find the first row of the table: the rows after it look like it."""
    fits = []
    filled = []
    for index, row in enumerate(rows):
        if not lines[index].strip():
            continue
        kind = form.kind(row)
        is_good = kind.is_row if is_clean else kind.numbers > 0
        filled.append(index)
        fits.append(is_good and kind.cells == columns)
    for k, index in enumerate(filled):
        ahead = fits[k + 1 : k + 1 + AHEAD]
        if fits[k] and sum(ahead) >= ALIKE_SHARE * len(ahead):
            return index
    return None
