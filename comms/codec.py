"""Datagrams: header, payload and CRC-32. Invalid bytes are rejected with a reason, never raised.

Header, little-endian: magic "SW", version, channel, length, flags, pad, session, seq, t_ns.
NaN in a value that may not be absent, and every infinity, is rejected.
"""

from __future__ import annotations

import enum
import math
import struct
import zlib
from typing import Any, NamedTuple

from comms.channels import CHANNELS
from comms.layouts import LAYOUTS, Layout, bounds
from comms.messages import AngleSample, Message

MAGIC = b"SW"
VERSION = 1
CLOSING = 1  # flag: no payload; seq is the number of datagrams that were sent
MAX_TIME_NS = 2**62  # the bound of messages.TimeNs
HEADER = struct.Struct("<2sBBHBxQIq")
CRC = struct.Struct("<I")
CLOSING_BYTES = HEADER.size + CRC.size


class Reject(enum.Enum):
    """Reason to reject a datagram, in the order of the checks."""

    LENGTH = "length"
    MAGIC = "magic"
    VERSION = "version"
    CRC = "crc"
    CHANNEL = "channel"
    SESSION = "session"
    NOT_FINITE = "not_finite"
    OUT_OF_RANGE = "out_of_range"


class Closing(NamedTuple):
    """Last message of a sender: the number of datagrams it sent."""

    datagrams: int


class _Limit(NamedTuple):
    """Bound of one number of the payload."""

    place: int  # in the payload
    low: float
    high: float
    optional: bool  # NaN is allowed


class _Channel(NamedTuple):
    """Compiled layout of a channel."""

    id: int
    layout: Layout
    payload: struct.Struct
    size: int  # of the whole datagram
    limits: tuple[_Limit, ...]  # of the numbers, not of the texts


def _compile(name: str) -> _Channel:
    row = CHANNELS[name]
    layout = LAYOUTS[row.message]
    payload = struct.Struct("<" + layout.format)
    zeros = payload.unpack(bytes(payload.size))
    limits = []
    for place, bound in enumerate(bounds(row.message)):
        if not isinstance(zeros[place], bytes):
            limits.append(_Limit(place, bound.low, bound.high, bound.optional))
    size = HEADER.size + payload.size + CRC.size
    return _Channel(row.id, layout, payload, size, tuple(limits))


_CHANNELS = {name: _compile(name) for name, row in CHANNELS.items() if row.message in LAYOUTS}


def length(channel: str) -> int:
    """Return the length of a datagram of a channel [bytes]; without the pixels of a frame."""
    return _CHANNELS[channel].size


def encode(channel: str, message: Message, session: int) -> bytes:
    """Encode a message as a datagram; without the pixels of a frame."""
    c = _CHANNELS[channel]
    head = HEADER.pack(MAGIC, VERSION, c.id, c.size, 0, session, message.seq, message.t_ns)
    body = head + c.payload.pack(*c.layout.to_values(message))
    return body + CRC.pack(zlib.crc32(body))


def encode_closing(channel: str, count: int, t_ns: int, session: int) -> bytes:
    """Encode the last datagram of a sender, with the number of datagrams it sent."""
    channel_id = _CHANNELS[channel].id
    body = HEADER.pack(MAGIC, VERSION, channel_id, CLOSING_BYTES, CLOSING, session, count, t_ns)
    return body + CRC.pack(zlib.crc32(body))


def decode(channel: str, data: bytes, session: int) -> Message | Closing | Reject:
    """Decode a datagram, or give the reason to reject it; never raises."""
    c = _CHANNELS[channel]
    if len(data) not in (c.size, CLOSING_BYTES):
        return Reject.LENGTH
    magic, version, channel_id, size, flags, sender_session, seq, t_ns = HEADER.unpack_from(data)
    rejection = _check_header(c, data, magic, version, channel_id, size, flags)
    if rejection is not None:
        return rejection
    if sender_session != session:
        return Reject.SESSION
    if flags == CLOSING:
        return Closing(seq)
    if flags or not 0 <= t_ns <= MAX_TIME_NS:
        return Reject.OUT_OF_RANGE
    values = c.payload.unpack_from(data, HEADER.size)
    return _check_values(c, values) or c.layout.to_message(seq, t_ns, values)


def _check_header(
    c: _Channel, data: bytes, magic: bytes, version: int, channel_id: int, size: int, flags: int
) -> Reject | None:
    if magic != MAGIC:
        return Reject.MAGIC
    if version != VERSION:
        return Reject.VERSION
    if CRC.unpack_from(data, len(data) - CRC.size)[0] != zlib.crc32(data[: -CRC.size]):
        return Reject.CRC
    if channel_id != c.id:
        return Reject.CHANNEL
    expected = CLOSING_BYTES if flags == CLOSING else c.size
    return None if size == len(data) == expected else Reject.LENGTH


def _check_values(c: _Channel, values: tuple[Any, ...]) -> Reject | None:
    for place, low, high, optional in c.limits:
        value = values[place]
        if low <= value <= high or (optional and value != value):
            continue
        return Reject.OUT_OF_RANGE if math.isfinite(value) else Reject.NOT_FINITE
    if c.layout is LAYOUTS[AngleSample]:
        _, angle_rad, sigma_rad, valid = values[:4]
        absent = angle_rad != angle_rad or sigma_rad != sigma_rad
        if valid == absent:  # a valid sample has both, an invalid one lacks one of them
            return Reject.OUT_OF_RANGE
    return None
