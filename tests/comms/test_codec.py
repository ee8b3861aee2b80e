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
from comms.layouts import bounds, group_bounds
from comms.messages import (
    AngleSample,
    CanMessage,
    Frame,
    InvalidReason,
    JointState,
    LinkAngle,
    LinkMotion,
    Message,
    Phase,
    Reference,
    RobotState,
    Setpoint,
    Space,
    SwingPlane,
    Truth,
    axis_setpoint,
    axis_state,
)
from tests.comms import wire_reference
from tests.comms.wire_reference import (
    HEADER,
    HEADER_BYTES,
    SESSION,
    WIRE,
    channels,
    field_values,
    links_of,
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
CABLE = LinkAngle(
    angle_rad=0.25, sigma_rad=0.5, raw_rad=0.375, offset_rad=0.125, joint_px=(322.5, -58.0)
)
ANGLE = AngleSample(
    seq=7,
    t_ns=1_000_000,
    t_valid_ns=980_000,
    swing_plane=SwingPlane.Y,
    valid=True,
    reason=InvalidReason.NONE,
    platform_m=-0.5,
    rows=300,
    residual_px=1.0,
    pivot_miss_px=-2.0,
    background=200.0,
    saturation=0.0,
    links=(CABLE,),
)
TRUTH = Truth(
    seq=4,
    t_ns=8,
    position_m=(1.0, 2.0, 3.0),
    velocity_m_s=(4.0, 5.0, 6.0),
    links=(LinkMotion(angle_x_rad=-0.5, angle_y_rad=0.25, rate_x_rad_s=2.0, rate_y_rad_s=-1.0),),
)
DOWNLOAD = CanMessage(
    seq=6,
    t_ns=5_000_000,
    can_id=0x601,
    is_extended=False,
    is_remote=False,
    length=8,
    data=bytes.fromhex("2385600040420f00"),
)
REMOTE = CanMessage(
    seq=2**32 - 1,
    t_ns=2**62,
    can_id=0x123_4567,
    is_extended=True,
    is_remote=True,
    length=3,
    data=b"",
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
        "53570203400000005353454c59415753010000000a00000000000000"
        "1400000000000000000000000000e03f000000000000d0bf0000000000000040"
        "7b3cefc6",
    ),
    "setpoint": (
        axis_setpoint(2, 5, (0.5, 0.0, -1.0)),
        (0, 3, 0.5, 0.0, -1.0, 0.0, 0.0, 0.0),
        "53570204520000005353454c59415753020000000500000000000000"
        "0003000000000000e03f0000000000000000000000000000f0bf000000000000"
        "000000000000000000000000000000000000"
        "c83b8695",
    ),
    "joint_state": (
        JointState(
            seq=2**32 - 1,
            t_ns=2**62,
            space=Space.RADIANS,
            count=6,
            values=(1e3, -1e3, 0.5, 1.5, -2.0, 3.0),
            rates=(1e4, -1e4, 0.25, 0.0, -0.5, 4.0),
        ),
        (1, 6, 1e3, -1e3, 0.5, 1.5, -2.0, 3.0, 1e4, -1e4, 0.25, 0.0, -0.5, 4.0),
        "53570205820000005353454c59415753ffffffff0000000000000040"
        "01060000000000408f400000000000408fc0000000000000e03f000000000000"
        "f83f00000000000000c00000000000000840000000000088c340000000000088"
        "c3c0000000000000d03f0000000000000000000000000000e0bf000000000000"
        "1040"
        "662c3344",
    ),
    "robot_state": (
        STATE,
        STATE_VALUES,
        "53570206710000005353454c59415753030000002800000000000000"
        "2700000000000000000000000000e03f000000000000d0bf000000000000c03f"
        "000000000000d03f0000000000000000000000000000f0bf000000000000f83f"
        "00000000000000c0000000000000000002"
        "eb0d0165",
    ),
    "platform_1": (
        STATE,
        STATE_VALUES,
        "53570207710000005353454c59415753030000002800000000000000"
        "2700000000000000000000000000e03f000000000000d0bf000000000000c03f"
        "000000000000d03f0000000000000000000000000000f0bf000000000000f83f"
        "00000000000000c0000000000000000002"
        "444eb515",
    ),
    "frame_1": (
        FRAME,
        (20, 10, 0, b"front" + bytes(11), b"mono8" + bytes(3), 480, 640),
        "53570208540000005353454c59415753090000001e00000000000000"
        "14000000000000000a00000000000000000000000000000066726f6e74000000"
        "00000000000000006d6f6e6f38000000e0018002"
        "e0a1fe91",
    ),
    "angle_1": (
        ANGLE,
        (
            *(980_000, 1, True, 0, -0.5, 300, 1.0, -2.0, 200.0, 0.0),
            *(0.25, 0.5, 0.375, 0.125, 322.5, -58.0),
        ),
        "53570209850000005353454c594157530700000040420f0000000000"
        "20f40e0000000000010100000000000000e0bf2c01000000000000f03f000000"
        "00000000c000000000000069400000000000000000000000000000d03f000000"
        "000000e03f000000000000d83f000000000000c03f0000000000287440000000"
        "0000004dc0"
        "b7f2fa4a",
    ),
    "truth": (
        TRUTH,
        (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -0.5, 0.25, 2.0, -1.0),
        "5357020a700000005353454c59415753040000000800000000000000"
        "000000000000f03f000000000000004000000000000008400000000000001040"
        "00000000000014400000000000001840000000000000e0bf000000000000d03f"
        "0000000000000040000000000000f0bf"
        "31d7e176",
    ),
    "can_down": (
        DOWNLOAD,
        (0x601, False, False, 8, bytes.fromhex("2385600040420f00")),
        "5357020b2f0000005353454c5941575306000000404b4c0000000000"
        "010600000000082385600040420f00"
        "19f1ec28",
    ),
    "can_up": (
        REMOTE,
        (0x123_4567, True, True, 3, bytes(8)),
        "5357020c2f0000005353454c59415753ffffffff0000000000000040"
        "674523010101030000000000000000"
        "1e458387",
    ),
}


