"""Table of one topic of a log of ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from comms.errors import LogError
from comms.mcap_log import Log, read_log
from rig.analysis.readers.errors import UnreadableData, list_names
from rig.analysis.readers.mcap_fields import (
    field_columns,
    log_time_column,
    message_fields,
    stamp_column,
)
from rig.analysis.readers.signal_record import ReadFinding, ReadOptions
from rig.analysis.readers.table import SignalColumn, SignalTable
from rig.errors import ConfigError

ANGLE_TOPIC = "/angle_1"
ANGLE_FIELD = "links[0].angle_rad"
STAMPS = ("t_valid_ns", "t_actual_ns", "t_ns")  # the instant that the values hold for first
TRUTH = "--topic /truth --field links[0].angle_x_rad"


def read_own_log(path: Path, options: ReadOptions) -> SignalTable:
    """Read a topic of a run; the angle of the first camera where nothing is chosen."""
    try:
        log = read_log(path)
    except LogError as error:
        raise UnreadableData(str(error)) from error
    topic = _topic(log, options)
    decode = msgspec.json.Decoder().decode
    entries = log.topics[topic]
    messages = [decode(entry.data) for entry in entries]
    valid = [k for k, message in enumerate(messages) if message.get("valid", True)]
    rows = [message_fields(messages[k]) for k in valid]
    columns = field_columns(rows)
    if topic == ANGLE_TOPIC and not options.signal and not options.field:
        columns = [column for column in columns if column.name == ANGLE_FIELD]
        if not columns:
            raise UnreadableData(
                f"{path}: topic {topic} without a valid angle ({len(messages)} frames): try {TRUTH}"
            )
    log_ns = [entries[k].log_ns for k in valid]
    return SignalTable(
        kind=f"log of a run, topic {topic}",
        columns=[_stamps(rows, log_ns), *_without_stamps(columns)],
        findings=_findings(log, messages, len(valid)),
    )


def _topic(log: Log, options: ReadOptions) -> str:
    wanted = options.topic or ANGLE_TOPIC
    if log.topics.get(wanted):
        return wanted
    found = sorted(name for name, entries in log.topics.items() if entries)
    what = f"{log.path}: topic {wanted}: no messages; topics found: {list_names(found) or 'none'}"
    if options.topic:
        raise ConfigError(f"{what}: try --topic {found[0] if found else ANGLE_TOPIC}")
    raise UnreadableData(f"{what}: try {TRUTH}")


def _stamps(rows: Sequence[Mapping[str, int | float]], log_ns: Sequence[int]) -> SignalColumn:
    """Choose the stamp that the values of the messages hold for [s, run clock]."""
    for name in STAMPS:
        if rows and name in rows[0]:
            return stamp_column(name, rows, 0)
    return log_time_column(log_ns, 0)


def _without_stamps(columns: Sequence[SignalColumn]) -> list[SignalColumn]:
    return [column for column in columns if column.name not in (*STAMPS, "seq")]


def _findings(log: Log, messages: Sequence[Any], valid: int) -> list[ReadFinding]:
    findings = []
    if not log.complete:
        text = f"the log is damaged: {log.damage}; what is left is used"
        findings.append(ReadFinding("damaged", text))
    invalid = len(messages) - valid
    if invalid:
        text = f"{invalid} of {len(messages)} frames without a valid angle"
        findings.append(ReadFinding("invalid_frames", text, invalid))
    return findings
