"""Logs of wire version 1: their topics and messages as those of the present version."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from comms.channels import RENAMED_CHANNELS
from comms.log_entry import Entry

VERSION_KEY = "wire_version"  # in run.start; version 1 has none
AXES = 3
# reasons to reject a packet that was not of the link and the run
FOREIGN_REASONS = ("length", "magic", "version", "channel", "session")
Record = dict[str, Any]
_NEW_TOPICS = {
    f"{prefix}{old}": f"{prefix}{new}"
    for prefix in ("/", "/receipts/", "/link/")
    for old, new in RENAMED_CHANNELS.items()
}


def upgrade(topics: dict[str, list[Entry]]) -> None:
    """Rename topics and rewrite messages of version 1 in place.

    A message that cannot be rewritten is left as it is, for the reader to refuse.
    """
    renamed = {_NEW_TOPICS.get(topic, topic): entries for topic, entries in topics.items()}
    topics.clear()
    topics.update(renamed)  # in the order of the file
    for topic, entries in topics.items():
        rewrite = _ledger_row if topic.startswith("/link/") else _REWRITES.get(topic)
        if rewrite is not None:
            topics[topic] = [_rewritten(entry, rewrite) for entry in entries]


def _rewritten(entry: Entry, rewrite: Callable[[Record], Record]) -> Entry:
    try:
        record = rewrite(msgspec.json.decode(entry.data, type=Record))
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, KeyError, TypeError):
        return entry
    return entry._replace(data=msgspec.json.encode(record))


def _channel(record: Record) -> Record:
    return record | {"channel": RENAMED_CHANNELS[record["channel"]]}


def _ledger_row(record: Record) -> Record:
    """Take what came from other senders out of the rejected packets."""
    record = record | {"channel": RENAMED_CHANNELS.get(record["channel"], record["channel"])}
    count = record["count"]
    rejected = dict(count["rejected"])
    foreign = [rejected.pop(reason) for reason in FOREIGN_REASONS if reason in rejected]
    return record | {"count": count | {"rejected": rejected, "foreign": sum(foreign)}}


def _setpoint(record: Record) -> Record:
    return _head(record) | _joints(values=record["position_m"])


def _joint_state(record: Record) -> Record:
    return _head(record) | _joints(values=record["position_m"], rates=record["velocity_m_s"])


def _joints(**vectors: list[float]) -> Record:
    padded = {name: [*vector, 0.0, 0.0, 0.0] for name, vector in vectors.items()}
    return {"space": "m", "count": AXES, **padded}


def _truth(record: Record) -> Record:
    link = {
        "angle_x_rad": record.pop("angle_rad"),
        "angle_y_rad": 0.0,
        "rate_x_rad_s": record.pop("angular_velocity_rad_s"),
        "rate_y_rad_s": 0.0,
    }
    return record | {"links": [link]}


def _angle(record: Record) -> Record:
    names = ("angle_rad", "sigma_rad", "raw_rad", "offset_rad")
    link = {name: record.pop(name) for name in names}
    link["joint_px"] = None  # version 1 does not tell it
    links = [link] if record["valid"] else []
    return record | {"swing_plane": "x", "links": links}


def _head(record: Record) -> Record:
    return {"seq": record["seq"], "t_ns": record["t_ns"]}


_REWRITES: dict[str, Callable[[Record], Record]] = {
    "/setpoint": _setpoint,
    "/joint_state": _joint_state,
    "/truth": _truth,
    "/angle_1": _angle,
}
for _new in RENAMED_CHANNELS.values():
    _REWRITES[f"/receipts/{_new}"] = _channel