OF_THE_FIRST_CAMERA = {
    "platform_2": ("platform_1", 13),
    "frame_2": ("frame_1", 14),
    "angle_2": ("angle_1", 15),
    "platform_3": ("platform_1", 16),
    "frame_3": ("frame_1", 17),
    "angle_3": ("angle_1", 18),
}


def renumbered(channel: str, number: int) -> tuple[Message, tuple[Any, ...], str]:
    """Published datagram of a channel with the number of another one, and its CRC."""
    message, values, published = GOLDEN[channel]
    body = bytearray.fromhex(published)[:-4]
    body[3] = number
    return message, values, (body + struct.pack("<I", zlib.crc32(body))).hex()


GOLDEN |= {name: renumbered(*other) for name, other in OF_THE_FIRST_CAMERA.items()}

CLOSING = "53570209200001005353454c59415753f40100000700000000000000db267ea2"


@pytest.mark.parametrize("channel", GOLDEN)
def test_the_bytes_of_a_datagram_are_the_published_ones(channel: str) -> None:
    message, _, published = GOLDEN[channel]
    assert encode(channel, message, SESSION).hex() == published


@pytest.mark.parametrize("channel", GOLDEN)
def test_the_published_bytes_mean_header_values_and_crc(channel: str) -> None:
    message, values, published = GOLDEN[channel]
    number, _, payload, _ = WIRE[channel]
    data = bytes.fromhex(published)
    header = (b"SW", 2, number, len(data), 0, SESSION, message.seq, message.t_ns)
    assert struct.unpack(HEADER + payload + "I", data) == (*header, *values, zlib.crc32(data[:-4]))


@pytest.mark.parametrize("channel", GOLDEN)
def test_the_published_bytes_decode_to_the_message(channel: str) -> None:
    message, _, published = GOLDEN[channel]
    got = decode(channel, bytes.fromhex(published), SESSION)
    assert type(got) is type(message)
    assert field_values(got) == field_values(message)


