"""Log file: read as written, by read_log and by any MCAP tool; damage is reported."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from mcap.reader import make_reader
from mcap.records import Metadata
from mcap.stream_reader import StreamReader

from comms.errors import LogError
from comms.link import LinkCount
from comms.mcap_log import Log, LogWriter, json_schema, read_log
from comms.messages import (
    AngleSample,
    JointState,
    Reference,
    RobotState,
    Setpoint,
    Truth,
    axis_setpoint,
)
from comms.records import CompressedImage, Event, FrameStamp, LinkRow, Receipts, Stamp, TaskTiming
from tests.comms.wire_reference import messages

START = {"seed": "7", "purpose": "swing-free, we hope: θ = 0"}
EPOCH_NS = 1_795_000_000_000_000_000  # a day in November 2026
STARTED = {**START, "epoch_ns": str(EPOCH_NS), "wire_version": "2"}
STOP = {"exit_status": "ok", "digest": "00"}
PLAN = b"[plan]\ninput = 'zv'\n"
RECORDS: dict[str, msgspec.Struct] = {
    "/receipts/angle_1": Receipts(channel="angle_1", rows=[(0, 5, ""), (0, 6, "duplicate")]),
    "/timing/vision": TaskTiming(task="vision", t_ns=3, late_ticks=1, lateness_ns=[5, 70_000]),
    "/link/angle_1": LinkRow(
        channel="angle_1", count=LinkCount(sent=3, delivered=2, rejected={"crc": 1}), balanced=True
    ),
    "/frame_1": FrameStamp(
        seq=1,
        t_ns=2,
        t_exposure_start_ns=3,
        exposure_ns=4,
        row_ns=5,
        camera="c",
        encoding="mono8",
        height=6,
        width=7,
        crc32=8,
    ),
    "/events": Event(t_ns=9, level="warning", source="vision", text='a "quoted" word, ±1°'),
    "/camera/image": CompressedImage(
        timestamp=Stamp(sec=1, nsec=2), frame_id="c", data=bytes(range(256)), format="jpeg"
    ),
}
KINDS = (
    AngleSample,
    JointState,
    Reference,
    RobotState,
    Setpoint,
    Truth,
    *map(type, RECORDS.values()),
)


def setpoint(seq: int) -> Setpoint:
    """One small message."""
    return axis_setpoint(seq, 10 * seq, (0.001 * seq, 0.0, -0.5))


def write_log(path: Path, *, closed: bool = True) -> None:
    """A small log of two chunks, an attachment, and its two ends."""
    log = LogWriter(path, START, EPOCH_NS)
    log.attach("plan.toml", "application/toml", PLAN)
    for seq in range(4):
        log.write("/setpoint", setpoint(seq), 10 * seq, 10 * seq + 3, seq)
        if seq == 1:
            log.flush()
    log.write("/events", RECORDS["/events"], 9, 50)
    if closed:
        log.close(STOP)
    else:
        log.flush()


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Bytes of the small log."""
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    write_log(path)
    return path.read_bytes()


