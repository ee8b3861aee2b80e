"""Bytes of a datagram: header, payload, CRC. What is not exactly right is named, never raised.

Layout (little-endian): magic "SW", version, channel, length, flags, pad, session, seq, t_ns | payload | CRC-32.
An absent value (None) travels as NaN; NaN anywhere else, and every infinity, is refused.
"""

from __future__ import annotations

import enum
import math
import struct
import sys
import zlib
from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec
import numpy as np

from comms.channels import CHANNELS
from comms.messages import (
    AngleSample,
    Frame,
    InvalidReason,
    JointState,
    Message,
    Phase,
    Reference,
    RobotState,
    Setpoint,
    Truth,
)

MAGIC = b"SW"
VERSION = 1
CLOSING = 1  # flag: no payload; seq is the number of datagrams that were put on the wire
LATEST_NS = 2**62  # the bound of messages.TimeNs
HEADER = struct.Struct("<2sBBHBxQIq")
CRC = struct.Struct("<I")
_PHASES, _REASONS = tuple(Phase), tuple(InvalidReason)
_PHASE_CODE = {p: i for i, p in enumerate(_PHASES)}
_REASON_CODE = {r: i for i, r in enumerate(_REASONS)}
_NAN = math.nan
_NO_PIXELS = np.empty((0, 0), dtype=np.uint8)
_FINITE = sys.float_info.max


class Reject(enum.Enum):
    """Why bytes were not taken for a message, in the order of the checks."""

    LENGTH = "length"
    MAGIC = "magic"
    VERSION = "version"
    CRC = "crc"
    CHANNEL = "channel"
    SESSION = "session"
    NOT_FINITE = "not_finite"
    OUT_OF_RANGE = "out_of_range"


class Closing(NamedTuple):
    """The sender's last word: how many datagrams it put on the wire."""

    datagrams: int


class Layout(NamedTuple):
    """How one message type lies in the payload; to_values and to_message are each other's inverse."""

    format: str
    to_values: Callable[[Any], tuple[Any, ...]]
    to_message: Callable[[int, int, tuple[Any, ...]], Message]


def _absent(value: float | None) -> float:
    return _NAN if value is None else value


def _present(value: float) -> float | None:
    return None if value != value else value


LAYOUTS: dict[type[Message], Layout] = {
    Reference: Layout(
        "q3d",
        lambda m: (m.t_target_ns, *m.position_m),
        lambda seq, t, v: Reference(seq=seq, t_ns=t, t_target_ns=v[0], position_m=v[1:4]),
    ),
    Setpoint: Layout(
        "3d", lambda m: m.position_m, lambda seq, t, v: Setpoint(seq=seq, t_ns=t, position_m=v)
    ),
    JointState: Layout(
        "3d3d",
        lambda m: m.position_m + m.velocity_m_s,
        lambda seq, t, v: JointState(seq=seq, t_ns=t, position_m=v[0:3], velocity_m_s=v[3:6]),
    ),
    RobotState: Layout(
        "q3d3d3dB",
        lambda m: (
            m.t_actual_ns,
            *m.commanded_m,
            *m.actual_m,
            *m.actual_velocity_m_s,
            _PHASE_CODE[m.phase],
        ),
        lambda seq, t, v: RobotState(
            seq=seq,
            t_ns=t,
            t_actual_ns=v[0],
            commanded_m=v[1:4],
            actual_m=v[4:7],
            actual_velocity_m_s=v[7:10],
            phase=_PHASES[v[10]],
        ),
    ),
    AngleSample: Layout(
        "qdd?BdddHdddd",
        lambda m: (
            m.t_valid_ns,
            _absent(m.angle_rad),
            _absent(m.sigma_rad),
            m.valid,
            _REASON_CODE[m.reason],
            _absent(m.raw_rad),
            _absent(m.offset_rad),
            _absent(m.platform_m),
            m.rows,
            _absent(m.residual_px),
            _absent(m.pivot_miss_px),
            m.background,
            m.saturation,
        ),
        lambda seq, t, v: AngleSample(
            seq=seq,
            t_ns=t,
            t_valid_ns=v[0],
            angle_rad=_present(v[1]),
            sigma_rad=_present(v[2]),
            valid=v[3],
            reason=_REASONS[v[4]],
            raw_rad=_present(v[5]),
            offset_rad=_present(v[6]),
            platform_m=_present(v[7]),
            rows=v[8],
            residual_px=_present(v[9]),
            pivot_miss_px=_present(v[10]),
            background=v[11],
            saturation=v[12],
        ),
    ),
    Truth: Layout(
        "dd3d3d",
        lambda m: (m.angle_rad, m.angular_velocity_rad_s, *m.position_m, *m.velocity_m_s),
        lambda seq, t, v: Truth(
            seq=seq,
            t_ns=t,
            angle_rad=v[0],
            angular_velocity_rad_s=v[1],
            position_m=v[2:5],
            velocity_m_s=v[5:8],
        ),
    ),
    Frame: Layout(
        "qqq16s8sHH",
        lambda m: (
            m.t_exposure_start_ns,
            m.exposure_ns,
            m.row_ns,
            m.camera.encode()[:16],
            m.encoding.encode()[:8],
            m.height,
            m.width,
        ),
        lambda seq, t, v: Frame(
            seq=seq,
            t_ns=t,
            t_exposure_start_ns=v[0],
            exposure_ns=v[1],
            row_ns=v[2],
            camera=_text(v[3]),
            encoding=_text(v[4]),
            height=v[5],
            width=v[6],
            pixels=_NO_PIXELS,
        ),
    ),
}


