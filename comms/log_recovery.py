"""Recovery of a truncated or damaged MCAP file: every intact record goes into a new, complete file.

The scan reads record after record. Where the frame of a record is damaged, it continues at the next intact
chunk, which it finds by the name of its compression. Of a chunk that was cut at the end of the file, the messages
before the cut are kept.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import msgspec
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    Header,
    McapRecord,
    Message,
    Metadata,
    Schema,
)
from mcap.stream_reader import breakup_chunk
from mcap.writer import CompressionType, Writer

from comms.errors import LogError
from comms.mcap_log import DAMAGE_ERRORS

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")  # opcode, length of the content
CHUNK_HEAD = struct.Struct("<QQQI")  # first and last log time, uncompressed size, checksum
COMPRESSION_NAMES = (b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4")
MESSAGE_HEAD_BYTES = 22  # channel, sequence, log time, publish time
CHUNK_BYTES = 256 * 1024
METADATA_NAME = "recovery"
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


class _Content(NamedTuple):
    """Records found in a damaged file."""

    header: list[Header]
    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    messages: list[Message]
    attachments: list[Attachment]
    metadata: list[Metadata]


def recover(source: Path, target: Path) -> Recovery:
    """Write the intact records of source to target, a complete MCAP file with indexes, and verify it.

    Works on any MCAP file. target is replaced only after its verification.
    Raises LogError for a file that cannot be read or has no intact record, for a target that is the source, and
    where the written file does not verify; OSError where it cannot be written.
    """
    if target.exists() and source.exists() and target.samefile(source):
        raise LogError(f"{target}: is the damaged file itself; name another file to write")
    try:
        data = source.read_bytes()
    except OSError as error:
        raise LogError(f"{source}: {error.strerror}; name a run folder or its run.mcap") from error
    found = Recovery()
    content = _scan(data, found)
    if not (content.messages or content.metadata or content.attachments):
        raise LogError(
            f"{source}: no intact record of an MCAP file in {len(data)} bytes; nothing to recover"
        )
    draft = target.with_name(f".new-{target.name}")
    try:
        _write(content, found, source, draft)
        _verify(draft, found)
        draft.replace(target)
    finally:
        draft.unlink(missing_ok=True)
    return found


def _scan(data: bytes, found: Recovery) -> _Content:
    content = _Content([], {}, {}, [], [], [])
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
    """Tell whether these bytes can be a record; one that is cut must be the last chunk of the file."""
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


def _keep_chunk(body: bytes, is_cut: bool, content: _Content, found: Recovery) -> None:
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


def _keep_attachment(body: bytes, content: _Content, found: Recovery) -> None:
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


def _keep(record: McapRecord, content: _Content) -> None:
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


def _write(content: _Content, found: Recovery, source: Path, draft: Path) -> None:
    profile = content.header[0].profile if content.header else ""
    with draft.open("wb") as stream:
        writer = Writer(stream, CHUNK_BYTES, CompressionType.ZSTD, enable_data_crcs=True)
        writer.start(profile=profile, library="swayless recover")
        for metadata in content.metadata:
            writer.add_metadata(metadata.name, dict(metadata.metadata))
        for item in content.attachments:
            writer.add_attachment(
                item.create_time, item.log_time, item.name, item.media_type, item.data
            )
        channels = _register(writer, content)
        for message in content.messages:
            channel = channels.get(message.channel_id)
            if channel is None:
                found.messages_without_channel += 1
                continue
            writer.add_message(
                channel, message.log_time, message.data, message.publish_time, message.sequence
            )
            found.messages += 1
        found.channels = len(channels)
        found.attachments = len(content.attachments)
        found.metadata = len(content.metadata)
        counts = {name: str(value) for name, value in msgspec.structs.asdict(found).items()}
        writer.add_metadata(METADATA_NAME, {"source": source.name, **counts})
        writer.finish()  # type: ignore[no-untyped-call]


def _register(writer: Writer, content: _Content) -> dict[int, int]:
    """Register every channel whose schema is known; return the new identifiers."""
    schemas = {0: 0}
    for schema in content.schemas.values():
        schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
    return {
        channel.id: writer.register_channel(
            channel.topic, channel.message_encoding, schemas[channel.schema_id], channel.metadata
        )
        for channel in content.channels.values()
        if channel.schema_id in schemas
    }


def _verify(path: Path, found: Recovery) -> None:
    """Read the written file by its index. Raises LogError where it does not hold what was written."""
    try:
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            messages = sum(1 for _ in reader.iter_messages())
            attachments = sum(1 for _ in reader.iter_attachments())
    except DAMAGE_ERRORS as error:
        raise LogError(
            f"{path}: the recovered file cannot be read ({error}); is the disk full?"
        ) from error
    if (messages, attachments) != (found.messages, found.attachments):
        raise LogError(
            f"{path}: the recovered file has {messages} of {found.messages} messages and "
            f"{attachments} of {found.attachments} attachments; is the disk full?"
        )
