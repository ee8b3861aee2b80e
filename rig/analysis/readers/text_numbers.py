"""Numbers of a text table, block by block: a fast way for plain blocks, a careful one for others.

A plain block is one whose cells and delimiters alternate as the layout says; it goes through the
parser of NumPy at once. Any other block goes line by line, and its bad cells are listed.
"""

from __future__ import annotations

import csv
import math
import warnings
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.readers.signal_record import FloatArray
from rig.analysis.readers.table import BadCell
from rig.analysis.readers.text_layout import COMMENTS, WHITESPACE, TextLayout

MAX_BAD_CELLS = 100_000
SPACE, CELL, DELIMITER, LINE_END = 0, 1, 2, 3  # classes of bytes


class TextNumbers(NamedTuple):
    """Numbers of a text; NaN where a cell holds none."""

    columns: list[FloatArray]  # k arrays (N,)
    bad_cells: list[BadCell]
    ragged_rows: list[int]  # rows with another number of cells, from 1


def read_numbers(blocks: Iterable[bytes], layout: TextLayout, encoding: str) -> TextNumbers:
    """Read the numbers of blocks of whole lines."""
    reader = _BlockReader(layout, encoding)
    parts = []
    rows = 0
    for block in blocks:
        part = reader.read(block, rows)
        rows += len(part)
        parts.append(part)
    columns = range(layout.columns)
    joined = [_joined(parts, column) for column in columns]
    return TextNumbers(joined, reader.bad_cells, reader.ragged_rows)


def _joined(parts: Sequence[FloatArray], column: int) -> FloatArray:
    return np.concatenate([part[:, column] for part in parts])


class _BlockReader:
    """Parser of blocks; collects the bad cells and the ragged rows."""

    def __init__(self, layout: TextLayout, encoding: str) -> None:
        self._layout = layout
        self._encoding = encoding
        self._classes = _byte_classes(layout)
        self._pattern = _pattern(layout)
        self._is_plain = not (layout.clocks or layout.texts)
        self.bad_cells: list[BadCell] = []
        self.ragged_rows: list[int] = []

    def read(self, block: bytes, rows_before: int) -> FloatArray:
        """Read a block (rows, k)."""
        numbers = self._read_plain(block) if self._is_plain else None
        if numbers is not None:
            return numbers
        text = block.decode(self._encoding, errors="replace")
        return self._read_lines(text.splitlines(), rows_before)

    def _read_plain(self, block: bytes) -> FloatArray | None:
        """Parse a block at once; None where a line is not as the layout says."""
        if not self._fits(block):
            return None
        cleaned = _to_spaces(block, self._layout)
        count = self._layout.columns
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", DeprecationWarning)
                numbers = np.fromstring(cleaned, dtype=np.float64, sep=" ")
        except (ValueError, DeprecationWarning):
            return None
        lines = block.count(b"\n")
        if numbers.size != lines * count:
            return None
        return numbers.reshape(lines, count)

    def _fits(self, block: bytes) -> bool:
        """Check that cells, delimiters and line ends follow each other in the right order."""
        classes = self._classes[np.frombuffer(block, dtype=np.uint8)]
        starts = classes != SPACE
        starts[1:] &= (classes[1:] != CELL) | (classes[:-1] != CELL)
        events = classes[starts]
        if events.size % self._pattern.size:
            return False
        return bool(np.all(events.reshape(-1, self._pattern.size) == self._pattern))

    def _read_lines(self, lines: Sequence[str], rows_before: int) -> FloatArray:
        rows: list[list[float]] = []
        for cells in self._split(lines):
            row = rows_before + len(rows) + 1
            if len(cells) != self._layout.columns:
                self.ragged_rows.append(row)
            rows.append(self._numbers(cells, row))
        return np.array(rows, dtype=np.float64).reshape(-1, self._layout.columns)

    def _split(self, lines: Sequence[str]) -> Iterator[list[str]]:
        """Split lines into cells; empty lines and comments are left out."""
        form = self._layout.form
        kept = [line for line in lines if line.strip() and line.lstrip()[0] not in COMMENTS]
        if form.delimiter == WHITESPACE:
            split: Iterable[list[str]] = map(form.split, kept)
        else:
            split = csv.reader(kept, delimiter=form.delimiter, skipinitialspace=True)
        is_ending_empty = self._layout.is_ending_empty
        for cells in split:
            if is_ending_empty and len(cells) == self._layout.columns + 1:
                cells = cells[:-1]
            yield cells

    def _numbers(self, cells: Sequence[str], row: int) -> list[float]:
        """Convert the cells of a row to k numbers."""
        numbers = [math.nan] * self._layout.columns
        for column, cell in enumerate(cells[: self._layout.columns]):
            try:
                numbers[column] = self._number(cell, column)
            except ValueError:
                if column not in self._layout.texts:
                    self._report(BadCell(row, column, cell.strip()))
        return numbers

    def _number(self, cell: str, column: int) -> float:
        if column in self._layout.clocks:
            return clock_s(cell.strip())
        return self._layout.form.number(cell)

    def _report(self, cell: BadCell) -> None:
        if len(self.bad_cells) < MAX_BAD_CELLS:
            self.bad_cells.append(cell)


def _byte_classes(layout: TextLayout) -> npt.NDArray[np.uint8]:
    """Make the table (256,) from bytes to their classes."""
    classes = np.full(256, CELL, dtype=np.uint8)
    classes[[ord(" "), ord("\t"), ord("\r"), ord('"')]] = SPACE
    classes[ord("\n")] = LINE_END
    if layout.form.delimiter != WHITESPACE:
        classes[ord(layout.form.delimiter)] = DELIMITER
    return classes


def _pattern(layout: TextLayout) -> npt.NDArray[np.uint8]:
    """Make the sequence of classes of one line."""
    between = [] if layout.form.delimiter == WHITESPACE else [DELIMITER]
    pattern = [CELL, *between] * layout.columns
    if between and not layout.is_ending_empty:
        pattern.pop()
    return np.array([*pattern, LINE_END], dtype=np.uint8)


def _to_spaces(block: bytes, layout: TextLayout) -> bytes:
    """Turn delimiters and quotes into spaces, and the decimal mark into a point."""
    delimiter = layout.form.delimiter.encode()
    source = b'"\r\n' + delimiter
    target = b" " * len(source)
    is_comma = layout.form.decimal == ","
    thousands = b"." if is_comma else b","
    deleted = thousands if layout.has_thousands and delimiter != b"," else b""
    if is_comma:
        source += b","
        target += b"."
    return block.translate(bytes.maketrans(source, target), deleted)


def clock_s(text: str) -> float:
    """Convert "12:03:04.5" or "2024-01-05 12:03:04" to seconds; raises ValueError.

    Seconds of the day, or since 1970 where a date is given.
    """
    text = text.replace(",", ".")
    if "-" in text[:6]:
        when = datetime.fromisoformat(text)
        if when.tzinfo is None:
            when = datetime.fromisoformat(f"{text}+00:00")
        return when.timestamp()
    hours, minutes, seconds = text.removesuffix("Z").split(":")
    return int(hours) * 3600.0 + int(minutes) * 60.0 + float(seconds)
