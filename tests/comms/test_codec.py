"""Encoding and decoding of every message, and the published bytes."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comms.channels import CHANNELS, Transport
from comms.codec import Closing, decode, encode, encode_closing, length
from comms.frames import with_pixels
from comms.layouts import bounds
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
from tests.comms.wire_reference import (
    HEADER,
    LENGTH,
    SESSION,
    WIRE,
    channels,
    field_values,
    messages,
)

UNTIMED = settings(deadline=None)  # a busy machine is no failure
STATE = RobotState(
    seq=3,
    t_ns=40,
    t_actual_ns=39,
    commanded_m=(0.5, -0.25, 0.125),
    actual_m=(0.25, 0.0, -1.0),
    actual_velocity_m_s=(1.5, -2.0, 0.0),
    phase=Phase.RUNNING,
)
STATE_VALUES = (39, 0.5, -0.25, 0.125, 0.25, 0.0, -1.0, 1.5, -2.0, 0.0, 2)
ANGLE = AngleSample(
    seq=7,
    t_ns=1_000_000,
    t_valid_ns=980_000,
    angle_rad=0.25,
    sigma_rad=0.5,
    valid=True,
    reason=InvalidReason.NONE,
    raw_rad=0.375,
    offset_rad=0.125,
    platform_m=-0.5,
    rows=300,
    residual_px=1.0,
    pivot_miss_px=-2.0,
    background=200.0,
    saturation=0.0,
)
FRAME = Frame(
    seq=9,
    t_ns=30,
    t_exposure_start_ns=20,
    exposure_ns=10,
    row_ns=0,
    camera="front",
    encoding="mono8",
    height=480,
    width=640,
    pixels=np.zeros((480, 640), np.uint8),
)
GOLDEN: dict[str, tuple[Message, tuple[Any, ...], str]] = {
    "reference": (
        Reference(seq=1, t_ns=10, t_target_ns=20, position_m=(0.5, -0.25, 2.0)),
        (20, 0.5, -0.25, 2.0),
        "53570103400000005353454c59415753010000000a00000000000000"
        "1400000000000000000000000000e03f000000000000d0bf0000000000000040"
        "ce2ca619",
    ),
    "setpoint": (
        Setpoint(seq=2, t_ns=5, position_m=(0.5, 0.0, -1.0)),
        (0.5, 0.0, -1.0),
        "53570104380000005353454c59415753020000000500000000000000000000000000e03f0000000000000000000000000000f0bf64b7ced5",
    ),
    "joint_state": (
        JointState(
            seq=2**32 - 1,
            t_ns=2**62,
            position_m=(10.0, -10.0, 0.0),
            velocity_m_s=(100.0, -100.0, 0.5),
        ),
        (10.0, -10.0, 0.0, 100.0, -100.0, 0.5),
        "53570105500000005353454c59415753ffffffff0000000000000040"
        "000000000000244000000000000024c00000000000000000000000000000594000000000000059c0000000000000e03f"
        "39e77aa2",
    ),
    "robot_state": (
        STATE,
        STATE_VALUES,
        "53570106710000005353454c59415753030000002800000000000000"
        "2700000000000000000000000000e03f000000000000d0bf000000000000c03f000000000000d03f0000000000000000"
        "000000000000f0bf000000000000f83f00000000000000c0000000000000000002"
        "a5132aaf",
    ),
    "platform": (
        STATE,
        STATE_VALUES,
        "53570107710000005353454c59415753030000002800000000000000"
        "2700000000000000000000000000e03f000000000000d0bf000000000000c03f000000000000d03f0000000000000000"
        "000000000000f0bf000000000000f83f00000000000000c0000000000000000002"
        "0a509edf",
    ),
    "frame": (
        FRAME,
        (20, 10, 0, b"front" + bytes(11), b"mono8" + bytes(3), 480, 640),
        "53570108540000005353454c59415753090000001e00000000000000"
        "14000000000000000a00000000000000000000000000000066726f6e7400000000000000000000006d6f6e6f38000000"
        "e0018002"
        "ce9d6a4c",
    ),
    "angle": (
        ANGLE,
        (980_000, 0.25, 0.5, True, 0, 0.375, 0.125, -0.5, 300, 1.0, -2.0, 200.0, 0.0),
        "53570109740000005353454c594157530700000040420f0000000000"
        "20f40e0000000000000000000000d03f000000000000e03f0100000000000000d83f000000000000c03f000000000000"
        "e0bf2c01000000000000f03f00000000000000c000000000000069400000000000000000"
        "abaf2b2b",
    ),
    "truth": (
        Truth(
            seq=4,
            t_ns=8,
            angle_rad=-0.5,
            angular_velocity_rad_s=2.0,
            position_m=(1.0, 2.0, 3.0),
            velocity_m_s=(4.0, 5.0, 6.0),
        ),
        (-0.5, 2.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
        "5357010a600000005353454c59415753040000000800000000000000"
        "000000000000e0bf0000000000000040000000000000f03f000000000000004000000000000008400000000000001040"
        "00000000000014400000000000001840"
        "ea91991a",
    ),
}

CLOSING = "53570109200001005353454c59415753f4010000070000000000000023cb2950"


@pytest.mark.parametrize("channel", GOLDEN)
def test_the_bytes_of_a_datagram_are_the_published_ones(channel: str) -> None:
    message, _, published = GOLDEN[channel]
    assert encode(channel, message, SESSION).hex() == published


@pytest.mark.parametrize("channel", GOLDEN)
def test_the_published_bytes_mean_header_values_and_crc(channel: str) -> None:
    message, values, published = GOLDEN[channel]
    number, _, payload, _ = WIRE[channel]
    data = bytes.fromhex(published)
    header = (b"SW", 1, number, len(data), 0, SESSION, message.seq, message.t_ns)
    assert struct.unpack(HEADER + payload + "I", data) == (*header, *values, zlib.crc32(data[:-4]))


@pytest.mark.parametrize("channel", GOLDEN)
def test_the_published_bytes_decode_to_the_message(channel: str) -> None:
    message, _, published = GOLDEN[channel]
    got = decode(channel, bytes.fromhex(published), SESSION)
    assert type(got) is type(message)
    assert field_values(got) == field_values(message)


def test_a_closing_datagram_is_a_header_with_a_flag_and_the_count() -> None:
    data = bytes.fromhex(CLOSING)
    assert encode_closing("angle", 500, 7, SESSION) == data
    assert struct.unpack(HEADER + "I", data) == (
        b"SW",
        1,
        9,
        32,
        1,
        SESSION,
        500,
        7,
        zlib.crc32(data[:-4]),
    )


@UNTIMED
@given(
    channels.flatmap(lambda name: st.tuples(st.just(name), messages(name))),
    st.integers(0, 2**64 - 1),
)
def test_every_message_survives_the_wire(case: tuple[str, Message], session: int) -> None:
    channel, message = case
    data = encode(channel, message, session)
    got = decode(channel, data, session)
    assert type(got) is type(message)
    if isinstance(got, Frame) and isinstance(message, Frame):
        got = with_pixels(got, memoryview(message.pixels.tobytes()))
        assert isinstance(got, Frame)
        assert np.array_equal(got.pixels, message.pixels)
    assert field_values(got) == field_values(message)
    assert len(data) == length(channel) == LENGTH[channel]


@UNTIMED
@given(channels, st.integers(0, 2**32 - 1), st.integers(0, 2**62))
def test_every_closing_count_survives_the_wire(channel: str, count: int, t_ns: int) -> None:
    assert decode(channel, encode_closing(channel, count, t_ns, SESSION), SESSION) == Closing(count)


@pytest.mark.parametrize("phase", Phase)
def test_every_phase_has_a_code_of_its_own(phase: Phase) -> None:
    message = msgspec.structs.replace(STATE, phase=phase)
    assert decode("robot_state", encode("robot_state", message, SESSION), SESSION) == message


@pytest.mark.parametrize("reason", InvalidReason)
def test_every_reason_has_a_code_of_its_own_and_an_absent_angle_stays_absent(
    reason: InvalidReason,
) -> None:
    message = msgspec.structs.replace(
        ANGLE, angle_rad=None, sigma_rad=None, valid=False, reason=reason
    )
    assert decode("angle", encode("angle", message, SESSION), SESSION) == message


def test_every_channel_of_datagrams_is_covered_here() -> None:
    rows = {
        name: (row.id, row.message)
        for name, row in CHANNELS.items()
        if row.transport is not Transport.BUS
    }
    assert rows == {name: (number, kind) for name, (number, kind, _, _) in WIRE.items()}
    assert GOLDEN.keys() == WIRE.keys()


@pytest.mark.parametrize("channel", WIRE)
def test_the_bounds_follow_the_order_of_the_payload(channel: str) -> None:
    _, kind, _, names = WIRE[channel]
    assert tuple(bound.name for bound in bounds(kind)) == names
