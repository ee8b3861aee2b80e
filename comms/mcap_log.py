"""One MCAP file a run: JSON messages with their schemas, readable by any MCAP tool, and by us when cut short."""

from __future__ import annotations

import struct
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import msgspec
import zstandard
from mcap.exceptions import InvalidMagic, McapError
from mcap.records import Attachment, Channel, Chunk, DataEnd, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, IndexType, Writer

from comms.errors import LogError
from comms.records import CompressedImage

CHUNK_BYTES = 256 * 1024
DATA_END_BYTES = 13  # the record that carries the checksum of all before it
DAMAGE = (
    McapError,
    ValueError,
    EOFError,
    OverflowError,
    MemoryError,
    KeyError,
    struct.error,
    zstandard.ZstdError,
)
SCHEMA_NAMES: dict[type, str] = {CompressedImage: "foxglove.CompressedImage"}


class LogWriter:
    """Writes the log; start metadata is on disk before the first message."""

    def __init__(self, path: Path, start: dict[str, str]) -> None:
        self._stream: BinaryIO = path.open("wb")
        index = (
            IndexType.ATTACHMENT | IndexType.CHUNK | IndexType.METADATA
        )  # a message index costs more than our messages
        self._writer = Writer(
            self._stream, CHUNK_BYTES, CompressionType.ZSTD, index, enable_data_crcs=True
        )
        self._writer.start(profile="swayless", library="swayless")
        self._channels: dict[str, int] = {}
        self._schemas: dict[type, int] = {}
        self._encode = msgspec.json.Encoder().encode
        self.metadata("run.start", start)

    def write(
        self, topic: str, record: msgspec.Struct, publish_ns: int, log_ns: int, seq: int = 0
    ) -> None:
        """Append one message: publish_ns = the sender's stamp, log_ns = the recorder's."""
        channel = self._channels.get(topic) or self._register(topic, type(record))
        self._writer.add_message(channel, log_ns, self._encode(record), publish_ns, seq)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """A file that travels inside the log."""
        self._writer.add_attachment(0, 0, name, media_type, data)

    def metadata(self, name: str, values: dict[str, str]) -> None:
        """A named string map, on disk at once."""
        self._writer.add_metadata(name, values)
        self.flush()

    def flush(self) -> None:
        """What was written survives a kill from here on."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._stream.flush()

    def close(self, stop: dict[str, str]) -> None:
        """Stop metadata last: a file without it is a crashed run."""
        self.flush()
        self._writer.add_metadata("run.stop", stop)
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.close()

    def _register(self, topic: str, kind: type) -> int:
        if kind not in self._schemas:
            name = SCHEMA_NAMES.get(kind, f"swayless.{kind.__name__}")
            self._schemas[kind] = self._writer.register_schema(
                name, "jsonschema", json_schema(kind)
            )
        self._channels[topic] = self._writer.register_channel(topic, "json", self._schemas[kind])
        return self._channels[topic]


def json_schema(kind: type) -> bytes:
    """JSON Schema of a message type, its own object on top (some viewers follow no reference there)."""
    _, components = msgspec.json.schema_components([kind])
    top = components.pop(kind.__name__)
    return msgspec.json.encode(top | ({"$defs": components} if components else {})).replace(
        b"#/components/schemas/", b"#/$defs/"
    )


class Entry(NamedTuple):
    """One logged message, undecoded."""

    log_ns: int
    publish_ns: int
    data: bytes


class Log(NamedTuple):
    """A whole log in memory, in file order. complete: run.stop was found and nothing was damaged."""

    path: Path
    topics: dict[str, list[Entry]]
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    complete: bool
    damage: str

    def read(self, topic: str, kind: type[Any]) -> list[Any]:
        """Messages of a topic, decoded; [] when there is none."""
        decode = msgspec.json.Decoder(kind).decode
        return [decode(entry.data) for entry in self.topics.get(topic, [])]


def read_log(path: Path) -> Log:
    """Read a log; one that was cut short or damaged gives what is left of it, and says so.

    Raises LogError when the file is missing or is not a log at all.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; name a run folder or its run.mcap") from error
    log = Log(path, {}, {}, {}, False, "")
    damage = _read_records(data, log)
    if "run.start" not in log.metadata:
        raise LogError(
            f"{path}: an MCAP file without 'run.start': not a run of ours, or cut before it began"
        )
    complete = not damage and "run.stop" in log.metadata
    return log._replace(
        complete=complete, damage=damage or ("" if complete else "ends before 'run.stop'")
    )


def _read_records(data: bytes, log: Log) -> str:
    topics: dict[int, list[Entry]] = {}
    stream, damage = BytesIO(data), ""
    records = StreamReader(stream, emit_chunks=True, record_size_limit=1 << 28).records
    try:
        for record in records:
            if isinstance(record, Chunk):
                damage = _read_chunk(record, log, topics) or damage
            elif isinstance(record, Metadata):
                log.metadata[record.name] = dict(record.metadata)
            elif isinstance(record, Attachment):
                log.attachments[record.name] = record.data
            elif isinstance(record, DataEnd):
                damage = damage or _checksum_damage(
                    record, memoryview(data)[: stream.tell() - DATA_END_BYTES]
                )
                break
        for (
            record
        ) in records:  # the summary names the channels again, should their chunk be damaged
            if damage and isinstance(record, Channel):
                _name(record, log, topics)
    except InvalidMagic as error:
        if not log.metadata:
            raise LogError(
                f"{log.path}: not an MCAP file (wrong first bytes); name a run folder or its run.mcap"
            ) from error
        damage = "cut short"
    except DAMAGE as error:
        damage = f"cut short ({type(error).__name__})"
    return damage


def _checksum_damage(end: DataEnd, data: memoryview) -> str:
    good = end.data_section_crc in (0, zlib.crc32(data))  # 0: its writer kept none
    return "" if good else "bytes are not those that were written (checksum of the data)"


def _read_chunk(chunk: Chunk, log: Log, topics: dict[int, list[Entry]]) -> str:
    try:
        records = breakup_chunk(chunk, validate_crc=True)
    except DAMAGE as error:
        return f"a damaged chunk was left out ({type(error).__name__})"
    for record in records:
        if isinstance(record, Message):
            topics.setdefault(record.channel_id, []).append(
                Entry(record.log_time, record.publish_time, record.data)
            )
        elif isinstance(record, Channel):
            _name(record, log, topics)
    return ""


def _name(channel: Channel, log: Log, topics: dict[int, list[Entry]]) -> None:
    topics[channel.id] = log.topics.setdefault(channel.topic, topics.get(channel.id, []))
