"""Second implementation of the wire format, from docs/wire.md.

Layouts, bounds, a strategy for any message, and one receiving end.
"""

from __future__ import annotations

import struct
import zlib
from typing import Any

import msgspec
import numpy as np
from hypothesis import strategies as st

from comms.codec import Closing, Reject, decode
from comms.ends import admit
from comms.link import LinkCount, SequenceWindow
from comms.messages import (
    AngleSample,
    CanMessage,
    Frame,
    JointState,
    LinkAngle,
    LinkMotion,
    Message,
    Reference,
    RobotState,
    Setpoint,
    Space,
    Truth,
)

SESSION = 0x5357_4159_4C45_5353
VERSION = 2
HEADER = "<2sBBHBxQIq"  # magic, version, channel, length, flags, pad, session, seq, t_ns
HEADER_BYTES, CRC_BYTES = 28, 4
CLOSING_BYTES = HEADER_BYTES + CRC_BYTES

POSITION, VELOCITY = ("position_m",) * 3, ("velocity_m_s",) * 3
VALUES = ("space", "count", *("values",) * 6)
RATES = ("rates",) * 6
STATE = (
    "t_actual_ns",
    *("commanded_m",) * 3,
    *("actual_m",) * 3,
    *("actual_velocity_m_s",) * 3,
    "phase",
)
ANGLE = (
    *("t_valid_ns", "swing_plane", "valid", "reason", "platform_m", "rows"),
    *("residual_px", "pivot_miss_px", "background", "saturation"),
)
LINK_ANGLE = ("angle_rad", "sigma_rad", "raw_rad", "offset_rad", "joint_px", "joint_px")
LINK_MOTION = ("angle_x_rad", "angle_y_rad", "rate_x_rad_s", "rate_y_rad_s")
CAN_FRAME = ("can_id", "is_extended", "is_remote", "length", "data")
PICTURE = ("t_exposure_start_ns", "exposure_ns", "row_ns", "camera", "encoding", "height", "width")
# channel: id in the header, message, payload, name of each value of the payload; with one link
WIRE: dict[str, tuple[int, type[Message], str, tuple[str, ...]]] = {
    "reference": (3, Reference, "q3d", ("t_target_ns", *POSITION)),
    "setpoint": (4, Setpoint, "2B6d", VALUES),
    "joint_state": (5, JointState, "2B12d", VALUES + RATES),
    "robot_state": (6, RobotState, "q9dB", STATE),
    "platform_1": (7, RobotState, "q9dB", STATE),
    "frame_1": (8, Frame, "qqq16s8sHH", PICTURE),
    "angle_1": (9, AngleSample, "qB?BdH4d6d", ANGLE + LINK_ANGLE),
    "truth": (10, Truth, "6d4d", POSITION + VELOCITY + LINK_MOTION),
    "can_down": (11, CanMessage, "I??B8s", CAN_FRAME),
    "can_up": (12, CanMessage, "I??B8s", CAN_FRAME),
    "platform_2": (13, RobotState, "q9dB", STATE),
    "frame_2": (14, Frame, "qqq16s8sHH", PICTURE),
    "angle_2": (15, AngleSample, "qB?BdH4d6d", ANGLE + LINK_ANGLE),
    "platform_3": (16, RobotState, "q9dB", STATE),
    "frame_3": (17, Frame, "qqq16s8sHH", PICTURE),
    "angle_3": (18, AngleSample, "qB?BdH4d6d", ANGLE + LINK_ANGLE),
}
# channel: payload of one link, and the most links of a message
LINKS = {"angle_1": ("6d", 3), "angle_2": ("6d", 3), "angle_3": ("6d", 3), "truth": ("4d", 256)}
MOST_DRAWN = {LinkAngle: 3, LinkMotion: 5}
# and what is not 0 in a message of zeros
ZEROS = {"valid": True, "space": 1, "count": 6, "is_extended": True}
METRES = {"values": 10.0, "rates": 100.0}  # bounds of the values where the space is metres
WITHOUT_BOUNDS: dict[type, st.SearchStrategy[Any]] = {
    msgspec.inspect.BoolType: st.booleans(),
    msgspec.inspect.BytesType: st.binary(max_size=8),
    msgspec.inspect.NoneType: st.none(),
}
channels = st.sampled_from(tuple(WIRE))


def length(channel: str, links: int = 1) -> int:
    """Length of a datagram with a number of links; of any datagram on a channel without links."""
    whole = HEADER_BYTES + struct.calcsize("<" + WIRE[channel][2]) + CRC_BYTES
    if channel not in LINKS:
        return whole
    return whole + (links - 1) * struct.calcsize("<" + LINKS[channel][0])


def lengths(channel: str, most: int = 256) -> list[int]:
    """Lengths of the messages of a channel, with at most that many links."""
    known = min(most, LINKS[channel][1]) if channel in LINKS else 0
    return [length(channel, links) for links in range(known + 1)]


def links_of(message: Message) -> int:
    """Number of links of a message; 0 for one that has none."""
    return len(getattr(message, "links", ()))


def datagram(
    channel: str,
    payload: bytes,
    *,
    magic: bytes = b"SW",
    version: int = VERSION,
    flags: int = 0,
    session: int = SESSION,
    seq: int = 0,
    t_ns: int = 0,
    length: int = 0,
) -> bytes:
    """Build a datagram with a valid CRC, and with its true length unless another is given."""
    size = length or HEADER_BYTES + len(payload) + CRC_BYTES
    body = (
        struct.pack(HEADER, magic, version, WIRE[channel][0], size, flags, session, seq, t_ns)
        + payload
    )
    return body + struct.pack("<I", zlib.crc32(body))


