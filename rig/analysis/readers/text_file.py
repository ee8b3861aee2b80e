"""Table of a text file of any delimiter, decimal mark and encoding."""

from __future__ import annotations

import codecs
import csv
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from rig.analysis.readers.errors import UnreadableData, counted
from rig.analysis.readers.file_kind import HEAD_BYTES
from rig.analysis.readers.signal_record import ReadFinding
from rig.analysis.readers.table import SignalColumn, SignalTable
from rig.analysis.readers.text_header import named_rate, unit_hint
from rig.analysis.readers.text_layout import TextLayout, find_layout
from rig.analysis.readers.text_numbers import TextNumbers, read_numbers

BLOCK_BYTES = 1 << 18  # one with a bad cell goes the slow way
WIDE = {"utf-16-le": codecs.BOM_UTF16_LE, "utf-16-be": codecs.BOM_UTF16_BE}
SAMPLE_LINES = 400
SHOWN_CHARACTERS = 60
SHOWN_ROWS = 5


def read_text(path: Path, head: bytes) -> SignalTable:
    """Read a text file; head: its first bytes. Raises UnreadableData without a table in it."""
    with path.open("rb") as stream:
        return text_table(path, stream, head, "text")


def text_table(name: object, stream: BinaryIO, head: bytes, kind: str) -> SignalTable:
    """Read a text from its start; name: for messages, head: its first bytes."""
    encoding = _encoding(name, head)
    lines = _sample(head, encoding)
    layout = find_layout(lines)
    if layout is None:
        raise UnreadableData(_no_table(name, lines))
    blocks = _skip_lines(_blocks(stream, encoding), layout.first_line)
    is_wide = encoding in WIDE
    try:
        numbers = read_numbers(blocks, layout, "utf-8" if is_wide else encoding)
    except csv.Error as error:
        raise UnreadableData(f"{name}: damaged text ({error}); export the data again") from error
    return _table(layout, numbers, kind, lines)


def _table(layout: TextLayout, numbers: TextNumbers, kind: str, lines: list[str]) -> SignalTable:
    names = layout.header.names or ("",) * layout.columns
    columns = []
    for index, values in enumerate(numbers.columns):
        is_clock = index in layout.clocks  # converted to seconds
        columns.append(SignalColumn(names[index], values, is_time=is_clock))
    rate = named_rate(layout.header.preamble)
    is_labview = lines[0].startswith("LabVIEW Measurement")
    return SignalTable(
        kind="LabVIEW measurement (.lvm)" if is_labview else kind,
        columns=columns,
        layout=layout.words,
        rate_hz=rate.rate_hz if rate else None,
        rate_source=rate.source if rate else "",
        unit_hint=unit_hint(layout.header.preamble),
        bad_cells=numbers.bad_cells,
        findings=_ragged(numbers.ragged_rows, layout.columns),
    )


def _ragged(rows: list[int], columns: int) -> list[ReadFinding]:
    if not rows:
        return []
    shown = tuple(rows[:SHOWN_ROWS])
    text = (
        f"{counted(len(rows), 'row')} with another number of cells than {columns}, "
        f"the first: row {rows[0]}"
    )
    return [ReadFinding("ragged_rows", text, len(rows), shown)]


def _encoding(name: object, head: bytes) -> str:
    """Tell the encoding by the byte order mark, the zero bytes, or a trial."""
    if head.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    for encoding, mark in WIDE.items():
        if head.startswith(mark):
            return encoding
    if b"\0" in head:
        return _wide_encoding(name, head)
    try:
        head[: len(head) - 4].decode("utf-8")  # the last character may be cut
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def _wide_encoding(name: object, head: bytes) -> str:
    """Tell the byte order of UTF-16 without a mark; raises UnreadableData for no text."""
    half = len(head) // 2
    even = head[0::2].count(0)
    odd = head[1::2].count(0)
    if odd > 0.9 * half and even < 0.1 * half:
        return "utf-16-le"
    if even > 0.9 * half and odd < 0.1 * half:
        return "utf-16-be"
    raise UnreadableData(
        f"{name}: binary data of an unknown kind; must be text, .lvm, .mat, .xls, .xlsx, phyphox, "
        "MCAP, or a CAN trace (ASC, BLF, TRC, candump): export it as one of these"
    )


def _sample(head: bytes, encoding: str) -> list[str]:
    """Decode the first lines; a line that may be cut is left out."""
    text = head.decode(encoding, errors="replace").lstrip("\ufeff")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if len(head) >= HEAD_BYTES and "\n" in text:
        text = text.rpartition("\n")[0]
    return text.split("\n")[:SAMPLE_LINES]


def _blocks(stream: BinaryIO, encoding: str) -> Iterator[bytes]:
    """Read blocks of whole lines that end in a line feed, without a byte order mark."""
    rest = b""
    is_first = True
    is_old_mac = False
    for data in _narrow(stream, encoding):
        if is_first:
            data = data.removeprefix(codecs.BOM_UTF8)
            is_old_mac = b"\n" not in data
            is_first = False
        if is_old_mac:
            data = data.replace(b"\r", b"\n")
        whole, line_end, rest_of_data = data.rpartition(b"\n")
        if line_end:
            yield rest + whole + line_end
            rest = rest_of_data
        else:
            rest += data
    if rest.strip():
        yield rest.rstrip() + b"\n"


def _narrow(stream: BinaryIO, encoding: str) -> Iterator[bytes]:
    """Read pieces of a file; UTF-16 becomes UTF-8."""
    decoder = codecs.getincrementaldecoder(encoding)("replace") if encoding in WIDE else None
    while data := stream.read(BLOCK_BYTES):
        yield data if decoder is None else decoder.decode(data).encode("utf-8")


def _skip_lines(blocks: Iterator[bytes], count: int) -> Iterator[bytes]:
    """Leave out the first lines."""
    for block in blocks:
        while count and block:
            _, _, block = block.partition(b"\n")
            count -= 1
        if block:
            yield block


def _no_table(name: object, lines: list[str]) -> str:
    first = next((line.strip() for line in lines if line.strip()), "")
    return (
        f"{name}: no table of numbers found; the first line is '{first[:SHOWN_CHARACTERS]}': "
        "must be at least 3 rows of numbers of one length: export the data as text or CSV"
    )
