"""Table of the signals of one CAN message in a trace, named by a DBC file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import can
import cantools
import numpy as np
from cantools.database.can import Database, Message

from comms.errors import LogError
from rig.analysis.readers.can_trace import read_trace
from rig.analysis.readers.errors import UnreadableData, counted, list_names
from rig.analysis.readers.file_kind import FileKind
from rig.analysis.readers.signal_record import FloatArray, ReadFinding, ReadOptions
from rig.analysis.readers.table import SignalColumn, SignalTable
from rig.errors import ConfigError

KINDS = {
    FileKind.CAN_ASC: "CAN trace (ASC)",
    FileKind.CAN_BLF: "CAN trace (BLF)",
    FileKind.CAN_TRC: "CAN trace (PCAN TRC)",
    FileKind.CAN_CANDUMP: "CAN trace (candump)",
}
DBC_ERRORS = (cantools.Error, ValueError, KeyError, UnicodeError)


class _Frames(NamedTuple):
    """Frames of the trace by identifier, in file order."""

    stamps_s: dict[int, list[float]]
    data: dict[int, list[bytes]]
    damage: str  # "" if none


def read_can(path: Path, kind: FileKind, options: ReadOptions) -> SignalTable:
    """Read the signals of one message; raises UnreadableData and ConfigError."""
    frames = _read_frames(path, kind)
    if not frames.data:
        raise UnreadableData(f"{path}: {KINDS[kind]} without data frames; name another trace")
    if options.dbc is None:
        raise UnreadableData(
            f"{path}: {KINDS[kind]} with the identifiers {list_names(_ids(frames))}; its signals "
            "need names: try --dbc FILE.dbc"
        )
    messages = [m for m in _database(options.dbc).messages if m.frame_id in frames.data]
    if not messages:
        raise UnreadableData(
            f"{path}: none of its identifiers {list_names(_ids(frames))} is in {options.dbc}: "
            "try another --dbc"
        )
    message = _message(path, messages, options)
    return _table(KINDS[kind], message, frames)


def _read_frames(path: Path, kind: FileKind) -> _Frames:
    """Read the data frames; what stands before a damage is kept."""
    stamps_s: dict[int, list[float]] = {}
    data: dict[int, list[bytes]] = {}
    damage = ""
    try:
        for frame in _data_frames(read_trace(path, kind.value)):
            stamps_s.setdefault(frame.arbitration_id, []).append(frame.timestamp)
            data.setdefault(frame.arbitration_id, []).append(bytes(frame.data))
    except LogError as error:
        if not data:
            raise UnreadableData(str(error)) from error
        damage = str(error)
    return _Frames(stamps_s, data, damage)


def _data_frames(frames: Iterator[can.Message]) -> Iterator[can.Message]:
    for frame in frames:
        if not frame.is_error_frame and not frame.is_remote_frame:
            yield frame


def _ids(frames: _Frames) -> list[str]:
    return [f"0x{can_id:X} ({len(rows)} frames)" for can_id, rows in sorted(frames.data.items())]


def _database(path: Path) -> Database:
    try:
        database = cantools.database.load_file(path, strict=False)
    except OSError as error:
        raise ConfigError(f"--dbc {path}: {error.strerror}; name a DBC file") from error
    except DBC_ERRORS as error:
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ConfigError(f"--dbc {path}: no DBC file ({first}); name a DBC file") from error
    if not isinstance(database, Database):
        raise ConfigError(f"--dbc {path}: no description of a CAN bus; name a DBC file")
    return database


def _message(path: Path, messages: list[Message], options: ReadOptions) -> Message:
    """Choose the message that holds the wanted signal, or the only one."""
    wanted = options.field or options.signal
    holders = []
    for message in messages:
        names = [signal.name for signal in message.signals]
        names += [f"{message.name}.{name}" for name in names]
        if wanted in names or options.topic == message.name:
            holders.append(message)
    if len(holders) == 1:
        return holders[0]
    if len(messages) == 1 and not options.topic:
        return messages[0]
    found = [f"{m.name}.{s.name}" for m in messages for s in m.signals]
    if wanted or options.topic:
        what = "in several messages" if holders else "no such signal"
        raise ConfigError(
            f"{path}: {wanted or options.topic}: {what}; signals found: {list_names(found)}: "
            f"try --signal {found[0]}"
        )
    raise UnreadableData(
        f"{path}: CAN trace with {len(messages)} messages of the DBC file; signals found: "
        f"{list_names(found)}: try --signal {found[0]}"
    )


def _table(kind: str, message: Message, frames: _Frames) -> SignalTable:
    """Decode the frames of a message; a missing or undecodable value is NaN."""
    stamps_s = np.array(frames.stamps_s[message.frame_id])
    rows: dict[str, list[float]] = {signal.name: [] for signal in message.signals}
    undecoded = 0
    for data in frames.data[message.frame_id]:
        values = _decoded(message, data)
        undecoded += values is None
        for name, column in rows.items():
            value = (values or {}).get(name)
            column.append(float(value) if isinstance(value, int | float) else float("nan"))
    columns = [SignalColumn("time [s]", stamps_s - stamps_s[0], is_time=True)]
    for signal in message.signals:
        unit = f" [{signal.unit}]" if signal.unit else ""
        name = f"{message.name}.{signal.name}{unit}"
        columns.append(SignalColumn(name, _floats(rows[signal.name])))
    return SignalTable(
        kind=f"{kind}, message {message.name} (0x{message.frame_id:X})",
        columns=columns,
        origin_s=float(stamps_s[0]),
        findings=_findings(frames, undecoded),
    )


def _floats(values: list[float]) -> FloatArray:
    return np.array(values, dtype=np.float64)


def _decoded(message: Message, data: bytes) -> dict[str, object] | None:
    try:
        values = message.decode(data, decode_choices=False, allow_truncated=True)
    except DBC_ERRORS:
        return None
    return dict(values) if isinstance(values, dict) else None


def _findings(frames: _Frames, undecoded: int) -> list[ReadFinding]:
    findings = []
    if frames.damage:
        findings.append(ReadFinding("damaged", f"{frames.damage}; what is before it is used"))
    if undecoded:
        text = f"{counted(undecoded, 'frame')} of another form than in the DBC file; left out"
        findings.append(ReadFinding("undecoded", text, undecoded))
    return findings