def test_a_closing_datagram_is_a_header_with_a_flag_and_the_count() -> None:
    data = bytes.fromhex(CLOSING)
    assert encode_closing("angle_1", 500, 7, SESSION) == data
    assert struct.unpack(HEADER + "I", data) == (
        b"SW",
        2,
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
    links = links_of(message)
    assert len(data) == length(channel, links) == wire_reference.length(channel, links)


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
    message = msgspec.structs.replace(ANGLE, links=(), valid=False, reason=reason)
    got = decode("angle_1", encode("angle_1", message, SESSION), SESSION)
    assert got == message
    assert isinstance(got, AngleSample)
    assert got.cable is None


@pytest.mark.parametrize("plane", SwingPlane)
def test_every_swing_plane_has_a_code_of_its_own(plane: SwingPlane) -> None:
    message = msgspec.structs.replace(ANGLE, swing_plane=plane)
    assert decode("angle_1", encode("angle_1", message, SESSION), SESSION) == message


@pytest.mark.parametrize("count", range(1, 7))
@pytest.mark.parametrize(("space", "code"), [(Space.METRES, 0), (Space.RADIANS, 1)])
def test_joints_of_every_space_and_count_survive_the_wire(
    space: Space, code: int, count: int
) -> None:
    values = (*np.linspace(-10.0, 10.0, 6)[:count].tolist(), *[0.0] * (6 - count))
    rates = (*np.linspace(100.0, -100.0, 6)[:count].tolist(), *[0.0] * (6 - count))
    setpoint = Setpoint(seq=1, t_ns=2, space=space, count=count, values=values)
    state = JointState(seq=3, t_ns=4, space=space, count=count, values=values, rates=rates)
    for channel, message in (("setpoint", setpoint), ("joint_state", state)):
        data = encode(channel, message, SESSION)
        assert tuple(data[HEADER_BYTES : HEADER_BYTES + 2]) == (code, count)
        assert decode(channel, data, SESSION) == message


@pytest.mark.parametrize("count", range(1, 7))
@pytest.mark.parametrize("space", Space)
def test_three_joints_in_metres_are_a_position_and_no_others(space: Space, count: int) -> None:
    is_position = (space, count) == (Space.METRES, 3)
    values = (*[0.5] * count, *[0.0] * (6 - count))
    setpoint = Setpoint(seq=1, t_ns=2, space=space, count=count, values=values)
    state = JointState(seq=1, t_ns=2, space=space, count=count, values=values, rates=values)
    expected = (0.5, 0.5, 0.5) if is_position else None
    assert setpoint.position_m == state.position_m == state.velocity_m_s == expected


def test_the_joints_of_the_axes_are_x_y_and_z_in_metres() -> None:
    place, velocity = (1.0, -2.0, 3.0), (-4.0, 5.0, 6.0)
    setpoint, state = axis_setpoint(7, 8, place), axis_state(9, 10, place, velocity)
    assert (setpoint.seq, setpoint.t_ns, state.seq, state.t_ns) == (7, 8, 9, 10)
    assert setpoint.space is state.space is Space.METRES
    assert setpoint.count == state.count == 3
    assert setpoint.values == state.values == (1.0, -2.0, 3.0, 0.0, 0.0, 0.0)
    assert state.rates == (-4.0, 5.0, 6.0, 0.0, 0.0, 0.0)
    assert (setpoint.position_m, state.position_m, state.velocity_m_s) == (place, place, velocity)


def link_angle(k: int) -> LinkAngle:
    """The k-th of several links, each with its own values, every second one without its joint."""
    joint_px = (100.0 * k, 50.0 - k) if k % 2 else None
    return LinkAngle(
        angle_rad=0.1 * k, sigma_rad=0.01 * k, raw_rad=-0.1 * k, offset_rad=0.001, joint_px=joint_px
    )


def link_motion(k: int) -> LinkMotion:
    """The k-th of several links, each with its own values."""
    return LinkMotion(
        angle_x_rad=0.1 * k, angle_y_rad=-0.2 * k, rate_x_rad_s=0.3 * k, rate_y_rad_s=-0.4 * k
    )


@pytest.mark.parametrize("links", range(4))
def test_an_angle_of_up_to_three_links_survives_the_wire(links: int) -> None:
    chain = tuple(link_angle(k) for k in range(links))
    message = msgspec.structs.replace(ANGLE, links=chain, valid=links > 0)
    data = encode("angle_1", message, SESSION)
    assert len(data) == 85 + 48 * links
    got = decode("angle_1", data, SESSION)
    assert got == message
    assert isinstance(got, AngleSample)
    assert got.cable == (chain[0] if links else None)


@pytest.mark.parametrize("links", [0, 1, 5, 256])
def test_a_truth_of_up_to_256_links_survives_the_wire(links: int) -> None:
    message = msgspec.structs.replace(TRUTH, links=tuple(link_motion(k) for k in range(links)))
    data = encode("truth", message, SESSION)
    assert len(data) == 80 + 32 * links
    assert decode("truth", data, SESSION) == message


def test_a_message_with_more_links_than_allowed_is_not_encoded() -> None:
    angle = msgspec.structs.replace(ANGLE, links=(CABLE,) * 4)
    with pytest.raises(ValueError, match="angle_1: 4 links; must be <= 3"):
        encode("angle_1", angle, SESSION)
    truth = msgspec.structs.replace(TRUTH, links=TRUTH.links * 257)
    with pytest.raises(ValueError, match="truth: 257 links; must be <= 256"):
        encode("truth", truth, SESSION)


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
    assert tuple(bound.name for bound in bounds(kind) + group_bounds(kind)) == names
