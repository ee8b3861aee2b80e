"""Table of a sheet of an Excel workbook."""

from __future__ import annotations

import csv
import io
import struct
import zipfile
import zlib
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import replace
from datetime import datetime, time
from pathlib import Path
from typing import Any

from rig.analysis.readers.errors import UnreadableData, list_names, missing_extra
from rig.analysis.readers.signal_record import ReadOptions
from rig.analysis.readers.table import SignalTable
from rig.analysis.readers.text_file import text_table
from rig.errors import ConfigError

KIND = "Excel workbook"
DELIMITER = "\t"
HEAD = 1 << 16
DAMAGE = (
    ValueError,
    TypeError,
    LookupError,
    AttributeError,
    AssertionError,
    ArithmeticError,
    OSError,
    EOFError,
    SyntaxError,  # of XML
    RuntimeError,
    MemoryError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
)


def read_xlsx(path: Path, options: ReadOptions) -> SignalTable:
    """Read a sheet of an .xlsx workbook; raises UnreadableData and ConfigError."""
    try:
        import openpyxl
    except ImportError:
        raise missing_extra(path, f"{KIND} (.xlsx)", "openpyxl") from None
    try:
        with closing(openpyxl.load_workbook(path, read_only=True, data_only=True)) as book:
            sheets = {sheet.title: sheet for sheet in book.worksheets}
            tables = {}
            for name in _wanted(path, list(sheets), options):
                tables[name] = list(sheets[name].iter_rows(values_only=True))
    except DAMAGE as error:
        raise _damaged(path, error) from error
    return _first_table(path, tables)


def read_xls(path: Path, options: ReadOptions) -> SignalTable:
    """Read a sheet of an .xls workbook; raises UnreadableData and ConfigError."""
    try:
        import xlrd
    except ImportError:
        raise missing_extra(path, f"{KIND} (.xls)", "xlrd") from None
    try:
        book = xlrd.open_workbook(path, logfile=io.StringIO())
    except (xlrd.XLRDError, xlrd.compdoc.CompDocError, *DAMAGE) as error:
        raise _damaged(path, error) from error
    tables = {}
    for name in _wanted(path, book.sheet_names(), options):
        sheet = book.sheet_by_name(name)
        tables[name] = [sheet.row_values(row) for row in range(sheet.nrows)]
    return _first_table(path, tables)


def _damaged(path: Path, error: BaseException) -> UnreadableData:
    return UnreadableData(
        f"{path}: {KIND} that cannot be read ({error}): damaged or protected, export it as CSV"
    )


def _wanted(path: Path, names: Sequence[str], options: ReadOptions) -> Sequence[str]:
    """List the sheets to try: the one named by the topic, or all."""
    if not options.topic:
        return names
    if options.topic not in names:
        raise ConfigError(
            f"{path}: --topic {options.topic}: no such sheet; sheets found: {list_names(names)}: "
            f"try --topic '{names[0]}'"
        )
    return [options.topic]


def _first_table(path: Path, tables: dict[str, list[Sequence[Any]]]) -> SignalTable:
    """Read the first sheet that holds a table of numbers."""
    reason = "it has no sheet"
    for name, rows in tables.items():
        data = _as_text(rows).encode()
        try:
            return _sheet_table(path, name, data)
        except UnreadableData as error:
            reason = str(error)
    raise UnreadableData(
        f"{path}: {KIND} without a table of numbers; sheets found: {list_names(list(tables))} "
        f"({reason})"
    )


def _sheet_table(path: Path, name: str, data: bytes) -> SignalTable:
    """Read the text of a sheet; its lines are the rows of the sheet."""
    where = f"{path}, sheet '{name}'"
    table = text_table(where, io.BytesIO(data), data[:HEAD], f"{KIND}, sheet '{name}'")
    place = table.layout.rpartition(", ")[2].replace("line", "row")
    return replace(table, layout=place)


def _as_text(rows: Iterable[Sequence[Any]]) -> str:
    """Write the cells as a text table, with all digits of the numbers."""
    stream = io.StringIO()
    writer = csv.writer(stream, delimiter=DELIMITER, lineterminator="\n")
    for row in rows:
        writer.writerow([_cell(value) for value in row])
    return stream.getvalue()


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, datetime | time):
        return value.isoformat(" ") if isinstance(value, datetime) else value.isoformat()
    return str(value)