def _text(data: bytes) -> str:
    return data.rstrip(b"\0").decode("ascii", "replace")


class Bound(NamedTuple):
    """Smallest and largest value a field may have on the wire, and whether it may be absent."""

    name: str
    low: float
    high: float
    optional: bool


def bounds(message: type[Message]) -> tuple[Bound, ...]:
    """One bound for each number of the payload, read from the message's own field types."""
    found: list[Bound] = []
    for field in msgspec.inspect.type_info(message).fields[2:]:  # type: ignore[attr-defined]
        if field.name != "pixels":
            found += _field_bounds(field.name, field.type)
    return tuple(found)


def _field_bounds(name: str, kind: Any, optional: bool = False) -> list[Bound]:
    inspect = msgspec.inspect
    if isinstance(kind, inspect.UnionType):
        inner = next(t for t in kind.types if not isinstance(t, inspect.NoneType))
        return _field_bounds(name, inner, optional=True)
    if isinstance(kind, inspect.TupleType):
        return [b for item in kind.item_types for b in _field_bounds(name, item)]
    if isinstance(kind, inspect.EnumType):
        return [Bound(name, 0, len(kind.cls) - 1, False)]
    low, high = getattr(kind, "ge", None), getattr(kind, "le", None)
    return [
        Bound(name, -_FINITE if low is None else low, _FINITE if high is None else high, optional)
    ]


class _Channel(NamedTuple):
    id: int
    layout: Layout
    payload: struct.Struct
    size: int  # of the whole datagram
    limits: tuple[
        tuple[int, float, float, bool], ...
    ]  # payload position, low, high, optional; numbers only


def _compile(name: str) -> _Channel:
    row = CHANNELS[name]
    layout = LAYOUTS[row.message]
    payload = struct.Struct("<" + layout.format)
    blank = payload.unpack(bytes(payload.size))
    limits = tuple(
        (i, b.low, b.high, b.optional)
        for i, b in enumerate(bounds(row.message))
        if not isinstance(blank[i], bytes)
    )
    return _Channel(row.id, layout, payload, HEADER.size + payload.size + CRC.size, limits)


_CHANNELS = {name: _compile(name) for name, row in CHANNELS.items() if row.message in LAYOUTS}


def length(channel: str) -> int:
    """Bytes of a datagram on a channel (for frames: of its head, the pixels follow apart)."""
    return _CHANNELS[channel].size


def encode(channel: str, message: Message, session: int) -> bytes:
    """The datagram of a message; pixels of a Frame are not in it."""
    c = _CHANNELS[channel]
    head = HEADER.pack(MAGIC, VERSION, c.id, c.size, 0, session, message.seq, message.t_ns)
    body = head + c.payload.pack(*c.layout.to_values(message))
    return body + CRC.pack(zlib.crc32(body))


def encode_closing(channel: str, count: int, t_ns: int, session: int) -> bytes:
    """The last datagram of a sender: how many it has put on the wire."""
    body = HEADER.pack(
        MAGIC, VERSION, _CHANNELS[channel].id, HEADER.size + CRC.size, CLOSING, session, count, t_ns
    )
    return body + CRC.pack(zlib.crc32(body))


def decode(channel: str, data: bytes, session: int) -> Message | Closing | Reject:
    """The message in a datagram, or why there is none. Never raises, whatever the bytes."""
    c = _CHANNELS[channel]
    size = len(data)
    if size not in (c.size, HEADER.size + CRC.size):
        return Reject.LENGTH
    magic, version, channel_id, told, flags, of_session, seq, t_ns = HEADER.unpack_from(data)
    refused = _header_refusal(c, data, magic, version, channel_id, told, flags)
    if refused is not None:
        return refused
    if of_session != session:
        return Reject.SESSION
    if flags == CLOSING:
        return Closing(seq)
    if flags or not 0 <= t_ns <= LATEST_NS:
        return Reject.OUT_OF_RANGE
    values = c.payload.unpack_from(data, HEADER.size)
    return _value_refusal(c, values) or c.layout.to_message(seq, t_ns, values)


def _header_refusal(
    c: _Channel, data: bytes, magic: bytes, version: int, channel_id: int, told: int, flags: int
) -> Reject | None:
    if magic != MAGIC:
        return Reject.MAGIC
    if version != VERSION:
        return Reject.VERSION
    if CRC.unpack_from(data, len(data) - CRC.size)[0] != zlib.crc32(data[: -CRC.size]):
        return Reject.CRC
    if channel_id != c.id:
        return Reject.CHANNEL
    expected = HEADER.size + CRC.size if flags == CLOSING else c.size
    return Reject.LENGTH if not told == len(data) == expected else None


def _value_refusal(c: _Channel, values: tuple[Any, ...]) -> Reject | None:
    for i, low, high, optional in c.limits:
        value = values[i]
        if low <= value <= high or (optional and value != value):
            continue
        return Reject.OUT_OF_RANGE if math.isfinite(value) else Reject.NOT_FINITE
    if c.layout is LAYOUTS[AngleSample] and values[3] == (
        values[1] != values[1] or values[2] != values[2]
    ):
        return Reject.OUT_OF_RANGE  # valid says there is an angle, or the other way round
    return None
