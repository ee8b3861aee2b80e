"""Columns from the fields of messages: "linear_acceleration.x", "links[0].angle_rad"."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from rig.analysis.readers.signal_record import FloatArray
from rig.analysis.readers.table import SignalColumn

MAX_LENGTH = 64  # of a list in a message; a longer one holds no single signals
MAX_DEPTH = 8
LOG_TIME = "log time [s]"
NANOSECONDS = ("nanosec", "nsec", "nsecs", "nanos")
NS_S = 1e-9


def message_fields(message: object) -> dict[str, int | float]:
    """Collect the numbers of a message by path; a stamp of seconds and nanoseconds is one [ns]."""
    return dict(_leaves("", message, 0))


def _leaves(path: str, value: object, depth: int) -> Iterator[tuple[str, int | float]]:
    if isinstance(value, bool) or depth > MAX_DEPTH:
        return
    if isinstance(value, int | float):
        yield path, value
        return
    if isinstance(value, list | tuple):
        if len(value) <= MAX_LENGTH:
            for index, item in enumerate(value):
                yield from _leaves(f"{path}[{index}]", item, depth + 1)
        return
    members = _members(value)
    stamp_ns = _stamp_ns(members)
    if stamp_ns is not None:
        yield f"{path} [ns]".strip(), stamp_ns
        return
    for name, item in members.items():
        yield from _leaves(f"{path}.{name}" if path else name, item, depth + 1)


def _members(value: object) -> Mapping[str, object]:
    """Read the fields of a JSON object, or of a message of ROS 2."""
    if isinstance(value, dict):
        return value
    slots = getattr(value, "__slots__", ())
    if isinstance(value, str | bytes) or value is None:
        return {}
    return {str(name): getattr(value, name) for name in slots}


def _stamp_ns(members: Mapping[str, object]) -> int | None:
    """Join seconds and nanoseconds; None where the members are something else."""
    seconds = members.get("sec", members.get("secs"))
    for name in NANOSECONDS:
        part = members.get(name)
        if len(members) == 2 and isinstance(seconds, int) and isinstance(part, int):
            return seconds * 1_000_000_000 + part
    return None


def field_columns(rows: Sequence[Mapping[str, int | float]]) -> list[SignalColumn]:
    """Lay fields by path out as columns; a missing value is NaN."""
    names: dict[str, None] = {}
    for row in rows:
        names.update(dict.fromkeys(row))
    columns = []
    for name in names:
        values = [row.get(name, math.nan) for row in rows]
        columns.append(SignalColumn(name, np.array(values, dtype=np.float64)))
    return columns


def stamp_column(
    name: str, rows: Sequence[Mapping[str, int | float]], origin_ns: int
) -> SignalColumn:
    """Make a column of time [s] from integer stamps [ns], without their rounding."""
    stamps = [row.get(name) for row in rows]
    seconds = [math.nan if stamp is None else (stamp - origin_ns) * NS_S for stamp in stamps]
    return SignalColumn(name, np.array(seconds, dtype=np.float64), is_time=True)


def log_time_column(stamps_ns: Sequence[int], origin_ns: int) -> SignalColumn:
    """Make the column of the instants of recording [s]."""
    log_s: FloatArray = np.array([(stamp - origin_ns) * NS_S for stamp in stamps_ns])
    return SignalColumn(LOG_TIME, log_s, is_time=True)
