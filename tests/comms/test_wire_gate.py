"""Rejection of invalid datagrams: nothing is raised, each packet increases exactly one counter."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from comms.codec import encode, encode_closing
from comms.messages import Message, Reference, Setpoint
from tests.comms.wire_reference import (
    CRC_BYTES,
    HEADER_BYTES,
    LENGTH,
    SESSION,
    WIRE,
    Gate,
    channels,
    datagram,
    field_values,
    messages,
    with_value,
)

UNTIMED = settings(deadline=None)  # a busy machine is no failure
CLOSING_BYTES = HEADER_BYTES + CRC_BYTES
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
    **dict.fromkeys(("angle_rad", "raw_rad", "offset_rad"), (-1.6, 1.6)),
    "sigma_rad": (0.0, 1.6),
    "residual_px": (0.0, 1e4),
    "pivot_miss_px": (-1e5, 1e5),
    "background": (0.0, 255.0),
    "saturation": (0.0, 1.0),
    "phase": (0, 4),
    "reason": (0, 8),
}
# in a valid sample too
MAY_BE_ABSENT = {"raw_rad", "offset_rad", "platform_m", "residual_px", "pivot_miss_px"}
VALUES = [
    (channel, place, name) for channel, row in WIRE.items() for place, name in enumerate(row[3])
]
BOUNDED = [value for value in VALUES if value[2] in BOUND and value[0] != "truth"]
BOUNDED += [
    ("truth", place, name)
    for place, name in enumerate(WIRE["truth"][3])
    if name in ("position_m", "velocity_m_s")
]
FLOATS = [value for value in BOUNDED if isinstance(BOUND[value[2]][1], float)] + [
    ("truth", 0, "angle_rad"),
    ("truth", 1, "angular_velocity_rad_s"),
]


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


@UNTIMED
@given(cases, st.data())
def test_a_cut_datagram_is_refused(case: tuple[str, Message], data: st.DataObject) -> None:
    channel, message = case
    whole = encode(channel, message, SESSION)
    keep = data.draw(st.integers(0, len(whole) - 1))
    assert is_refused(channel, message, whole[:keep]) == (
        "crc" if keep == CLOSING_BYTES else "length"
    )


@UNTIMED
@given(cases, st.binary(min_size=1, max_size=64))
def test_a_datagram_with_something_behind_it_is_refused(
    case: tuple[str, Message], tail: bytes
) -> None:
    channel, message = case
    assert is_refused(channel, message, encode(channel, message, SESSION) + tail) == "length"


@UNTIMED
@given(pairs, st.data())
def test_a_splice_of_two_datagrams_is_refused(
    pair: tuple[str, Message, Message], data: st.DataObject
) -> None:
    channel, first, second = pair
    head, tail = encode(channel, first, SESSION), encode(channel, second, SESSION)
    at = data.draw(st.integers(1, len(head) - 1))
    assume(head[:at] + tail[at:] not in (head, tail))
    assert is_refused(channel, first, head[:at] + tail[at:]) == "crc"


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
    same_length = LENGTH[other] == LENGTH[channel]
    assert refusal(Gate(other), encode(channel, message, SESSION)) == (
        "channel" if same_length else "length"
    )


def test_a_closing_datagram_of_another_channel_or_session_closes_nothing() -> None:
    assert refusal(Gate("angle"), encode_closing("platform", 5, 0, SESSION)) == "channel"
    assert refusal(Gate("angle"), encode_closing("angle", 5, 0, SESSION + 1)) == "session"


def test_a_closing_datagram_moves_no_counter() -> None:
    assert Gate("angle").take(encode_closing("angle", 5, 0, SESSION)) == (None, {})


@UNTIMED
@given(channels, st.binary(max_size=200))
def test_garbage_is_refused(channel: str, data: bytes) -> None:
    assert refusal(Gate(channel), data) in {"length", "magic"}


@UNTIMED
@given(channels, st.data())
def test_garbage_of_the_right_length_is_refused(channel: str, data: st.DataObject) -> None:
    size = data.draw(st.sampled_from([LENGTH[channel], CLOSING_BYTES]))
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
    size = LENGTH[channel] - CLOSING_BYTES
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


@UNTIMED
@given(cases, st.binary(min_size=4, max_size=4))
def test_a_header_with_another_magic_version_length_or_flag_is_refused(
    case: tuple[str, Message], noise: bytes
) -> None:
    channel, message = case
    payload = encode(channel, message, SESSION)[HEADER_BYTES:-CRC_BYTES]
    assume(noise[:2] != b"SW" and noise[2] != 1 and noise[3] not in (0, 1))
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
        is_refused(
            channel, message, datagram(channel, payload, length=LENGTH[channel] + 1 + noise[0])
        )
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
        if name not in ("phase", "reason") or beyond >= 0:  # their codes are unsigned bytes
            assert refusal(Gate(channel), with_value(channel, place, beyond)) == "out_of_range"


@pytest.mark.parametrize(("channel", "place", "name"), FLOATS)
def test_an_infinite_value_is_refused_and_a_nan_too_unless_it_may_be_absent(
    channel: str, place: int, name: str
) -> None:
    for infinite in (math.inf, -math.inf):
        assert refusal(Gate(channel), with_value(channel, place, infinite)) == "not_finite"
    nan = with_value(channel, place, math.nan)
    if channel == "angle" and name in MAY_BE_ABSENT:
        message, up = Gate(channel).take(nan)
        assert up == {"delivered": 1}
        assert getattr(message, name) is None
    elif channel == "angle" and name in ("angle_rad", "sigma_rad"):
        assert refusal(Gate(channel), nan) == "out_of_range"  # the sample is marked valid
    else:
        assert refusal(Gate(channel), nan) == "not_finite"


def test_an_angle_that_is_there_but_not_valid_is_refused() -> None:
    place = WIRE["angle"][3].index("valid")
    assert refusal(Gate("angle"), with_value("angle", place, False)) == "out_of_range"


@pytest.mark.parametrize("t_ns", [-1, 2**62 + 1])
def test_a_stamp_out_of_its_bounds_is_refused(t_ns: int) -> None:
    assert refusal(Gate("setpoint"), datagram("setpoint", bytes(24), t_ns=t_ns)) == "out_of_range"


def setpoint(seq: int, t_ns: int = 0) -> Setpoint:
    """A message with a sequence number and a time stamp."""
    return Setpoint(seq=seq, t_ns=t_ns, position_m=(0.0, 0.0, 0.0))


def test_a_copy_an_overtaken_packet_and_its_copy_have_counters_of_their_own() -> None:
    gate = Gate("setpoint")
    outcomes = [
        gate.admit(setpoint(seq), t_ns=t, late_ns=9)[1] for t, seq in enumerate((4, 4, 3, 3, 5))
    ]
    copy, old = {"duplicated": 1}, {"rejected old": 1}
    assert outcomes == [{"delivered": 1}, copy, old, copy, {"delivered": 1}]
    assert gate.receipts == [
        (4, 0, ""),
        (4, 1, "duplicate"),
        (3, 2, "old"),
        (3, 3, "duplicate"),
        (5, 4, ""),
    ]


def test_late_messages_are_delivered_and_older_than_the_limit() -> None:
    gate = Gate("setpoint")
    assert gate.admit(setpoint(0, t_ns=100), t_ns=130, late_ns=30)[1] == {"delivered": 1}
    assert gate.admit(setpoint(1, t_ns=100), t_ns=131, late_ns=30)[1] == {"delivered": 1, "late": 1}


def test_a_reference_is_late_by_its_target_not_by_its_stamp() -> None:
    reference = Reference(seq=0, t_ns=0, t_target_ns=60, position_m=(0.0, 0.0, 0.0))
    assert Gate("reference").admit(reference, t_ns=90, late_ns=30)[1] == {"delivered": 1}
    assert Gate("reference").admit(reference, t_ns=91, late_ns=30)[1] == {"delivered": 1, "late": 1}
