"""Contents of the operator's bus: what a task or another terminal may send, and its decoding."""

from __future__ import annotations

from typing import Literal, NamedTuple

import msgspec

from comms.channels import CHANNELS
from comms.layouts import LAYOUTS
from comms.messages import Reply
from comms.records import Event, LinkRow, Receipts, TaskTiming

HELLO, REPLY, STREAM_END = b"hello", b"reply", b"farewell"
TELEMETRY_PARTS = 2  # channel, datagram
PICTURE_PARTS = 3  # channel, datagram, pixels
TaskRecord = Receipts | TaskTiming | LinkRow | Event
_RECORDS: dict[str, type] = {kind.__name__: kind for kind in (Receipts, TaskTiming, LinkRow, Event)}


class Telemetry(NamedTuple):
    """Copy of a sent message for the log; pixels only on the picture socket."""

    channel: str
    data: bytes
    pixels: bytes | None


class Hello(NamedTuple):
    """Notice that the sockets of a task are open; it waits for the first heartbeat."""


class StreamEnd(NamedTuple):
    """End of stream on the control or the telemetry socket of a task; each ends on its own."""

    socket: Literal["control", "telemetry"]


class Record(NamedTuple):
    """Record of a task for the log."""

    record: TaskRecord


class Request(NamedTuple):
    """Request of another terminal."""

    client: bytes  # for the answer
    text: str


Content = Hello | StreamEnd | Reply | Record | Telemetry


def decode_control(parts: list[bytes]) -> Hello | StreamEnd | Reply | Record | str | None:
    """Decode the parts of a message on the control socket; None if they are invalid."""
    try:
        if parts == [HELLO]:
            return Hello()
        if parts == [STREAM_END]:
            return StreamEnd("control")
        if len(parts) == 2 and parts[0] == b"":
            return parts[1].decode()
        if len(parts) == 2 and parts[0] == REPLY:
            return msgspec.json.decode(parts[1], type=Reply)
        if len(parts) == 2 and parts[0].decode() in _RECORDS:
            kind = _RECORDS[parts[0].decode()]
            return Record(msgspec.json.decode(parts[1], type=kind))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    return None


def decode_telemetry(parts: list[bytes], parts_each: int) -> Telemetry | None:
    """Check the parts of a copy; None if they are not one."""
    channel = parts[0].decode("ascii", "replace")
    if len(parts) != parts_each or channel not in CHANNELS:
        return None
    if CHANNELS[channel].message not in LAYOUTS:
        return None
    return Telemetry(channel, parts[1], parts[2] if parts_each == PICTURE_PARTS else None)
