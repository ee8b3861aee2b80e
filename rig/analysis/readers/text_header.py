"""Header of a text table: names and units of its columns, and what the lines above it say."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from rig.analysis.readers.table import Hint
from rig.analysis.readers.units import split_header, time_factor, unit_factor

DELIMITERS = ("\t", ";", ",", "|")
GAP = re.compile(r"\t|\s{2,}")
NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
RATE_KEY = r"(?:sampl\w*|scan|data|abtast\w*|acquisition)[\s_-]*(?:rate|freq\w*)|abtastrate|\bfs\b"
PERIOD_KEY = (
    r"(?:sampl\w*|scan|abtast)[\s_-]*(?:period|interval|time|intervall)|delta[\s_]?[xt]\b|\bdt\b"
)
VALUE = r"[\s:=;,\t\"()\[\]]*(?:in\s*)?(?P<before>k?Hz|ms|us|s|sec)?[\s:=;,\t\"()\[\]]*"
VALUE += r"(?P<value>\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)\s*(?P<after>k?Hz|ms|us|s|sec)?\b"
RATE = re.compile(rf"({RATE_KEY}){VALUE}", re.I)
PERIOD = re.compile(rf"({PERIOD_KEY}){VALUE}", re.I)
RATE_NAME = re.compile(RATE_KEY, re.I)
PERIOD_NAME = re.compile(PERIOD_KEY, re.I)
FACTORS = {"khz": 1e3, "ms": 1e-3, "us": 1e-6}
UNIT_KEY = re.compile(r"unit|einheit", re.I)
NO_UNITS = {"", "-", "1", "none", "%", "[]", "()"}


class TextHeader(NamedTuple):
    """Names of the columns and the lines above them."""

    names: tuple[str, ...]  # (k,) with their units; () without a header
    preamble: tuple[str, ...]


class NamedRate(NamedTuple):
    """Sampling rate that a file names, and where."""

    rate_hz: float
    source: str


def read_header(
    lines: Sequence[str], delimiter: str, columns: int, is_ending_empty: bool = False
) -> TextHeader:
    """Read the lines above the numbers: names of the columns, maybe with a line of units.

    is_ending_empty: the last column is empty and left out, though it may have a name.
    """
    filled = [line.strip("\r\n") for line in lines if line.strip()]
    if not filled:
        return TextHeader((), ())
    last = _cells(filled[-1], delimiter, columns, is_ending_empty)
    if last is None:
        return TextHeader((), tuple(filled))
    above = _cells(filled[-2], delimiter, columns, is_ending_empty) if len(filled) > 1 else None
    if above is not None and _are_units(last):
        names = [_join(name, unit) for name, unit in zip(above, last, strict=True)]
        return TextHeader(tuple(names), tuple(filled[:-2]))
    return TextHeader(tuple(last), tuple(filled[:-1]))


def _cells(line: str, delimiter: str, columns: int, may_be_longer: bool) -> list[str] | None:
    """Split a line into names; None where it has another number of cells or numbers alone."""
    line = line.strip().lstrip("#%").strip() if columns == 1 or delimiter == "" else line
    if columns == 1:
        is_value = _are_numbers(re.split(r"[\s;,\t]+", line)) or named_rate([line]) is not None
        return None if is_value else [line.strip('"')]
    for cells in _ways_to_split(line, delimiter):
        is_spare = may_be_longer or cells[-1].lower() in ("", "comment")
        is_long = len(cells) == columns + 1 and is_spare
        if len(cells) == columns or is_long:
            named = [cell.strip().strip('"').lstrip("#% ") for cell in cells[:columns]]
            return None if _are_numbers(named) else named
    return None


def _ways_to_split(line: str, delimiter: str) -> list[list[str]]:
    marks = [mark for mark in (delimiter, *DELIMITERS) if mark]
    ways = [next(csv.reader([line], delimiter=m, skipinitialspace=True)) for m in marks]
    return [*ways, GAP.split(line.strip()), line.split()]


def _are_numbers(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell.strip()]
    return all(NUMBER.fullmatch(cell.strip()) for cell in filled)


def _bare(cell: str) -> str:
    return cell.strip().strip("()[]{}<>").strip()


def _are_units(cells: Sequence[str]) -> bool:
    """Tell if a line holds units alone."""
    bare = [_bare(cell) for cell in cells]
    known = [unit_factor(cell) is not None or time_factor(cell) is not None for cell in bare]
    neutral = [cell.lower() in NO_UNITS for cell in bare]
    return any(known) and all(k or n for k, n in zip(known, neutral, strict=True))


def _join(name: str, unit: str) -> str:
    bare = _bare(unit)
    return f"{name.strip()} [{bare}]" if bare.lower() not in NO_UNITS else name.strip()


def named_rate(preamble: Sequence[str]) -> NamedRate | None:
    """Find the sampling rate in the lines above the numbers; None without one."""
    for line in preamble:
        for pattern, is_period in ((RATE, False), (PERIOD, True)):
            match = pattern.search(line)
            if match:
                unit = match["after"] or match["before"] or ""
                return _rate(match["value"], unit, is_period, match[1])
    for names, values in pairwise(preamble):
        found = _rate_of_pair(names, values)
        if found is not None:
            return found
    return None


def _rate(value: str, unit: str, is_period: bool, name: str) -> NamedRate | None:
    number = float(value.replace(",", ".")) * FACTORS.get(unit.lower(), 1.0)
    if number <= 0:
        return None
    return NamedRate(1 / number if is_period else number, f"'{name.strip()}' above the numbers")


def _rate_of_pair(names: str, values: str) -> NamedRate | None:
    """Find the rate in a line of names over a line of values."""
    for mark in DELIMITERS:
        keys = [key.strip() for key in names.split(mark)]
        cells = [cell.strip() for cell in values.split(mark)]
        if len(keys) != len(cells) or len(keys) == 1:
            continue
        for key, cell in zip(keys, cells, strict=True):
            is_period = PERIOD_NAME.search(key) is not None
            is_named = is_period or RATE_NAME.search(key) is not None
            if is_named and NUMBER.fullmatch(cell):
                return _rate(cell, split_header(key).unit, is_period, key)
    return None


def unit_hint(preamble: Sequence[str]) -> Hint | None:
    """Find the one unit that the lines above the numbers name; None for none or several."""
    found: dict[str, Hint] = {}
    for line in preamble:
        key = ""
        for piece in re.split(r"[\t;,|:=]+", line):
            piece = piece.strip().strip('"')
            unit = split_header(piece).unit
            is_clear = len(unit) > 1 or UNIT_KEY.search(key) is not None
            if is_clear and unit_factor(unit) is not None:
                found.setdefault(unit, Hint(unit, f"'{piece}' above the numbers"))
            key = piece
    hints = list(found.values())
    return hints[0] if len(hints) == 1 else None
