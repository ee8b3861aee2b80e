"""Logs of wire version 1 read under the present names; new logs are read as they were written."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
from mcap.reader import make_reader

from comms import old_log
from comms.codec import VERSION
from comms.link import LinkCount
from comms.log_entry import Entry
from comms.mcap_log import Log, LogWriter, read_log
from comms.messages import (
    AngleSample,
    JointState,
    LinkMotion,
    RobotState,
    Setpoint,
    Space,
    SwingPlane,
    Truth,
    axis_setpoint,
    axis_state,
)
from comms.records import FrameStamp, LinkRow, Receipts

OLD_LOG = Path(__file__).parents[1] / "data" / "logs" / "e295f92_move_virtual.mcap"
NEW_NAMES = {"platform": "platform_1", "frame": "frame_1", "angle": "angle_1"}
REWRITTEN = {
    *("/angle_1", "/truth", "/joint_state", "/setpoint"),
    *(f"/receipts/{name}" for name in NEW_NAMES.values()),
}
UNKNOWN_TO_VERSION_1 = {"superseded": 0, "foreign": 0, "bus_errors": 0, "bus_off": False}


def raw_messages(path: Path) -> dict[str, list[bytes]]:
    """Messages by topic, read by the mcap library alone."""
    found: dict[str, list[bytes]] = {}
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            found.setdefault(channel.topic, []).append(message.data)
    return found


@pytest.fixture(scope="module")
def raw() -> dict[str, list[bytes]]:
    """The messages that stand in the old file."""
    return raw_messages(OLD_LOG)


@pytest.fixture(scope="module")
def log() -> Log:
    """The old file as the product reads it."""
    return read_log(OLD_LOG)


def records(raw: dict[str, list[bytes]], topic: str) -> list[dict[str, Any]]:
    """The JSON objects of a topic in the old file."""
    found = [json.loads(data) for data in raw[topic]]
    assert found
    return found


def new_topic(topic: str) -> str:
    """Present name of a topic of version 1."""
    head, _, channel = topic.rpartition("/")
    return f"{head}/{NEW_NAMES.get(channel, channel)}"


def test_the_old_log_names_no_version_and_is_complete(log: Log) -> None:
    assert "wire_version" not in log.metadata["run.start"]
    assert (log.complete, log.damage) == (True, "")


@pytest.mark.parametrize("prefix", ["/", "/receipts/", "/link/"])
@pytest.mark.parametrize(("old", "new"), NEW_NAMES.items())
def test_messages_receipts_and_link_rows_stand_under_the_new_names(
    log: Log, raw: dict[str, list[bytes]], prefix: str, old: str, new: str
) -> None:
    assert f"{prefix}{old}" not in log.topics
    assert len(log.topics[f"{prefix}{new}"]) == len(raw[f"{prefix}{old}"]) > 0


def test_every_topic_is_there_once_with_all_its_messages(
    log: Log, raw: dict[str, list[bytes]]
) -> None:
    expected = {new_topic(topic): len(messages) for topic, messages in raw.items()}
    assert {topic: len(entries) for topic, entries in log.topics.items()} == expected


def test_the_ledger_keeps_the_order_of_the_file(log: Log, raw: dict[str, list[bytes]]) -> None:
    rows = [topic for topic in log.topics if topic.startswith("/link/")]
    assert rows == [new_topic(topic) for topic in raw if topic.startswith("/link/")]


def test_what_did_not_change_is_read_byte_for_byte(log: Log, raw: dict[str, list[bytes]]) -> None:
    kept = {
        topic
        for topic in raw
        if new_topic(topic) not in REWRITTEN and not topic.startswith("/link/")
    }
    assert {"/reference", "/robot_state", "/platform", "/frame", "/events"} <= kept
    for topic in kept:
        assert [entry.data for entry in log.topics[new_topic(topic)]] == raw[topic]


def test_receipts_name_the_new_channel_and_keep_their_rows(
    log: Log, raw: dict[str, list[bytes]]
) -> None:
    for old, new in NEW_NAMES.items():
        got = [msgspec.to_builtins(row) for row in log.read(f"/receipts/{new}", Receipts)]
        expected = [record | {"channel": new} for record in records(raw, f"/receipts/{old}")]
        assert json.loads(json.dumps(got)) == expected


def test_every_link_row_names_the_new_channel_and_keeps_its_counts(
    log: Log, raw: dict[str, list[bytes]]
) -> None:
    topics = [topic for topic in raw if topic.startswith("/link/")]
    assert len(topics) > len(NEW_NAMES)
    for topic in topics:
        got = [msgspec.to_builtins(row) for row in log.read(new_topic(topic), LinkRow)]
        for row, record in zip(got, records(raw, topic), strict=True):
            channel = record["channel"]
            assert row["channel"] == NEW_NAMES.get(channel, channel)
            assert row["count"] == record["count"] | UNKNOWN_TO_VERSION_1
            assert row["balanced"] == record.get("balanced", True)


def old_row(channel: str, rejected: dict[str, int]) -> Entry:
    """A row of the ledger of version 1, with rejected packets."""
    counts = ("sent", "delivered", "lost_link", "lost_kernel", "lost_queue", "duplicated", "late")
    count = dict.fromkeys(counts, 0) | {"sent": 9, "delivered": 7, "rejected": rejected}
    data = json.dumps({"channel": channel, "count": count, "balanced": True}).encode()
    return Entry(5, 4, data)


def upgraded_count(channel: str, rejected: dict[str, int]) -> LinkCount:
    """The count of such a row as it is read today."""
    topics = {f"/link/{channel}": [old_row(channel, rejected)]}
    old_log.upgrade(topics)
    ((entry,),) = topics.values()
    assert (entry.log_ns, entry.publish_ns) == (5, 4)
    return msgspec.json.decode(entry.data, type=LinkRow).count


@pytest.mark.parametrize("channel", ["reference", "angle"])
@pytest.mark.parametrize("reason", ["length", "magic", "version", "channel", "session"])
def test_what_version_1_rejected_as_not_of_the_link_is_foreign_and_outside_the_sum(
    channel: str, reason: str
) -> None:
    count = upgraded_count(channel, {reason: 3, "crc": 2})
    assert (count.foreign, count.rejected, count.unaccounted) == (3, {"crc": 2}, 0)


def test_foreign_packets_of_several_kinds_are_added_up() -> None:
    count = upgraded_count("setpoint", {"session": 3, "length": 4, "old": 1, "out_of_range": 1})
    assert (count.foreign, count.rejected) == (7, {"old": 1, "out_of_range": 1})
    assert count.unaccounted == 0


def test_angles_are_those_of_the_file_as_the_one_link_of_the_plane_x(
    log: Log, raw: dict[str, list[bytes]]
) -> None:
    got, old = log.read("/angle_1", AngleSample), records(raw, "/angle")
    in_link = ("angle_rad", "sigma_rad", "raw_rad", "offset_rad")
    same = ("seq", "t_ns", "t_valid_ns", "valid", "platform_m", "rows")
    same += ("residual_px", "pivot_miss_px", "background", "saturation")
    for sample, record in zip(got, old, strict=True):
        assert sample.swing_plane is SwingPlane.X
        assert {name: getattr(sample, name) for name in same} == {n: record[n] for n in same}
        assert sample.reason.value == record["reason"]
        assert len(sample.links) == (1 if record["valid"] else 0)
        if sample.cable is not None:
            link = {name: getattr(sample.cable, name) for name in in_link}
            assert link == {name: record[name] for name in in_link}
            assert sample.cable.joint_px is None


def test_the_truth_is_that_of_the_file_as_one_link_that_swings_in_x(
    log: Log, raw: dict[str, list[bytes]]
) -> None:
    for truth, record in zip(log.read("/truth", Truth), records(raw, "/truth"), strict=True):
        link = LinkMotion(
            angle_x_rad=record["angle_rad"],
            angle_y_rad=0.0,
            rate_x_rad_s=record["angular_velocity_rad_s"],
            rate_y_rad_s=0.0,
        )
        assert truth.links == (link,)
        assert (truth.seq, truth.t_ns) == (record["seq"], record["t_ns"])
        assert list(truth.position_m) == record["position_m"]
        assert list(truth.velocity_m_s) == record["velocity_m_s"]


def test_joint_states_and_setpoints_are_those_of_the_file_as_axes_in_metres(
    log: Log, raw: dict[str, list[bytes]]
) -> None:
    states = log.read("/joint_state", JointState)
    for state, record in zip(states, records(raw, "/joint_state"), strict=True):
        place, velocity = tuple(record["position_m"]), tuple(record["velocity_m_s"])
        assert state == axis_state(record["seq"], record["t_ns"], place, velocity)
        assert (state.position_m, state.velocity_m_s) == (place, velocity)
    setpoints = log.read("/setpoint", Setpoint)
    for setpoint, record in zip(setpoints, records(raw, "/setpoint"), strict=True):
        place = tuple(record["position_m"])
        assert setpoint == axis_setpoint(record["seq"], record["t_ns"], place)
        assert (setpoint.space, setpoint.position_m) == (Space.METRES, place)


def test_robot_states_and_frames_read_under_their_new_names(
    log: Log, raw: dict[str, list[bytes]]
) -> None:
    for kind, old in ((RobotState, "platform"), (FrameStamp, "frame")):
        got = [msgspec.to_builtins(message) for message in log.read(f"/{NEW_NAMES[old]}", kind)]
        assert json.loads(json.dumps(got)) == records(raw, f"/{old}")


def test_an_angle_without_a_value_has_no_link() -> None:
    record = {
        **dict.fromkeys(("angle_rad", "sigma_rad", "raw_rad", "offset_rad", "platform_m")),
        **dict.fromkeys(("residual_px", "pivot_miss_px")),
        "seq": 1,
        "t_ns": 2,
        "t_valid_ns": 3,
        "valid": False,
        "reason": "no_cable",
        "rows": 0,
        "background": 200.0,
        "saturation": 0.0,
    }
    topics = {"/angle": [Entry(5, 4, json.dumps(record).encode())]}
    old_log.upgrade(topics)
    (entry,) = topics["/angle_1"]
    sample = msgspec.json.decode(entry.data, type=AngleSample)
    assert (entry.log_ns, entry.publish_ns) == (5, 4)
    assert (sample.valid, sample.links, sample.cable) == (False, (), None)


UNREADABLE = {
    "no JSON": b"{",
    "no text": b'"\xff"',
    "a number": b"3",
    "nothing": b"null",
    "a text": b'"angle_rad"',
    "a list": b"[1, 2]",
    "an object without its fields": b'{"valid": true, "angle_rad": 0.1}',
    "an object of other fields": b'{"channel": ["angle"], "position_m": 3, "valid": []}',
    "a deep list": b"[" * 100_000,
    "a deep object": b'{"angle_rad":' * 100_000,
}


@pytest.mark.parametrize("data", UNREADABLE.values(), ids=UNREADABLE.keys())
def test_a_message_that_cannot_be_rewritten_is_left_for_the_reader_to_refuse(data: bytes) -> None:
    topics = ("/angle", "/truth", "/setpoint", "/joint_state", "/receipts/angle", "/link/frame")
    found = {topic: [Entry(2, 1, data)] for topic in topics}
    old_log.upgrade(found)
    assert found == {new_topic(topic): [Entry(2, 1, data)] for topic in topics}


def written(path: Path, add: Callable[[LogWriter], None]) -> Log:
    """A new log with some messages, read again."""
    log = LogWriter(path, {"seed": "7"}, 10**18)
    add(log)
    log.close({"exit_status": "ok"})
    return read_log(path)


def test_a_new_log_carries_the_version_of_the_wire(tmp_path: Path) -> None:
    log = written(tmp_path / "run.mcap", lambda log: None)
    assert log.metadata["run.start"]["wire_version"] == str(VERSION) == "2"
    assert log.metadata["run.start"]["seed"] == "7"


def test_a_new_log_is_not_rewritten(tmp_path: Path) -> None:
    """Not even where its topics and fields bear old names."""
    row = LinkRow(channel="angle", count=LinkCount(sent=1))
    receipts = Receipts(channel="frame", rows=[(0, 5, "")])
    setpoint = axis_setpoint(1, 2, (0.1, 0.2, 0.3))

    def add(log: LogWriter) -> None:
        log.write("/link/angle", row, 1, 2)
        log.write("/receipts/frame", receipts, 1, 2)
        log.write("/platform", setpoint, 1, 2)
        log.write("/setpoint", setpoint, 1, 2)

    path = tmp_path / "run.mcap"
    log = written(path, add)
    assert {t: [entry.data for entry in entries] for t, entries in log.topics.items()} == (
        raw_messages(path)
    )
    assert log.read("/link/angle", LinkRow) == [row]
    assert log.read("/receipts/frame", Receipts) == [receipts]
    assert log.read("/platform", Setpoint) == log.read("/setpoint", Setpoint) == [setpoint]
