"""Scan of a truncated or damaged MCAP file: every intact record of it, and counts of what is lost.

The scan reads record after record. Where the frame of a record is damaged, it continues at the next
intact chunk, which it finds by the name of its compression. Of a chunk that was cut at the end of
the file, the messages before the cut are kept.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import NamedTuple

import msgspec
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk

from comms.mcap_log import DAMAGE_ERRORS

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")  # opcode, length of the content
CHUNK_HEAD = struct.Struct("<QQQI")  # first and last log time, uncompressed size, checksum
COMPRESSION_NAMES = (b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4")
PARSED = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.METADATA: Metadata.read,
}


class Recovery(msgspec.Struct, kw_only=True):
    """Counts of a recovery; everything that was not kept is in one of the last four."""

    messages: int = 0
    channels: int = 0
    attachments: int = 0
    metadata: int = 0
    damaged_chunks: int = 0
    damaged_attachments: int = 0
    unreadable_bytes: int = 0
    messages_without_channel: int = 0

    @property
    def is_whole(self) -> bool:
        """True where nothing had to be left out."""
        return not (
            self.damaged_chunks
            or self.damaged_attachments
            or self.unreadable_bytes
            or self.messages_without_channel
        )


class LogContent(NamedTuple):
    """Records found in a damaged file."""

    header: list[Header]
    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    messages: list[Message]
    attachments: list[Attachment]
    metadata: list[Metadata]


def scan(data: bytes, found: Recovery) -> LogContent:
    """Collect the intact records of an MCAP file; found takes the counts of the rest."""
    content = LogContent([], {}, {}, [], [], [])
    start = len(MAGIC) if data.startswith(MAGIC) else 0
    for opcode, body, is_cut in _records(data, start, found):
        if opcode == Opcode.CHUNK:
            _keep_chunk(body, is_cut, content, found)
        elif opcode == Opcode.ATTACHMENT:
            _keep_attachment(body, content, found)
        elif opcode in PARSED:
            _keep(PARSED[Opcode(opcode)](ReadDataStream(BytesIO(body))), content)
        elif opcode == Opcode.MESSAGE:
            _keep(Message.read(ReadDataStream(BytesIO(body)), len(body)), content)
    return content


def _records(data: bytes, at: int, found: Recovery) -> Iterator[tuple[int, bytes, bool]]:
    """Opcode and content of each record, and whether the end of the file cut it."""
    while at + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        begin = at + RECORD_HEAD.size
        body = data[begin : begin + length]
        if _is_plausible(opcode, length, body):
            yield opcode, body, len(body) < length
            at = begin + length
        else:
            after = _next_chunk(data, at + 1)
            found.unreadable_bytes += after - at
            at = after
    if data[at:] != MAGIC:
        found.unreadable_bytes += max(0, len(data) - at)


def _is_plausible(opcode: int, length: int, body: bytes) -> bool:
    """Tell whether these bytes can be a record; only the last chunk of a file may be cut."""
    if opcode == Opcode.CHUNK:
        return _is_chunk(length, body)
    if not 1 <= opcode <= Opcode.DATA_END or len(body) < length:
        return False
    if opcode not in PARSED:
        return True
    try:
        PARSED[Opcode(opcode)](ReadDataStream(BytesIO(body)))
    except (*DAMAGE_ERRORS, UnicodeDecodeError):
        return False
    return True


def _is_chunk(length: int, body: bytes) -> bool:
    """Tell whether the two lengths in a chunk's head agree."""
    name = _compression_name(body)
    if name is None or len(body) < CHUNK_HEAD.size + len(name) + 8:
        return False
    head = CHUNK_HEAD.size + len(name) + 8
    (records,) = struct.unpack_from("<Q", body, head - 8)
    return bool(length == head + records)


def _compression_name(body: bytes) -> bytes | None:
    at = CHUNK_HEAD.size
    for name in (*COMPRESSION_NAMES, b"\x00\x00\x00\x00"):
        if body.startswith(name, at):
            return name
    return None


def _next_chunk(data: bytes, at: int) -> int:
    """Position of the next record that looks like a compressed chunk, else the end of the data."""
    head = RECORD_HEAD.size + CHUNK_HEAD.size
    places = [len(data)]
    for name in COMPRESSION_NAMES:
        found = data.find(name, at + head)
        while found >= 0 and data[found - head] != Opcode.CHUNK:
            found = data.find(name, found + 1)
        if found >= 0:
            places.append(found - head)
    return min(places)


def _keep_chunk(body: bytes, is_cut: bool, content: LogContent, found: Recovery) -> None:
    try:
        if is_cut:
            records = _records_before_cut(body)
            found.damaged_chunks += 1
        else:
            records = breakup_chunk(Chunk.read(ReadDataStream(BytesIO(body))), validate_crc=True)
    except DAMAGE_ERRORS:
        found.damaged_chunks += 1
        return
    for record in records:
        _keep(record, content)


def _records_before_cut(body: bytes) -> list[McapRecord]:
    """Records of a chunk whose end is missing; only zstd gives the bytes before the cut."""
    name = _compression_name(body)
    if name != COMPRESSION_NAMES[0]:
        return []
    stream = zstandard.ZstdDecompressor().decompressobj()
    whole = stream.decompress(body[CHUNK_HEAD.size + len(name) + 8 :])
    records: list[McapRecord] = []
    at = 0
    while at + RECORD_HEAD.size <= len(whole):
        opcode, length = RECORD_HEAD.unpack_from(whole, at)
        content = whole[at + RECORD_HEAD.size : at + RECORD_HEAD.size + length]
        if len(content) < length:
            break
        reader = ReadDataStream(BytesIO(content))
        if opcode == Opcode.MESSAGE:
            records.append(Message.read(reader, length))
        elif opcode in PARSED:
            records.append(PARSED[Opcode(opcode)](reader))
        at += RECORD_HEAD.size + length
    return records


def _keep_attachment(body: bytes, content: LogContent, found: Recovery) -> None:
    try:
        attachment = Attachment.read(ReadDataStream(BytesIO(body)))
    except (*DAMAGE_ERRORS, UnicodeDecodeError):
        found.damaged_attachments += 1
        return
    (checksum,) = struct.unpack("<I", body[-4:])
    if checksum and zlib.crc32(body[:-4]) != checksum:
        found.damaged_attachments += 1
        return
    content.attachments.append(attachment)


def _keep(record: McapRecord, content: LogContent) -> None:
    if isinstance(record, Message):
        content.messages.append(record)
    elif isinstance(record, Schema):
        content.schemas[record.id] = record
    elif isinstance(record, Channel):
        content.channels[record.id] = record
    elif isinstance(record, Metadata):
        content.metadata.append(record)
    elif isinstance(record, Header):
        content.header.append(record)
