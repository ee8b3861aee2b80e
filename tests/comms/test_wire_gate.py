"""Rejection of invalid datagrams: nothing is raised, each packet increases exactly one counter."""

from __future__ import annotations

import math
import struct

import msgspec
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from comms.codec import encode, encode_closing
from comms.messages import (
    AngleSample,
    CanMessage,
    JointState,
    Message,
    Reference,
    Setpoint,
    Space,
    axis_setpoint,
)
from tests.comms.wire_reference import (
    CLOSING_BYTES,
    CRC_BYTES,
    HEADER_BYTES,
    LINK_MOTION,
    LINKS,
    METRES,
    SESSION,
    VERSION,
    WIRE,
    Gate,
    channels,
    datagram,
    field_values,
    lengths,
    messages,
    with_value,
    with_values,
    zeros,
)

UNTIMED = settings(deadline=None)  # a busy machine is no failure
cases = channels.flatmap(lambda name: st.tuples(st.just(name), messages(name)))
pairs = channels.flatmap(lambda name: st.tuples(st.just(name), messages(name), messages(name)))

BOUND: dict[str, tuple[float, float]] = {
    **dict.fromkeys(
        (
            "t_target_ns",
            "t_actual_ns",
            "t_valid_ns",
            "t_exposure_start_ns",
            "exposure_ns",
            "row_ns",
        ),
        (0, 2**62),
    ),
    **dict.fromkeys(("position_m", "commanded_m", "actual_m", "platform_m"), (-10.0, 10.0)),
    **dict.fromkeys(("velocity_m_s", "actual_velocity_m_s"), (-100.0, 100.0)),
    "values": (-1e3, 1e3),
    "rates": (-1e4, 1e4),
    **dict.fromkeys(("angle_rad", "raw_rad", "offset_rad"), (-1.6, 1.6)),
    "sigma_rad": (0.0, 1.6),
    "residual_px": (0.0, 1e4),
    **dict.fromkeys(("pivot_miss_px", "joint_px"), (-1e5, 1e5)),
    "background": (0.0, 255.0),
    "saturation": (0.0, 1.0),
    "phase": (0, 4),
    "reason": (0, 13),
    "space": (0, 1),
    "swing_plane": (0, 1),
    "count": (1, 6),
    "can_id": (0, 2**29 - 1),
    "length": (0, 8),
}
UNSIGNED = ("phase", "reason", "space", "swing_plane", "count", "can_id", "length")
# in a valid sample too
MAY_BE_ABSENT = {"platform_m", "residual_px", "pivot_miss_px"}
VALUES = [
    (channel, place, name) for channel, row in WIRE.items() for place, name in enumerate(row[3])
]
BOUNDED = [value for value in VALUES if value[2] in BOUND]
FLOATS = [value for value in BOUNDED if isinstance(BOUND[value[2]][1], float)]
FLOATS += [value for value in VALUES if value[2] in LINK_MOTION]
JOINTS = [value for value in VALUES if value[2] in METRES]
SPACE, COUNT, FIRST_JOINT = 0, 1, 2  # places in a setpoint and in a joint state
IN_METRES, IN_RADIANS = 0, 1
CAN_ID, IS_EXTENDED, IS_REMOTE, LENGTH, DATA = range(5)  # places in a frame of the field bus
# of version 1, from its page
OLD_REFERENCE = (
    "53570103400000005353454c59415753010000000a00000000000000"
    "1400000000000000000000000000e03f000000000000d0bf0000000000000040ce2ca619"
)
OLD_SETPOINT = (
    "53570104380000005353454c59415753020000000500000000000000"
    "000000000000e03f0000000000000000000000000000f0bf64b7ced5"
)


def refusal(gate: Gate, data: bytes) -> str:
    """Reject reason of a datagram; exactly one counter must increase."""
    message, up = gate.take(data)
    assert message is None
    assert list(up.values()) == [1]
    assert gate.receipts == []
    return next(iter(up)).removeprefix("rejected ")


def is_refused(channel: str, original: Message, data: bytes) -> str:
    """Reject reason of a datagram; the original message is delivered after it."""
    gate = Gate(channel)
    reason = refusal(gate, data)
    message, up = gate.take(encode(channel, original, SESSION))
    assert type(message) is type(original)
    assert up == {"delivered": 1}
    return reason


