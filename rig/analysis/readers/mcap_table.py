"""Table of the fields of one topic of an MCAP file of another program: JSON or ROS 2."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
from mcap.exceptions import McapError
from mcap.records import Channel, Header, Message, Schema
from mcap.stream_reader import StreamReader

from comms.mcap_log import DAMAGE_ERRORS, MAX_RECORD_BYTES
from rig.analysis.readers.columns import is_rising, is_time_name
from rig.analysis.readers.errors import UnreadableData, list_names, missing_extra
from rig.analysis.readers.mcap_fields import (
    field_columns,
    log_time_column,
    message_fields,
    stamp_column,
)
from rig.analysis.readers.mcap_own import read_own_log
from rig.analysis.readers.signal_record import ReadFinding, ReadOptions
from rig.analysis.readers.table import SignalColumn, SignalTable
from rig.errors import ConfigError

OWN_PROFILE = "swayless"
JSON = "json"
ROS2 = "cdr"
Fields = Mapping[str, int | float]


@dataclass
class _Topic:
    """Messages of one topic; all of them where it is wanted, else the first alone."""

    name: str
    encoding: str
    schema: Schema | None
    messages: list[Message] = field(default_factory=list)
    count: int = 0  # in the file

    def add(self, message: Message, wanted: str) -> None:
        """Count a message, and keep it if it is wanted or the first."""
        self.count += 1
        if self.name == wanted or self.count == 1:
            self.messages.append(message)


def read_mcap(path: Path, options: ReadOptions) -> SignalTable:
    """Read the fields of one topic; raises UnreadableData and ConfigError naming the topics."""
    if _profile(path) == OWN_PROFILE:
        return read_own_log(path, options)
    topics, damage = _read_topics(path, options.topic)
    topic = _topic(path, topics, damage, options)
    if topic.name != options.topic:
        topics, damage = _read_topics(path, topic.name)
        topic = next(other for other in topics if other.name == topic.name)
    rows = _decode(path, topic)
    log_ns = [message.log_time for message in topic.messages]
    columns, origin_s = _columns(rows, log_ns)
    findings = []
    if damage:
        text = f"the file is damaged: {damage}; what is before it is used"
        findings.append(ReadFinding("damaged", text))
    return SignalTable(
        kind=f"MCAP file, topic {topic.name}",
        columns=columns,
        origin_s=origin_s,
        findings=findings,
    )


def _profile(path: Path) -> str:
    """Read the profile of the file; "" where it is damaged."""
    try:
        with path.open("rb") as stream:
            first = next(StreamReader(stream, record_size_limit=MAX_RECORD_BYTES).records)
    except (*DAMAGE_ERRORS, StopIteration):
        return ""
    return first.profile if isinstance(first, Header) else ""


def _read_topics(path: Path, wanted: str) -> tuple[list[_Topic], str]:
    """Read the topics without the index of the file; and the damage in words.

    wanted: topic of which all messages are kept.
    """
    schemas: dict[int, Schema] = {}
    topics: dict[str, _Topic] = {}
    names: dict[int, str] = {}
    try:
        with path.open("rb") as stream:
            for record in StreamReader(stream, record_size_limit=MAX_RECORD_BYTES).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    schema = schemas.get(record.schema_id)
                    topic = _Topic(record.topic, record.message_encoding, schema)
                    topics.setdefault(record.topic, topic)
                    names[record.id] = record.topic
                elif isinstance(record, Message):
                    topics[names[record.channel_id]].add(record, wanted)
    except DAMAGE_ERRORS as error:
        return _filled(topics), f"cut short ({type(error).__name__})"
    return _filled(topics), ""


def _filled(topics: dict[str, _Topic]) -> list[_Topic]:
    return [topic for topic in topics.values() if topic.messages]


def _topic(path: Path, topics: list[_Topic], damage: str, options: ReadOptions) -> _Topic:
    """Choose the topic: the wanted one, or the only one that can be decoded."""
    found = [f"{topic.name} ({topic.encoding}, {topic.count})" for topic in topics]
    listing = f"topics found: {list_names(found) or 'none'}"
    wanted = [topic for topic in topics if topic.name == options.topic]
    readable = [topic for topic in topics if topic.encoding in (JSON, ROS2)]
    if wanted:
        return wanted[0]
    if options.topic:
        hint = (readable or topics)[0].name if topics else "NAME"
        raise ConfigError(
            f"{path}: --topic {options.topic}: no messages; {listing}: try --topic {hint}"
        )
    if len(readable) == 1:
        return readable[0]
    if not readable:
        cause = damage or "no messages in JSON or ROS 2 (cdr)"
        raise UnreadableData(f"{path}: MCAP file that cannot be read: {cause}; {listing}")
    raise UnreadableData(
        f"{path}: MCAP file with {len(readable)} topics; {listing}: try {_hint(path, readable)}"
    )


def _hint(path: Path, topics: Sequence[_Topic]) -> str:
    """Word the options for the first topic that has a field beside its stamps."""
    for topic in topics:
        first = _decode(path, topic)
        fields = [name for name in first[0] if not is_time_name(name) and "stamp" not in name]
        if fields:
            return f"--topic {topic.name} --field {fields[0]}"
    return f"--topic {topics[0].name}"


def _decode(path: Path, topic: _Topic) -> list[Fields]:
    """Decode the messages of a topic; raises UnreadableData for an unknown encoding."""
    decode = _decoder(path, topic)
    rows: list[Fields] = []
    for message in topic.messages:
        try:
            rows.append(message_fields(decode(message.data)))
        except (msgspec.DecodeError, McapError, *DAMAGE_ERRORS):
            rows.append({})
    return rows


def _decoder(path: Path, topic: _Topic) -> Callable[[bytes], object]:
    if topic.encoding == JSON:
        return msgspec.json.Decoder().decode
    if topic.encoding == ROS2:
        return _ros2_decoder(path, topic)
    raise UnreadableData(
        f"{path}: topic {topic.name} has the encoding '{topic.encoding}'; must be json or cdr "
        "(ROS 2): convert it, or choose another --topic"
    )


def _ros2_decoder(path: Path, topic: _Topic) -> Callable[[bytes], object]:
    try:
        from mcap_ros2.decoder import DecoderFactory
    except ImportError:
        raise missing_extra(path, "an MCAP file of ROS 2", "mcap-ros2-support") from None
    decode: Callable[[bytes], object] | None
    decode = DecoderFactory().decoder_for(topic.encoding, topic.schema)
    if decode is None:
        kind = topic.schema.encoding if topic.schema else "none"
        raise UnreadableData(
            f"{path}: ROS 2 messages with a schema of kind '{kind}'; must be ros2msg: "
            "record again with the message definitions"
        )
    return decode


def _columns(rows: Sequence[Fields], log_ns: Sequence[int]) -> tuple[list[SignalColumn], float]:
    """Lay the fields out as columns behind the best column of time, with its origin [s].

    Time is a stamp of seconds and nanoseconds in the message, else a field of that name, else
    the instant of recording.
    """
    columns = field_columns(rows)
    origin_ns = log_ns[0]
    for column in columns:
        first = rows[0].get(column.name, 0)
        if column.name.endswith("stamp [ns]") and first and is_rising(column.values):
            rest = [other for other in columns if other is not column]
            return [stamp_column(column.name, rows, int(first)), *rest], first * 1e-9
    if any(is_time_name(c.name) and is_rising(c.values) for c in columns):
        return columns, 0.0
    return [log_time_column(log_ns, origin_ns), *columns], origin_ns * 1e-9