def zeros(channel: str) -> list[Any]:
    """Payload values that are all zero but those of ZEROS; a valid message on every channel."""
    payload, names = "<" + WIRE[channel][2], WIRE[channel][3]
    values = struct.unpack(payload, bytes(struct.calcsize(payload)))
    return [ZEROS.get(name, value) for name, value in zip(names, values, strict=True)]


def with_values(channel: str, changes: dict[int, Any]) -> bytes:
    """Build a datagram of zeros except for the values at some places of its payload."""
    values = zeros(channel)
    for place, value in changes.items():
        values[place] = value
    return datagram(channel, struct.pack("<" + WIRE[channel][2], *values))


def with_value(channel: str, place: int, value: Any) -> bytes:
    """Build a datagram of zeros except for one value of its payload."""
    return with_values(channel, {place: value})


def messages(channel: str) -> st.SearchStrategy[Any]:
    """Strategy for any message of a channel, each field within the bounds of its type."""
    kind = WIRE[channel][1]
    if kind is Frame:
        return frames()
    fields = msgspec.inspect.type_info(kind).fields  # type: ignore[attr-defined]
    values = {field.name: _values(field.type) for field in fields}
    return st.fixed_dictionaries(values).map(lambda values: kind(**_consistent(values)))


def _consistent(values: dict[str, Any]) -> dict[str, Any]:
    if "valid" in values:
        values["valid"] = len(values["links"]) > 0
    if "can_id" in values:
        values["can_id"] &= 0x1FFF_FFFF if values["is_extended"] else 0x7FF
        padded = values["data"].ljust(8, b"\xa5")
        values["data"] = b"" if values["is_remote"] else padded[: values["length"]]
    for name in METRES.keys() & values.keys():
        scale = 0.01 if values["space"] is Space.METRES else 1.0  # to the bounds of metres
        used = [scale * value for value in values[name][: values["count"]]]
        values[name] = (*used, *[0.0] * (6 - len(used)))
    return values


def _values(kind: Any) -> st.SearchStrategy[Any]:
    inspect = msgspec.inspect
    if type(kind) in WITHOUT_BOUNDS:
        return WITHOUT_BOUNDS[type(kind)]
    match kind:
        case inspect.IntType():
            return st.integers(kind.ge, kind.le)
        case inspect.FloatType():
            return st.floats(kind.ge, kind.le, allow_nan=False, allow_infinity=False)
        case inspect.EnumType():
            return st.sampled_from(tuple(kind.cls))
        case inspect.TupleType():
            return st.tuples(*(_values(item) for item in kind.item_types))
        case inspect.VarTupleType():
            most = MOST_DRAWN[kind.item_type.cls]
            return st.lists(_values(kind.item_type), max_size=most).map(tuple)
        case inspect.StructType():
            fields = {field.name: _values(field.type) for field in kind.fields}
            return st.builds(kind.cls, **fields)
        case inspect.UnionType():
            return st.one_of(*(_values(item) for item in kind.types))
        case _:
            raise TypeError(f"no strategy for {kind}: add one")


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """Strategy for a small frame with random pixels, grey or in colour."""
    height, width, planes = (
        draw(st.integers(1, 12)),
        draw(st.integers(1, 12)),
        draw(st.sampled_from([1, 3])),
    )
    shape = (height, width) if planes == 1 else (height, width, 3)
    times = st.integers(0, 2**62)
    return Frame(
        seq=draw(st.integers(0, 2**32 - 1)),
        t_ns=draw(times),
        t_exposure_start_ns=draw(times),
        exposure_ns=draw(times),
        row_ns=draw(times),
        camera=draw(st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=16)),
        encoding="mono8" if planes == 1 else "bgr8",
        height=height,
        width=width,
        pixels=np.frombuffer(
            draw(st.binary(min_size=height * width * planes, max_size=height * width * planes)),
            np.uint8,
        ).reshape(shape),
    )


def field_values(message: Message) -> dict[str, Any]:
    """Fields of a message without its pixels, for a comparison."""
    return {
        name: value for name, value in msgspec.structs.asdict(message).items() if name != "pixels"
    }


class Gate:
    """Receiving end: takes bytes, gives a message or None and the counters that increased."""

    def __init__(self, channel: str) -> None:
        self._channel = channel
        self._window = SequenceWindow()
        self.count = LinkCount()
        self.receipts: list[tuple[int, int, str]] = []

    def take(
        self, data: bytes, t_ns: int = 0, late_ns: int = 0
    ) -> tuple[Message | None, dict[str, int]]:
        """Decode and admit one datagram."""
        return self.admit(decode(self._channel, data, SESSION), t_ns, late_ns)

    def admit(
        self, got: Message | Closing | Reject, t_ns: int = 0, late_ns: int = 0
    ) -> tuple[Message | None, dict[str, int]]:
        """Admit a decoded item."""
        before = _counters(self.count)
        message = admit(got, self._window, self.count, late_ns, t_ns, self.receipts)
        after = _counters(self.count)
        return message, {
            name: n - before.get(name, 0) for name, n in after.items() if n != before.get(name, 0)
        }


def _counters(count: LinkCount) -> dict[str, int]:
    plain = {
        name: value
        for name, value in msgspec.structs.asdict(count).items()
        if isinstance(value, int)
    }
    return plain | {f"rejected {reason}": n for reason, n in count.rejected.items()}
