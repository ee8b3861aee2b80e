"""Datagrams and frames over the loopback: every loss is counted, invalid data is rejected."""

from __future__ import annotations

import select
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest
import zmq
from hypothesis import given, settings

from comms import frames, udp
from comms.codec import Closing, Reject, encode
from comms.errors import PortInUse
from comms.frames import FrameReceiver, FrameSender, with_pixels
from comms.messages import Frame
from comms.operator_bus import Context
from comms.udp import UdpReceiver, UdpSender, free_port, port_is_free
from tests.comms.wire_reference import SESSION, field_values
from tests.comms.wire_reference import frames as any_frame

HOST = "127.0.0.1"
WAIT_S = 5.0  # far beyond what the loopback needs; only a failure takes it
LOOKS = 100


def picture(seq: int = 0, height: int = 48, width: int = 64) -> Frame:
    """A grey frame of random pixels."""
    pixels = np.random.default_rng(seq).integers(0, 256, (height, width), np.uint8)
    times = {"t_ns": 30, "t_exposure_start_ns": 20, "exposure_ns": 10, "row_ns": 0}
    return Frame(
        seq=seq,
        camera="front",
        encoding="mono8",
        height=height,
        width=width,
        pixels=pixels,
        **times,
    )


def arrivals(receiver: UdpReceiver, last: bytes) -> list[bytes]:
    """Datagrams up to and with `last`."""
    got: list[bytes] = []
    while last not in got:
        assert select.select([receiver], [], [], WAIT_S)[0], "the last datagram did not arrive"
        got += receiver.drain()
    return got


@pytest.fixture
def receiver() -> Iterator[UdpReceiver]:
    """A receiver on a free port."""
    receiver = UdpReceiver(HOST, 0, "angle_1")
    yield receiver
    receiver.close()


@pytest.fixture
def context() -> Iterator[Context]:
    """A ZeroMQ context, destroyed after the test with all its sockets."""
    context = zmq.Context()
    yield context
    context.destroy(0)


def test_datagrams_arrive_whole_and_in_order(receiver: UdpReceiver) -> None:
    sent = [bytes([k]) * (k + 1) for k in range(100)]
    sender = UdpSender(HOST, receiver.port)
    assert [sender.send(data) for data in sent] == [True] * 100
    sender.close()
    assert arrivals(receiver, sent[-1]) == sent
    assert receiver.kernel_drops == 0
    assert list(receiver.drain()) == []


