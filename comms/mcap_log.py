"""Log of a run: one MCAP file of JSON messages with their schemas.

Any MCAP tool can read it; read_log also reads one that is cut short or damaged.
"""

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

from comms import old_log
from comms.codec import VERSION
from comms.errors import LogError
from comms.log_entry import Entry
from comms.records import CompressedImage

CHUNK_BYTES = 256 * 1024
MAX_RECORD_BYTES = 1 << 28
DATA_END_BYTES = 13  # the record with the checksum of all before it
DAMAGE_ERRORS = (
    McapError,
    ValueError,
    EOFError,
    OverflowError,
    MemoryError,
    KeyError,
    struct.error,
    zstandard.ZstdError,
)
EPOCH_KEY = "epoch_ns"  # in run.start: wall-clock time of run time 0
SCHEMA_NAMES: dict[type, str] = {CompressedImage: "foxglove.CompressedImage"}


class LogWriter:
    """Writer of the log; the start metadata is on disk before the first message.

    Every chunk has its message index (12 % of the bytes): common readers need it.
    """

    def __init__(self, path: Path, start: dict[str, str], epoch_ns: int) -> None:
        """epoch_ns: wall-clock time of run time 0 [ns since 1970]; added to every stamp."""
        self._stream: BinaryIO = path.open("wb")
        self._writer = Writer(
            self._stream, CHUNK_BYTES, CompressionType.ZSTD, IndexType.ALL, enable_data_crcs=True
        )
        self._epoch_ns = epoch_ns
        self._writer.start(profile="swayless", library="swayless")
        self._channels: dict[str, int] = {}
        self._schemas: dict[type, int] = {}
        self._encode = msgspec.json.Encoder().encode
        own = {EPOCH_KEY: str(epoch_ns), old_log.VERSION_KEY: str(VERSION)}
        self.metadata("run.start", start | own)

    def write(
        self, topic: str, record: msgspec.Struct, publish_ns: int, log_ns: int, seq: int = 0
    ) -> None:
        """Append a message; publish_ns: time stamp of the sender, log_ns: of the recorder.

        Both are run time. A message that is sent later than it is logged is published when logged.
        """
        channel = self._channels.get(topic) or self._register(topic, type(record))
        logged_ns = self._epoch_ns + log_ns
        published_ns = self._epoch_ns + min(publish_ns, log_ns)
        self._writer.add_message(channel, logged_ns, self._encode(record), published_ns, seq)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file to the log, stamped with run time 0."""
        self._writer.add_attachment(self._epoch_ns, self._epoch_ns, name, media_type, data)

    def metadata(self, name: str, values: dict[str, str]) -> None:
        """Write a named map of strings, and flush it to disk."""
        self._writer.add_metadata(name, values)
        self.flush()

    def flush(self) -> None:
        """Flush to disk; what was written before survives a kill of the process."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._stream.flush()

    def close(self, stop: dict[str, str]) -> None:
        """Write the stop metadata and close the file; a file without them is a crashed run."""
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
    """Create the JSON Schema of a message type, with its object at the top level.

    Some viewers do not resolve a reference there.
    """
    _, components = msgspec.json.schema_components([kind])
    schema = components.pop(kind.__name__)
    if components:
        schema = schema | {"$defs": components}
    return msgspec.json.encode(schema).replace(b"#/components/schemas/", b"#/$defs/")


class Log(NamedTuple):
    """Log in memory, in file order."""

    path: Path
    topics: dict[str, list[Entry]]
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    complete: bool  # run.stop was found and no damage
    damage: str  # "" if complete

    def read(self, topic: str, kind: type[Any]) -> list[Any]:
        """Decode the messages of a topic; [] if there is none."""
        decode = msgspec.json.Decoder(kind).decode
        return [decode(entry.data) for entry in self.topics.get(topic, [])]


def read_log(path: Path) -> Log:
    """Read a log; if it is cut short or damaged, its readable part.

    Raises LogError if the file is missing or not a log.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; name a run folder or its run.mcap") from error
    log = Log(path, {}, {}, {}, False, "")
    damage = _read_records(data, log)
    _subtract_epoch(log)
    if "run.start" not in log.metadata:
        raise LogError(
            f"{path}: MCAP file without 'run.start'; need the log of a run, not cut before its "
            "start: name a run folder or its run.mcap"
        )
    if old_log.VERSION_KEY not in log.metadata["run.start"]:
        old_log.upgrade(log.topics)
    if not damage and "run.stop" not in log.metadata:
        damage = "ends before 'run.stop'"
    return log._replace(complete=not damage, damage=damage)


def _subtract_epoch(log: Log) -> None:
    """Turn wall-clock stamps into run time; logs of older builds have run time already."""
    text = log.metadata.get("run.start", {}).get(EPOCH_KEY, "0")
    epoch_ns = int(text) if text.isdecimal() else 0
    if not epoch_ns:
        return
    for topic, entries in log.topics.items():
        log.topics[topic] = [
            Entry(entry.log_ns - epoch_ns, entry.publish_ns - epoch_ns, entry.data)
            for entry in entries
        ]


def _read_records(data: bytes, log: Log) -> str:
    """Read the records of data into log; return the damage, "" if none."""
    topics: dict[int, list[Entry]] = {}
    stream = BytesIO(data)
    damage = ""
    records = StreamReader(stream, emit_chunks=True, record_size_limit=MAX_RECORD_BYTES).records
    try:
        for record in records:
            if isinstance(record, Chunk):
                damage = _read_chunk(record, log, topics) or damage
            elif isinstance(record, Metadata | Attachment):
                _keep_file(record, log)
            elif isinstance(record, DataEnd):
                section = memoryview(data)[: stream.tell() - DATA_END_BYTES]
                damage = damage or _checksum_damage(record, section)
                break
        # the summary repeats the channels, which a damaged chunk may have lost
        for record in records:
            if damage and isinstance(record, Channel):
                _add_channel(record, log, topics)
    except InvalidMagic as error:
        if not log.metadata:
            raise LogError(
                f"{log.path}: not an MCAP file (wrong first bytes); "
                "name a run folder or its run.mcap"
            ) from error
        damage = "cut short"
    except DAMAGE_ERRORS as error:
        damage = f"cut short ({type(error).__name__})"
    return damage


def _keep_file(record: Metadata | Attachment, log: Log) -> None:
    if isinstance(record, Metadata):
        log.metadata[record.name] = dict(record.metadata)
    else:
        log.attachments[record.name] = record.data


def _checksum_damage(end: DataEnd, data: memoryview) -> str:
    good = end.data_section_crc in (0, zlib.crc32(data))  # 0: written without a checksum
    return "" if good else "data changed after writing (wrong checksum)"


def _read_chunk(chunk: Chunk, log: Log, topics: dict[int, list[Entry]]) -> str:
    try:
        records = breakup_chunk(chunk, validate_crc=True)
    except DAMAGE_ERRORS as error:
        return f"a damaged chunk was left out ({type(error).__name__})"
    for record in records:
        if isinstance(record, Message):
            topics.setdefault(record.channel_id, []).append(
                Entry(record.log_time, record.publish_time, record.data)
            )
        elif isinstance(record, Channel):
            _add_channel(record, log, topics)
    return ""


def _add_channel(channel: Channel, log: Log, topics: dict[int, list[Entry]]) -> None:
    topics[channel.id] = log.topics.setdefault(channel.topic, topics.get(channel.id, []))