def test_every_record_is_read_unchanged(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    log = LogWriter(path, START, EPOCH_NS)
    for k, (topic, record) in enumerate(RECORDS.items()):
        log.write(topic, record, publish_ns=100 + k, log_ns=200 + k, seq=k)
    log.close(STOP)
    read = read_log(path)
    assert {topic: read.read(topic, type(record)) for topic, record in RECORDS.items()} == {
        t: [r] for t, r in RECORDS.items()
    }
    stamps = [(entry.publish_ns, entry.log_ns) for topic in RECORDS for entry in read.topics[topic]]
    assert stamps == [(100 + k, 200 + k) for k in range(len(RECORDS))]
    assert (read.complete, read.damage) == (True, "")


@settings(deadline=None, max_examples=30)
@given(
    messages("angle_1"),
    messages("truth"),
    messages("robot_state"),
    messages("setpoint"),
    messages("joint_state"),
)
def test_messages_of_the_channels_are_read_unchanged(
    tmp_path_factory: pytest.TempPathFactory,
    angle: AngleSample,
    truth: Truth,
    state: RobotState,
    order: Setpoint,
    joints: JointState,
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.mcap"
    log = LogWriter(path, {}, EPOCH_NS)
    for topic, message in (
        ("/angle_1", angle),
        ("/truth", truth),
        ("/platform_1", state),
        ("/robot_state", state),
        ("/setpoint", order),
        ("/joint_state", joints),
    ):
        log.write(topic, message, message.t_ns, message.t_ns, message.seq)
    log.close({})
    read = read_log(path)
    assert (read.read("/angle_1", AngleSample), read.read("/truth", Truth)) == ([angle], [truth])
    assert read.read("/platform_1", RobotState) == read.read("/robot_state", RobotState) == [state]
    assert (read.read("/setpoint", Setpoint), read.read("/joint_state", JointState)) == (
        [order],
        [joints],
    )


def test_messages_of_a_topic_keep_their_order_over_chunks(small: bytes, tmp_path: Path) -> None:
    log = read_bytes(small, tmp_path)
    assert log.read("/setpoint", Setpoint) == [setpoint(seq) for seq in range(4)]
    assert log.read("/nothing", Setpoint) == []
    assert log.attachments == {"plan.toml": PLAN}


def test_another_reader_finds_topics_schemas_stamps_and_attachments(
    small: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(small)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        found = [
            (s.name, c.topic, m.publish_time, m.log_time, m.sequence)
            for s, c, m in reader.iter_messages()
            if s
        ]
        assert found[:4] == [
            ("swayless.Setpoint", "/setpoint", EPOCH_NS + 10 * k, EPOCH_NS + 10 * k + 3, k)
            for k in range(4)
        ]
        assert found[4:] == [("swayless.Event", "/events", EPOCH_NS + 9, EPOCH_NS + 50, 0)]
        _, channel, message = next(iter(reader.iter_messages(topics=["/events"])))
        assert channel.message_encoding == "json"
        assert json.loads(message.data) == msgspec.to_builtins(RECORDS["/events"])
        assert [(a.name, a.media_type, a.data) for a in reader.iter_attachments()] == [
            ("plan.toml", "application/toml", PLAN)
        ]
        assert [(m.name, m.metadata) for m in reader.iter_metadata()] == [
            ("run.start", STARTED),
            ("run.stop", STOP),
        ]


def test_a_picture_is_base64_under_the_foxglove_schema_name(tmp_path: Path) -> None:
    path, image = tmp_path / "run.mcap", RECORDS["/camera/image"]
    assert isinstance(image, CompressedImage)
    log = LogWriter(path, START, EPOCH_NS)
    log.write("/camera/image", image, 1, 2)
    log.close(STOP)
    with path.open("rb") as stream:
        ((schema, _, message),) = make_reader(stream).iter_messages()
    assert schema is not None
    assert (schema.name, schema.encoding) == ("foxglove.CompressedImage", "jsonschema")
    assert base64.b64decode(json.loads(message.data)["data"]) == image.data


@pytest.mark.parametrize("kind", KINDS)
def test_a_schema_is_an_object_that_names_every_field_and_resolves_every_reference(
    kind: type,
) -> None:
    schema = json.loads(json_schema(kind))
    assert schema["type"] == "object"
    assert list(schema["properties"]) == [field.name for field in msgspec.structs.fields(kind)]
    for reference in references(schema):
        assert reference.removeprefix("#/$defs/") in schema["$defs"]


def references(node: Any) -> list[str]:
    """Every $ref below a JSON node."""
    if isinstance(node, list):
        return [found for item in node for found in references(item)]
    if isinstance(node, dict):
        return ([node["$ref"]] if "$ref" in node else []) + references(list(node.values()))
    return []


def test_start_is_the_first_record_and_stop_the_last_of_the_data(
    small: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(small)
    with path.open("rb") as stream:
        kinds = [
            type(r).__name__ + (f" {r.name}" if isinstance(r, Metadata) else "")
            for r in StreamReader(stream).records
        ]
    assert kinds[:2] == ["Header", "Metadata run.start"]
    assert kinds[kinds.index("DataEnd") - 1] == "Metadata run.stop"
    assert list(read_log(path).metadata) == ["run.start", "run.stop"]


def test_start_is_on_disk_before_anything_else_is_written(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    log = LogWriter(path, START, EPOCH_NS)
    log.write("/setpoint", setpoint(0), 0, 0)
    left = tmp_path / "killed.mcap"
    left.write_bytes(path.read_bytes())  # the file after a kill at this instant
    log.close(STOP)
    killed = read_log(left)
    assert killed.metadata == {"run.start": STARTED}
    assert killed.topics == {}
    assert not killed.complete


def test_flushed_messages_survive_a_kill(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    log = LogWriter(path, START, EPOCH_NS)
    log.write("/setpoint", setpoint(0), 0, 0)
    log.flush()
    log.write("/setpoint", setpoint(1), 0, 0)
    left = tmp_path / "killed.mcap"
    left.write_bytes(path.read_bytes())
    log.close(STOP)
    assert read_log(left).read("/setpoint", Setpoint) == [setpoint(0)]
    assert not read_log(left).complete


def read_bytes(data: bytes, folder: Path) -> Log:
    """Read a log from bytes."""
    path = folder / "bytes.mcap"
    path.write_bytes(data)
    try:
        return read_log(path)
    finally:
        path.unlink()  # writing a new file is ten times faster than truncating an old one


def test_a_log_cut_anywhere_is_incomplete_or_no_log_and_holds_what_came_before(
    small: bytes, tmp_path: Path
) -> None:
    whole, found = read_bytes(small, tmp_path), set[int]()
    for size in range(len(small)):
        try:
            log = read_bytes(small[:size], tmp_path)
        except LogError:
            assert not found  # once the start is readable, it stays so
            continue
        setpoints = log.read("/setpoint", Setpoint)
        assert setpoints == whole.read("/setpoint", Setpoint)[: len(setpoints)]
        assert len(setpoints) >= max(found, default=0)
        assert not log.complete
        assert log.damage
        found.add(len(setpoints))
    assert found == {0, 2, 4}  # chunk by chunk


@pytest.mark.parametrize("mask", [0x01, 0x04])
def test_a_damaged_byte_is_noticed_or_harmless(small: bytes, tmp_path: Path, mask: int) -> None:
    whole = read_bytes(small, tmp_path)
    noticed = 0
    for place in range(len(small)):
        damaged = bytearray(small)
        damaged[place] ^= mask
        try:
            log = read_bytes(bytes(damaged), tmp_path)
        except LogError:
            noticed += 1
            continue
        assert not log.complete or log == whole, f"byte {place}"
        noticed += not log.complete
    assert noticed > len(small) / 3  # the rest is the summary, which is not needed


def test_a_damaged_chunk_is_left_out_and_the_others_are_read(small: bytes, tmp_path: Path) -> None:
    """The first chunk too, although it alone defines the channels: the summary repeats them."""
    damaged = bytearray(small)
    damaged[small.index(b"zstd") + 40] ^= 0xFF
    log = read_bytes(bytes(damaged), tmp_path)
    assert log.read("/setpoint", Setpoint) == [setpoint(2), setpoint(3)]
    assert log.read("/events", Event) == [RECORDS["/events"]]
    assert "chunk" in log.damage
    assert not log.complete


def test_a_change_of_the_metadata_is_noticed(small: bytes, tmp_path: Path) -> None:
    log = read_bytes(small.replace(b"swing-free", b"swing-full"), tmp_path)
    assert "checksum" in log.damage
    assert not log.complete


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda path: None, "No such file"),
        (lambda path: path.mkdir(), "Is a directory"),
        (lambda path: path.write_bytes(b""), "without 'run.start'"),
        (lambda path: path.write_text("t_ns,angle_rad\n0,0.1\n"), "not an MCAP file"),
    ],
)
def test_a_file_that_is_not_a_log_is_refused_with_its_path(
    tmp_path: Path, spoil: Callable[[Path], object], words: str
) -> None:
    path = tmp_path / "run.mcap"
    spoil(path)
    with pytest.raises(LogError, match=words) as raised:
        read_log(path)
    assert str(path) in str(raised.value)


def test_a_foreign_mcap_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    log = LogWriter(path, START, EPOCH_NS)
    log.close(STOP)
    path.write_bytes(path.read_bytes().replace(b"run.start", b"run.other"))
    with pytest.raises(LogError, match=r"without 'run\.start'; .*name a run folder"):
        read_log(path)


def test_stamps_in_the_file_are_wall_clock_time_and_never_published_after_logged(
    tmp_path: Path,
) -> None:
    path = tmp_path / "run.mcap"
    log = LogWriter(path, START, EPOCH_NS)
    log.attach("plan.toml", "application/toml", PLAN)
    log.write("/setpoint", setpoint(1), publish_ns=10, log_ns=13)
    log.write("/setpoint", setpoint(2), publish_ns=25, log_ns=23)  # sent after it was logged
    log.close(STOP)
    with path.open("rb") as stream:
        reader = make_reader(stream)
        stamps = [(m.publish_time, m.log_time) for _, _, m in reader.iter_messages()]
        attachments = [(a.create_time, a.log_time) for a in reader.iter_attachments()]
    assert stamps == [(EPOCH_NS + 10, EPOCH_NS + 13), (EPOCH_NS + 23, EPOCH_NS + 23)]
    assert attachments == [(EPOCH_NS, EPOCH_NS)]
    assert [entry.log_ns for entry in read_log(path).topics["/setpoint"]] == [13, 23]


def test_every_chunk_has_a_message_index(small: bytes, tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(small)
    with (tmp_path / "run.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == 2
    assert all(chunk.message_index_offsets for chunk in summary.chunk_indexes)
