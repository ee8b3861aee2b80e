"""Datagrams: header, payload and CRC-32. Invalid bytes are rejected with a reason, never raised.

Header, little-endian: magic "SW", version, channel, length, flags, pad, session, seq, t_ns.
NaN in a value that may not be absent, and every infinity, is rejected.
"""

from __future__ import annotations

import enum
import math
import struct
import zlib
from functools import cache
from typing import Any, NamedTuple

from comms.channels import CHANNELS
from comms.layouts import LAYOUTS, Layout, bounds, group_bounds
from comms.messages import Message

MAGIC = b"SW"
VERSION = 2
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


class _Payload(NamedTuple):
    """Compiled payload with a number of links."""

    struct: struct.Struct
    size: int  # of the whole datagram
    limits: tuple[_Limit, ...]  # of the numbers, not of the texts


class _Channel(NamedTuple):
    """Compiled layout of a channel; the last three are those of one link, 0 without links."""

    id: int
    message: type[Message]
    layout: Layout
    fixed: _Payload  # without links
    values: int  # in the payload without links
    link_size: int
    link_values: int
    most_links: int


def _compile(name: str) -> _Channel:
    row = CHANNELS[name]
    layout = LAYOUTS[row.message]
    group = layout.group
    return _Channel(
        row.id,
        row.message,
        layout,
        _payload(row.message, 0),
        len(bounds(row.message)),
        struct.calcsize("<" + group.format) if group else 0,
        len(group_bounds(row.message)),
        group.most if group else 0,
    )


@cache
def _payload(message: type[Message], links: int) -> _Payload:
    layout = LAYOUTS[message]
    group = layout.group.format if layout.group else ""
    payload = struct.Struct("<" + layout.format + group * links)
    zeros = payload.unpack(bytes(payload.size))
    limits = []
    for place, bound in enumerate(bounds(message) + group_bounds(message) * links):
        if not isinstance(zeros[place], bytes):
            limits.append(_Limit(place, bound.low, bound.high, bound.optional))
    return _Payload(payload, HEADER.size + payload.size + CRC.size, tuple(limits))


_CHANNELS = {name: _compile(name) for name, row in CHANNELS.items() if row.message in LAYOUTS}


def length(channel: str, links: int = 0) -> int:
    """Return the length of a datagram of a channel [bytes]; without the pixels of a frame."""
    c = _CHANNELS[channel]
    return c.fixed.size + links * c.link_size


def link_length(channel: str) -> int:
    """Return the length that each link adds to a datagram of a channel [bytes]; 0 if none may."""
    return _CHANNELS[channel].link_size


def _payload_with(c: _Channel, extra: int, each: int) -> _Payload | None:
    """Find the payload with `extra` bytes or values of links, of which each has `each`."""
    if extra == 0:
        return c.fixed
    links, rest = divmod(extra, each) if each else (0, 1)
    if rest or not 0 < links <= c.most_links:
        return None
    return _payload(c.message, links)


def encode(channel: str, message: Message, session: int) -> bytes:
    """Encode a message as a datagram; without the pixels of a frame.

    Raises ValueError for a message with more links than it may have.
    """
    c = _CHANNELS[channel]
    values = c.layout.to_values(message)
    payload = _payload_with(c, len(values) - c.values, c.link_values)
    if payload is None:
        links = (len(values) - c.values) // c.link_values
        raise ValueError(f"{channel}: {links} links; must be <= {c.most_links}")
    head = HEADER.pack(MAGIC, VERSION, c.id, payload.size, 0, session, message.seq, message.t_ns)
    body = head + payload.struct.pack(*values)
    return body + CRC.pack(zlib.crc32(body))


def encode_closing(channel: str, count: int, t_ns: int, session: int) -> bytes:
    """Encode the last datagram of a sender, with the number of datagrams it sent."""
    channel_id = _CHANNELS[channel].id
    body = HEADER.pack(MAGIC, VERSION, channel_id, CLOSING_BYTES, CLOSING, session, count, t_ns)
    return body + CRC.pack(zlib.crc32(body))


def decode(channel: str, data: bytes, session: int) -> Message | Closing | Reject:
    """Decode a datagram, or give the reason to reject it; never raises."""
    c = _CHANNELS[channel]
    payload = _payload_with(c, len(data) - c.fixed.size, c.link_size)
    if payload is None and len(data) != CLOSING_BYTES:
        return Reject.LENGTH
    magic, version, channel_id, size, flags, sender_session, seq, t_ns = HEADER.unpack_from(data)
    rejection = _check_header(c, data, magic, version, channel_id, size, flags)
    if rejection is not None:
        return rejection
    if sender_session != session:
        return Reject.SESSION
    if flags == CLOSING:
        return Closing(seq)
    if payload is None or flags or not 0 <= t_ns <= MAX_TIME_NS:
        return Reject.OUT_OF_RANGE
    values = payload.struct.unpack_from(data, HEADER.size)
    return _check_values(c, payload, values) or c.layout.to_message(seq, t_ns, values)


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
    is_closing = len(data) == CLOSING_BYTES
    return None if size == len(data) and is_closing == (flags == CLOSING) else Reject.LENGTH


def _check_values(c: _Channel, payload: _Payload, values: tuple[Any, ...]) -> Reject | None:
    for place, low, high, optional in payload.limits:
        value = values[place]
        if low <= value <= high or (optional and value != value):
            continue
        return Reject.OUT_OF_RANGE if math.isfinite(value) else Reject.NOT_FINITE
    is_consistent = c.layout.is_consistent
    if is_consistent is not None and not is_consistent(values):
        return Reject.OUT_OF_RANGE
    return None