@UNTIMED
@given(cases, st.sets(st.integers(0, 8 * 32 - 1), min_size=1, max_size=3))
def test_up_to_three_flipped_bits_are_always_noticed(
    case: tuple[str, Message], bits: set[int]
) -> None:
    channel, message = case
    data = bytearray(encode(channel, message, SESSION))
    for bit in {b * len(data) // 32 for b in bits}:  # anywhere, whatever the length
        data[bit // 8] ^= 1 << bit % 8
    assert is_refused(channel, message, bytes(data)) in {"magic", "version", "crc"}


def reason_by_length(channel: str, size: int) -> str:
    """Reject reason of damaged bytes: those of a good length are found by their CRC."""
    return "crc" if size in (CLOSING_BYTES, *lengths(channel)) else "length"


@UNTIMED
@given(cases, st.data())
def test_a_cut_datagram_is_refused(case: tuple[str, Message], data: st.DataObject) -> None:
    channel, message = case
    whole = encode(channel, message, SESSION)
    keep = data.draw(st.integers(0, len(whole) - 1))
    assert is_refused(channel, message, whole[:keep]) == reason_by_length(channel, keep)


@UNTIMED
@given(cases, st.binary(min_size=1, max_size=64))
def test_a_datagram_with_something_behind_it_is_refused(
    case: tuple[str, Message], tail: bytes
) -> None:
    channel, message = case
    longer = encode(channel, message, SESSION) + tail
    assert is_refused(channel, message, longer) == reason_by_length(channel, len(longer))


@UNTIMED
@given(pairs, st.data())
def test_a_splice_of_two_datagrams_is_refused(
    pair: tuple[str, Message, Message], data: st.DataObject
) -> None:
    channel, first, second = pair
    head, tail = encode(channel, first, SESSION), encode(channel, second, SESSION)
    at = data.draw(st.integers(1, len(head) - 1))
    splice = head[:at] + tail[at:]
    assume(splice not in (head, tail))
    assert is_refused(channel, first, splice) == reason_by_length(channel, len(splice))


@UNTIMED
@given(cases, st.integers(0, 2**64 - 1))
def test_a_datagram_of_another_session_is_refused(case: tuple[str, Message], session: int) -> None:
    channel, message = case
    assume(session != SESSION)
    assert is_refused(channel, message, encode(channel, message, session)) == "session"


@UNTIMED
@given(cases, channels)
def test_a_datagram_of_another_channel_is_refused(case: tuple[str, Message], other: str) -> None:
    channel, message = case
    assume(other != channel)
    data = encode(channel, message, SESSION)
    reason = "channel" if len(data) in lengths(other) else "length"
    assert refusal(Gate(other), data) == reason


def test_a_closing_datagram_of_another_channel_or_session_closes_nothing() -> None:
    assert refusal(Gate("angle_1"), encode_closing("platform_1", 5, 0, SESSION)) == "channel"
    assert refusal(Gate("angle_1"), encode_closing("angle_1", 5, 0, SESSION + 1)) == "session"


def test_a_closing_datagram_moves_no_counter() -> None:
    assert Gate("angle_1").take(encode_closing("angle_1", 5, 0, SESSION)) == (None, {})


@UNTIMED
@given(channels, st.binary(max_size=200))
def test_garbage_is_refused(channel: str, data: bytes) -> None:
    assert refusal(Gate(channel), data) in {"length", "magic"}


@UNTIMED
@given(channels, st.data())
def test_garbage_of_the_right_length_is_refused(channel: str, data: st.DataObject) -> None:
    size = data.draw(st.sampled_from([*lengths(channel, most=5), CLOSING_BYTES]))
    assert refusal(Gate(channel), data.draw(st.binary(min_size=size, max_size=size))) in {
        "magic",
        "version",
        "crc",
    }


@UNTIMED
@given(channels, st.data(), st.integers(-(2**63), 2**63 - 1), st.integers(0, 2**32 - 1))
def test_any_payload_behind_a_right_header_is_a_message_within_its_bounds_or_refused(
    channel: str, data: st.DataObject, t_ns: int, seq: int
) -> None:
    size = data.draw(st.sampled_from(lengths(channel, most=5))) - CLOSING_BYTES
    payload = data.draw(st.binary(min_size=size, max_size=size))
    message, up = Gate(channel).take(
        datagram(channel, payload, seq=seq, t_ns=t_ns), t_ns=2**62, late_ns=2**62
    )
    if message is None:
        assert list(up.values()) == [1]
        assert up.keys() <= {"rejected not_finite", "rejected out_of_range"}
    else:
        assert up == {"delivered": 1}
        is_within_its_bounds(message)


def is_within_its_bounds(message: Message) -> None:
    """Assert the declared bounds; msgspec raises if a field is outside."""
    fields = msgspec.to_builtins(field_values(message)) | {"pixels": None}
    msgspec.convert(fields, type(message), dec_hook=lambda _, __: np.empty(0, np.uint8))
    if isinstance(message, AngleSample):
        assert message.valid == (len(message.links) > 0)
    if isinstance(message, Setpoint | JointState):
        for name in METRES.keys() & fields.keys():
            assert not any(fields[name][message.count :])
            if message.space is Space.METRES:
                assert max(map(abs, fields[name])) <= METRES[name]


@UNTIMED
@given(cases, st.binary(min_size=4, max_size=4))
def test_a_header_with_another_magic_version_length_or_flag_is_refused(
    case: tuple[str, Message], noise: bytes
) -> None:
    channel, message = case
    whole = encode(channel, message, SESSION)
    payload = whole[HEADER_BYTES:-CRC_BYTES]
    assume(noise[:2] != b"SW" and noise[2] != VERSION and noise[3] not in (0, 1))
    assert is_refused(channel, message, datagram(channel, payload, magic=noise[:2])) == "magic"
    assert is_refused(channel, message, datagram(channel, payload, version=noise[2])) == "version"
    assert (
        is_refused(channel, message, datagram(channel, payload, flags=noise[3])) == "out_of_range"
    )
    assert (
        is_refused(channel, message, datagram(channel, payload, flags=1)) == "length"
    )  # closing, with a payload
    assert is_refused(channel, message, datagram(channel, b"")) == "length"  # a message without one
    assert (
        is_refused(channel, message, datagram(channel, payload, length=len(whole) + 1 + noise[0]))
        == "length"
    )


@pytest.mark.parametrize(("channel", "place", "name"), BOUNDED)
def test_the_bound_itself_is_accepted_and_the_next_value_is_not(
    channel: str, place: int, name: str
) -> None:
    low, high = BOUND[name]
    whole = isinstance(high, int)
    for bound, outward in ((low, -math.inf), (high, math.inf)):
        _, up = Gate(channel).take(with_value(channel, place, bound))
        assert up == {"delivered": 1}
        beyond = bound + (1 if outward > 0 else -1) if whole else math.nextafter(bound, outward)
        if name not in UNSIGNED or beyond >= 0:
            assert refusal(Gate(channel), with_value(channel, place, beyond)) == "out_of_range"


@pytest.mark.parametrize(("channel", "place", "name"), FLOATS)
def test_an_infinite_value_is_refused_and_a_nan_too_unless_it_may_be_absent(
    channel: str, place: int, name: str
) -> None:
    for infinite in (math.inf, -math.inf):
        assert refusal(Gate(channel), with_value(channel, place, infinite)) == "not_finite"
    nan = with_value(channel, place, math.nan)
    if WIRE[channel][1] is AngleSample and name in MAY_BE_ABSENT:
        message, up = Gate(channel).take(nan)
        assert up == {"delivered": 1}
        assert getattr(message, name) is None
    elif name == "joint_px":
        assert refusal(Gate(channel), nan) == "out_of_range"  # one coordinate alone is absent
    else:
        assert refusal(Gate(channel), nan) == "not_finite"


def test_a_joint_has_both_coordinates_or_none() -> None:
    column, row = (k for k, name in enumerate(WIRE["angle_1"][3]) if name == "joint_px")
    absent, present = (math.nan, math.nan), (320.0, -58.0)
    for there, expected in ((absent, None), (present, present)):
        data = with_values("angle_1", {column: there[0], row: there[1]})
        message, up = Gate("angle_1").take(data)
        assert up == {"delivered": 1}
        assert isinstance(message, AngleSample)
        assert [link.joint_px for link in message.links] == [expected]
    for half in ({column: math.nan, row: -58.0}, {column: 320.0, row: math.nan}):
        assert refusal(Gate("angle_1"), with_values("angle_1", half)) == "out_of_range"


def test_an_angle_that_is_there_but_not_valid_is_refused() -> None:
    place = WIRE["angle_1"][3].index("valid")
    assert refusal(Gate("angle_1"), with_value("angle_1", place, False)) == "out_of_range"


def with_links(channel: str, links: int, **changes: bool) -> bytes:
    """Build a datagram of zeros with a number of links."""
    values, names = zeros(channel), WIRE[channel][3]
    for name, value in changes.items():
        values[names.index(name)] = value
    link = struct.calcsize("<" + LINKS[channel][0])
    without = struct.pack("<" + WIRE[channel][2], *values)[:-link]
    return datagram(channel, without + bytes(links * link))


def test_an_angle_is_valid_exactly_with_links() -> None:
    for links in range(4):
        for valid in (False, True):
            data = with_links("angle_1", links, valid=valid)
            message, up = Gate("angle_1").take(data)
            if valid == (links > 0):
                assert up == {"delivered": 1}
                assert isinstance(message, AngleSample)
                assert len(message.links) == links
            else:
                assert up == {"rejected out_of_range": 1}


@pytest.mark.parametrize(("channel", "most"), [("angle_1", 3), ("angle_3", 3), ("truth", 256)])
def test_a_datagram_with_more_links_than_allowed_is_refused_by_its_length(
    channel: str, most: int
) -> None:
    assert Gate(channel).take(with_links(channel, most))[1] == {"delivered": 1}
    for links in (most + 1, most + 2, 2 * most):
        assert refusal(Gate(channel), with_links(channel, links)) == "length"


@pytest.mark.parametrize("channel", LINKS)
@pytest.mark.parametrize("more", [-1, 1, 8, 24])
def test_a_link_that_is_not_whole_is_refused_by_the_length(channel: str, more: int) -> None:
    payload = with_links(channel, 2)[HEADER_BYTES:-CRC_BYTES]
    changed = payload[:more] if more < 0 else payload + bytes(more)
    assert refusal(Gate(channel), datagram(channel, changed)) == "length"


@pytest.mark.parametrize("channel", LINKS)
def test_a_link_cut_off_behind_a_right_crc_is_refused_by_the_length_in_the_header(
    channel: str,
) -> None:
    two, one = with_links(channel, 2), with_links(channel, 1)
    changed = datagram(channel, one[HEADER_BYTES:-CRC_BYTES], length=len(two))
    assert refusal(Gate(channel), changed) == "length"


@pytest.mark.parametrize(("channel", "place", "name"), JOINTS)
def test_a_value_beyond_the_count_of_the_joints_must_be_0(
    channel: str, place: int, name: str
) -> None:
    joint = (place - FIRST_JOINT) % 6
    for space in (IN_METRES, IN_RADIANS):
        for count in range(1, 7):
            for value in (0.5, -1e-9):
                changes = {SPACE: space, COUNT: count, place: value}
                _, up = Gate(channel).take(with_values(channel, changes))
                accepted = joint < count
                assert up == ({"delivered": 1} if accepted else {"rejected out_of_range": 1})


@pytest.mark.parametrize(("channel", "place", "name"), JOINTS)
def test_a_value_in_metres_has_the_bounds_of_a_position_or_velocity_and_in_radians_not(
    channel: str, place: int, name: str
) -> None:
    for bound in (METRES[name], -METRES[name]):
        beyond = math.nextafter(bound, math.copysign(math.inf, bound))
        for value in (beyond, 2.0 * bound):
            in_metres = with_values(channel, {SPACE: IN_METRES, place: value})
            assert refusal(Gate(channel), in_metres) == "out_of_range"
            in_radians = with_values(channel, {SPACE: IN_RADIANS, place: value})
            assert Gate(channel).take(in_radians)[1] == {"delivered": 1}
        at_bound = with_values(channel, {SPACE: IN_METRES, place: bound})
        assert Gate(channel).take(at_bound)[1] == {"delivered": 1}


@pytest.mark.parametrize("channel", ["can_down", "can_up"])
def test_an_identifier_of_more_than_11_bits_is_of_an_extended_frame_alone(channel: str) -> None:
    for can_id, accepted in ((0x7FF, True), (0x800, False), (2**29 - 1, False)):
        base = with_values(channel, {CAN_ID: can_id, IS_EXTENDED: False})
        extended = with_values(channel, {CAN_ID: can_id, IS_EXTENDED: True})
        assert Gate(channel).take(extended)[1] == {"delivered": 1}
        expected = "delivered" if accepted else "rejected out_of_range"
        assert Gate(channel).take(base)[1] == {expected: 1}


@pytest.mark.parametrize("channel", ["can_down", "can_up"])
@pytest.mark.parametrize("is_remote", [False, True])
@pytest.mark.parametrize("length", range(9))
def test_a_byte_beyond_the_length_of_a_frame_must_be_0(
    channel: str, is_remote: bool, length: int
) -> None:
    used = 0 if is_remote else length
    for byte in range(8):
        data = bytes(byte) + b"\x80" + bytes(7 - byte)
        changes = {IS_REMOTE: is_remote, LENGTH: length, DATA: data}
        message, up = Gate(channel).take(with_values(channel, changes))
        if byte >= used:
            assert up == {"rejected out_of_range": 1}
            continue
        assert isinstance(message, CanMessage)
        assert (message.length, message.data) == (length, data[:length])


def test_a_datagram_of_version_1_is_refused() -> None:
    assert refusal(Gate("reference"), bytes.fromhex(OLD_REFERENCE)) == "version"
    assert refusal(Gate("setpoint"), bytes.fromhex(OLD_SETPOINT)) == "length"


@pytest.mark.parametrize("channel", WIRE)
def test_a_payload_of_today_under_version_1_is_refused(channel: str) -> None:
    payload = with_values(channel, {})[HEADER_BYTES:-CRC_BYTES]
    assert Gate(channel).take(datagram(channel, payload))[1] == {"delivered": 1}
    assert refusal(Gate(channel), datagram(channel, payload, version=1)) == "version"


@pytest.mark.parametrize("t_ns", [-1, 2**62 + 1])
def test_a_stamp_out_of_its_bounds_is_refused(t_ns: int) -> None:
    payload = with_values("setpoint", {})[HEADER_BYTES:-CRC_BYTES]
    assert refusal(Gate("setpoint"), datagram("setpoint", payload, t_ns=t_ns)) == "out_of_range"


def setpoint(seq: int, t_ns: int = 0) -> Setpoint:
    """A message with a sequence number and a time stamp."""
    return axis_setpoint(seq, t_ns, (0.0, 0.0, 0.0))


def test_a_copy_an_overtaken_packet_and_its_copy_have_counters_of_their_own() -> None:
    gate = Gate("setpoint")
    outcomes = [
        gate.admit(setpoint(seq), t_ns=t, late_ns=9) for t, seq in enumerate((4, 4, 3, 3, 5))
    ]
    taken, copy, overtaken = {"delivered": 1}, {"duplicated": 1}, {"delivered": 1, "superseded": 1}
    assert [up for _, up in outcomes] == [taken, copy, overtaken, copy, taken]
    assert [message and message.seq for message, _ in outcomes] == [4, None, None, None, 5]
    assert gate.receipts == [
        (4, 0, ""),
        (4, 1, "duplicate"),
        (3, 2, "superseded"),
        (3, 3, "duplicate"),
        (5, 4, ""),
    ]


def test_a_packet_from_before_the_window_is_rejected_as_old() -> None:
    """Nothing tells it from a copy any more."""
    gate = Gate("setpoint")
    assert gate.admit(setpoint(5000))[1] == {"delivered": 1}
    assert gate.admit(setpoint(5000 - 4096)) == (None, {"rejected old": 1})
    assert gate.admit(setpoint(5000 - 4095))[1] == {"delivered": 1, "superseded": 1}
    assert gate.receipts == [(5000, 0, ""), (904, 0, "old"), (905, 0, "superseded")]


def test_an_overtaken_packet_may_be_late_as_well() -> None:
    gate = Gate("setpoint")
    gate.admit(setpoint(1, t_ns=100), t_ns=110, late_ns=30)
    message, up = gate.admit(setpoint(0, t_ns=90), t_ns=121, late_ns=30)
    assert (message, up) == (None, {"delivered": 1, "superseded": 1, "late": 1})


def test_late_messages_are_delivered_and_older_than_the_limit() -> None:
    gate = Gate("setpoint")
    assert gate.admit(setpoint(0, t_ns=100), t_ns=130, late_ns=30)[1] == {"delivered": 1}
    assert gate.admit(setpoint(1, t_ns=100), t_ns=131, late_ns=30)[1] == {"delivered": 1, "late": 1}


def test_a_reference_is_late_by_its_target_not_by_its_stamp() -> None:
    reference = Reference(seq=0, t_ns=0, t_target_ns=60, position_m=(0.0, 0.0, 0.0))
    assert Gate("reference").admit(reference, t_ns=90, late_ns=30)[1] == {"delivered": 1}
    assert Gate("reference").admit(reference, t_ns=91, late_ns=30)[1] == {"delivered": 1, "late": 1}