@pytest.mark.parametrize("flood", [300, 2000])
def test_the_kernel_counts_the_datagrams_dropped_for_a_full_buffer(
    flood: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(udp, "RECEIVE_BUFFER_BYTES", 16_384)
    receiver = UdpReceiver(HOST, 0, "angle_1")
    sender = UdpSender(HOST, receiver.port)
    for k in range(flood):  # not read
        assert sender.send(k.to_bytes(4, "little") + bytes(120))
    read = list(receiver.drain())
    assert receiver.kernel_drops == 0  # the count comes with the next datagram received
    sender.send(b"last")
    read += arrivals(receiver, b"last")
    assert 0 < receiver.kernel_drops == flood + 1 - len(read)
    sender.close()
    receiver.close()


def test_a_drain_reads_a_bounded_number_of_datagrams(receiver: UdpReceiver) -> None:
    sender = UdpSender(HOST, receiver.port)
    sent = [k.to_bytes(2, "little") for k in range(udp.DRAIN_LIMIT + 10)]
    for data in sent:
        sender.send(data)
    sender.close()
    first = list(receiver.drain())
    assert len(first) <= udp.DRAIN_LIMIT
    assert first + arrivals(receiver, sent[-1]) == sent


def test_a_datagram_longer_than_the_maximum_is_cut(
    receiver: UdpReceiver,
) -> None:
    sender = UdpSender(HOST, receiver.port)
    sender.send(bytes(20_000))
    sender.send(b"last")
    sender.close()
    assert arrivals(receiver, b"last") == [bytes(udp.MAX_DATAGRAM_BYTES), b"last"]


def test_a_datagram_that_the_system_refuses_is_reported(receiver: UdpReceiver) -> None:
    sender = UdpSender(HOST, receiver.port)
    assert not sender.send(bytes(70_000))  # beyond what UDP can carry
    assert sender.send(b"next")
    sender.close()
    assert arrivals(receiver, b"next") == [b"next"]


def test_a_port_in_use_is_named_with_what_to_do(receiver: UdpReceiver) -> None:
    with pytest.raises(
        PortInUse, match=rf"UDP port {receiver.port} on {HOST} .*'platform_1'.*network\.base_port"
    ):
        UdpReceiver(HOST, receiver.port, "platform_1")


def test_a_port_is_free_until_it_is_bound_and_again_after(receiver: UdpReceiver) -> None:
    port = free_port(HOST)
    assert port_is_free(HOST, port)
    taken = UdpReceiver(HOST, port, "angle_1")
    assert not port_is_free(HOST, port)
    taken.close()
    assert port_is_free(HOST, port)
    assert not port_is_free(HOST, receiver.port)


def pulled(receiver: FrameReceiver, count: int) -> list[Frame | Closing | Reject]:
    """The next `count` items of a frame receiver."""
    got: list[Frame | Closing | Reject] = []
    for _ in range(LOOKS):
        got += receiver.drain()
        if len(got) >= count:
            break
        # an edge of a ZeroMQ descriptor can be missed, hence the short timeout
        select.select([receiver], [], [], WAIT_S / LOOKS)
    assert len(got) == count
    return got


def test_pictures_arrive_with_their_pixels_and_the_closing_count(context: Context) -> None:
    port = free_port(HOST, udp=False)
    receiver = FrameReceiver(context, HOST, port, "frame_1", SESSION)
    sender = FrameSender(context, HOST, port, "frame_1", SESSION)
    sent = [picture(seq) for seq in range(3)]
    assert [sender.send(frame) for frame in sent] == [True] * 3
    sender.close(3, 40)
    *got, closing = pulled(receiver, 4)
    assert closing == Closing(3)
    for frame, original in zip(got, sent, strict=True):
        assert isinstance(frame, Frame)
        assert field_values(frame) == field_values(original)
        assert np.array_equal(frame.pixels, original.pixels)
        assert not frame.pixels.flags.writeable
    receiver.close()


def test_a_drain_reads_a_bounded_number_of_frames_and_says_that_more_wait(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frames, "DRAIN_LIMIT", 2)
    port = free_port(HOST, udp=False)
    receiver = FrameReceiver(context, HOST, port, "frame_1", SESSION)
    sender = FrameSender(context, HOST, port, "frame_1", SESSION)
    assert [sender.send(picture(k)) for k in range(3)] == [True] * 3
    drains: list[int] = []
    for _ in range(LOOKS):
        drains.append(len(list(receiver.drain())))
        if sum(drains) == 3:
            break
        if not receiver.has_pending():
            select.select([receiver], [], [], WAIT_S / LOOKS)
    assert sum(drains) == 3
    assert max(drains) <= 2
    sender.close(3, 0)
    receiver.close()


def test_a_picture_cut_out_of_a_larger_one_arrives_with_its_own_pixels(context: Context) -> None:
    port = free_port(HOST, udp=False)
    receiver = FrameReceiver(context, HOST, port, "frame_1", SESSION)
    sender = FrameSender(context, HOST, port, "frame_1", SESSION)
    original = picture(height=20, width=30)
    strided = msgspec.structs.replace(
        original, height=10, width=15, pixels=original.pixels[::2, ::2]
    )
    sender.send(strided)
    sender.close(1, 0)
    frame, _ = pulled(receiver, 2)
    assert isinstance(frame, Frame)
    assert np.array_equal(frame.pixels, strided.pixels)
    receiver.close()


def test_parts_other_than_a_header_and_its_pixels_are_refused(context: Context) -> None:
    port = free_port(HOST, udp=False)
    receiver = FrameReceiver(context, HOST, port, "frame_1", SESSION)
    stranger = context.socket(zmq.PUSH)
    stranger.connect(f"tcp://{HOST}:{port}")
    frame, size = picture(), 48 * 64
    head = encode("frame_1", frame, SESSION)
    unknown = encode("frame_1", msgspec.structs.replace(frame, encoding="rgb16"), SESSION)
    colour = encode("frame_1", msgspec.structs.replace(frame, encoding="bgr8"), SESSION)
    cases: list[tuple[list[bytes], Reject]] = [
        ([head, bytes(size - 1)], Reject.LENGTH),
        ([head, bytes(size + 1)], Reject.LENGTH),
        ([head, b""], Reject.LENGTH),
        ([head], Reject.LENGTH),
        ([head, bytes(size), b""], Reject.LENGTH),
        ([colour, bytes(size)], Reject.LENGTH),
        ([unknown, bytes(size)], Reject.OUT_OF_RANGE),
        ([b"", bytes(size)], Reject.LENGTH),
        ([b"hello"], Reject.LENGTH),
        ([encode("frame_1", frame, SESSION + 1), bytes(size)], Reject.SESSION),
    ]
    for parts, _ in cases:
        stranger.send_multipart(parts)
    stranger.send_multipart([head, frame.pixels.tobytes()])
    *refused, taken = pulled(receiver, len(cases) + 1)
    assert refused == [reason for _, reason in cases]
    assert isinstance(taken, Frame)
    assert np.array_equal(taken.pixels, frame.pixels)
    stranger.close()
    receiver.close()


@given(any_frame())
@settings(deadline=None)
def test_header_and_pixels_are_joined_to_the_frame(frame: Frame) -> None:
    data = memoryview(frame.pixels.tobytes())
    whole = with_pixels(msgspec.structs.replace(frame, pixels=np.empty((0, 0), np.uint8)), data)
    assert isinstance(whole, Frame)
    assert np.array_equal(whole.pixels, frame.pixels)
    assert with_pixels(frame, data[1:]) is Reject.LENGTH


def test_frames_without_a_receiver_fill_the_queue_and_are_then_refused_at_once(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frames, "LINGER_MS", 0)
    sender = FrameSender(context, HOST, free_port(HOST, udp=False), "frame_1", SESSION)
    taken = [sender.send(picture(seq, 2, 2)) for seq in range(frames.HIGH_WATER + 3)]
    assert taken == [True] * frames.HIGH_WATER + [False] * 3
    sender.close(frames.HIGH_WATER, 0)


def test_a_frame_port_in_use_is_named_with_what_to_do(context: Context) -> None:
    port = free_port(HOST, udp=False)
    receiver = FrameReceiver(context, HOST, port, "frame_1", SESSION)
    assert not port_is_free(HOST, port, udp=False)
    with pytest.raises(
        PortInUse, match=rf"TCP port {port} on {HOST} .*'frame_1'.*network\.base_port"
    ):
        FrameReceiver(context, HOST, port, "frame_1", SESSION)
    receiver.close()
