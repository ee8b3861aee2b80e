"""Datagrams and frames over the loopback: every loss is counted, invalid data is rejected."""

from __future__ import annotations

import select
from collections.abc import Iterator
from pathlib import Path

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
from comms.udp import UdpReceiver, UdpSender, free_port, free_ports, port_is_free
from tests.comms.wire_reference import SESSION, datagram, field_values
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


Ends = tuple[UdpReceiver, UdpSender]


def udp_ends() -> Ends:
    """Both ends of a channel, connected to each other."""
    port, own_port = free_ports(HOST, [True] * 2)
    receiver = UdpReceiver(HOST, port, "angle_1", own_port)
    return receiver, UdpSender(HOST, port, own_port, "angle_1")


@pytest.fixture
def ends() -> Iterator[Ends]:
    """Both ends of a channel, closed after the test."""
    receiver, sender = udp_ends()
    yield receiver, sender
    receiver.close()
    sender.close()


@pytest.fixture
def address() -> str:
    """A free address for frames."""
    return f"tcp://{HOST}:{free_port(HOST, udp=False)}"


@pytest.fixture
def context() -> Iterator[Context]:
    """A ZeroMQ context, destroyed after the test with all its sockets."""
    context = zmq.Context()
    yield context
    context.destroy(0)


def test_datagrams_arrive_whole_and_in_order(ends: Ends) -> None:
    receiver, sender = ends
    sent = [bytes([k]) * (k + 1) for k in range(100)]
    assert [sender.send(data) for data in sent] == [True] * 100
    assert arrivals(receiver, sent[-1]) == sent
    assert (receiver.kernel_drops, receiver.foreign) == (0, 0)
    assert list(receiver.drain()) == []


def test_a_receiver_of_anybody_takes_the_datagrams_of_every_sender() -> None:
    receiver = UdpReceiver(HOST, 0, "angle_1")
    senders = [UdpSender(HOST, receiver.port, port, "angle_1") for port in (0, 0)]
    for k, sender in enumerate(senders):
        assert sender.send(bytes([k]))
    assert arrivals(receiver, b"\1") == [b"\0", b"\1"]
    assert receiver.foreign == 0
    receiver.close()
    for sender in senders:
        sender.close()


def test_a_sender_has_the_port_that_its_receiver_expects() -> None:
    port, own_port = free_ports(HOST, [True] * 2)
    sender = UdpSender(HOST, port, own_port, "angle_1")
    assert sender.port == own_port
    assert not port_is_free(HOST, own_port)
    sender.close()
    assert port_is_free(HOST, own_port)


@pytest.mark.parametrize("flood", [300, 2000])
def test_the_kernel_counts_the_datagrams_dropped_for_a_full_buffer(
    flood: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(udp, "RECEIVE_BUFFER_BYTES", 16_384)
    receiver, sender = udp_ends()
    for k in range(flood):  # not read
        assert sender.send(k.to_bytes(4, "little") + bytes(120))
    read = list(receiver.drain())
    assert receiver.kernel_drops == 0  # the count comes with the next datagram received
    sender.send(b"last")
    read += arrivals(receiver, b"last")
    assert 0 < receiver.kernel_drops == flood + 1 - len(read)
    sender.close()
    receiver.close()


def test_a_drain_reads_a_bounded_number_of_datagrams(ends: Ends) -> None:
    receiver, sender = ends
    sent = [k.to_bytes(2, "little") for k in range(udp.DRAIN_LIMIT + 10)]
    for data in sent:
        sender.send(data)
    first = list(receiver.drain())
    assert len(first) <= udp.DRAIN_LIMIT
    assert first + arrivals(receiver, sent[-1]) == sent


def test_a_datagram_longer_than_the_maximum_is_cut(ends: Ends) -> None:
    receiver, sender = ends
    sender.send(bytes(20_000))
    sender.send(b"last")
    assert arrivals(receiver, b"last") == [bytes(udp.MAX_DATAGRAM_BYTES), b"last"]


def test_a_datagram_that_the_system_refuses_is_reported(ends: Ends) -> None:
    receiver, sender = ends
    assert not sender.send(bytes(70_000))  # beyond what UDP can carry
    assert sender.send(b"next")
    assert arrivals(receiver, b"next") == [b"next"]


def test_a_port_in_use_is_named_with_what_to_do_at_both_ends(ends: Ends) -> None:
    receiver, sender = ends
    for port in (receiver.port, sender.port):
        told = rf"UDP port {port} on {HOST} .*'platform_1'.*network\.base_port"
        with pytest.raises(PortInUse, match=told):
            UdpReceiver(HOST, port, "platform_1")
        with pytest.raises(PortInUse, match=told):
            UdpSender(HOST, receiver.port, port, "platform_1")


def test_a_port_is_free_until_it_is_bound_and_again_after(ends: Ends) -> None:
    port = free_port(HOST)
    assert port_is_free(HOST, port)
    taken = UdpReceiver(HOST, port, "angle_1")
    assert not port_is_free(HOST, port)
    taken.close()
    assert port_is_free(HOST, port)
    assert not any(port_is_free(HOST, end.port) for end in ends)


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


def test_pictures_arrive_with_their_pixels_and_the_closing_count(
    context: Context, address: str
) -> None:
    receiver = FrameReceiver(context, address, "frame_1", SESSION)
    sender = FrameSender(context, address, "frame_1", SESSION)
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
    context: Context, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frames, "DRAIN_LIMIT", 2)
    receiver = FrameReceiver(context, address, "frame_1", SESSION)
    sender = FrameSender(context, address, "frame_1", SESSION)
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


def test_a_picture_cut_out_of_a_larger_one_arrives_with_its_own_pixels(
    context: Context, address: str
) -> None:
    receiver = FrameReceiver(context, address, "frame_1", SESSION)
    sender = FrameSender(context, address, "frame_1", SESSION)
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


def test_a_frame_of_the_sender_that_is_not_whole_is_refused_and_a_strangers_is_foreign(
    context: Context, address: str
) -> None:
    receiver = FrameReceiver(context, address, "frame_1", SESSION)
    stranger = context.socket(zmq.PUSH)
    stranger.connect(address)
    frame, size = picture(), 48 * 64
    pixels = bytes(size)
    head = encode("frame_1", frame, SESSION)
    unknown = encode("frame_1", msgspec.structs.replace(frame, encoding="rgb16"), SESSION)
    colour = encode("frame_1", msgspec.structs.replace(frame, encoding="bgr8"), SESSION)
    out_of_range = encode("frame_1", msgspec.structs.replace(frame, exposure_ns=-1), SESSION)
    own: list[tuple[list[bytes], Reject]] = [
        ([head, bytes(size - 1)], Reject.LENGTH),
        ([head, bytes(size + 1)], Reject.LENGTH),
        ([head, b""], Reject.LENGTH),
        ([head], Reject.LENGTH),
        ([head, pixels, b""], Reject.LENGTH),
        ([colour, pixels], Reject.LENGTH),
        ([unknown, pixels], Reject.OUT_OF_RANGE),
        ([out_of_range, pixels], Reject.OUT_OF_RANGE),
    ]
    foreign = [
        [b"", pixels],
        [b"hello"],
        [b"SW" + head[2:-1] + b"\0", pixels],  # another CRC
        [b"sw" + head[2:], pixels],
        [head + b"\0", pixels],
        [head + bytes(frames.MAX_HEAD_BYTES), pixels],
        [encode("frame_1", frame, SESSION + 1), pixels],
        [datagram("angle_1", head[28:-4]), pixels],
    ]
    for parts in (*(parts for parts, _ in own), *foreign):
        stranger.send_multipart(parts)
    stranger.send_multipart([head, frame.pixels.tobytes()])
    *refused, taken = pulled(receiver, len(own) + 1)
    assert refused == [reason for _, reason in own]
    assert receiver.foreign == len(foreign)
    assert isinstance(taken, Frame)
    assert np.array_equal(taken.pixels, frame.pixels)
    stranger.close()
    receiver.close()


def test_frames_beyond_the_bound_of_a_message_end_the_connection_of_their_sender_alone(
    context: Context, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frames, "MAX_BYTES", 10_000)
    receiver = FrameReceiver(context, address, "frame_1", SESSION)
    stranger = context.socket(zmq.PUSH)
    stranger.connect(address)
    stranger.send(bytes(10_001))
    sender = FrameSender(context, address, "frame_1", SESSION)
    assert sender.send(picture(7))
    (taken,) = pulled(receiver, 1)
    assert isinstance(taken, Frame)
    assert (taken.seq, receiver.foreign) == (7, 0)
    stranger.close(0)
    sender.close(1, 0)
    receiver.close()


@pytest.mark.parametrize(("letters", "arrive"), [(15, 15), (16, 16), (17, 16), (40, 16)])
def test_the_name_of_a_camera_is_cut_at_16_bytes(
    context: Context, address: str, letters: int, arrive: int
) -> None:
    name = "abcdefghijklmnopqrstuvwxyz0123456789ABCDEFGH"
    receiver = FrameReceiver(context, address, "frame_1", SESSION)
    sender = FrameSender(context, address, "frame_1", SESSION)
    sender.send(msgspec.structs.replace(picture(), camera=name[:letters]))
    sender.close(1, 0)
    taken, _ = pulled(receiver, 2)
    assert isinstance(taken, Frame)
    assert taken.camera == name[:arrive]
    assert taken.encoding == "mono8"  # the next field is untouched
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
    context: Context, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frames, "LINGER_MS", 0)
    sender = FrameSender(context, address, "frame_1", SESSION)
    taken = [sender.send(picture(seq, 2, 2)) for seq in range(frames.HIGH_WATER + 3)]
    assert taken == [True] * frames.HIGH_WATER + [False] * 3
    sender.close(frames.HIGH_WATER, 0)


def test_a_frame_address_in_use_is_named_with_what_to_do(context: Context, address: str) -> None:
    receiver = FrameReceiver(context, address, "frame_1", SESSION)
    assert not port_is_free(HOST, int(address.rpartition(":")[2]), udp=False)
    with pytest.raises(PortInUse, match=rf"{address} for .*'frame_1'.*network\.base_port"):
        FrameReceiver(context, address, "frame_1", SESSION)
    receiver.close()


def test_frames_travel_over_a_local_socket(context: Context, tmp_path: Path) -> None:
    address = f"ipc://{tmp_path}/frame_1"
    receiver = FrameReceiver(context, address, "frame_1", SESSION)
    sender = FrameSender(context, address, "frame_1", SESSION)
    assert sender.send(picture(3))
    sender.close(1, 0)
    frame, closing = pulled(receiver, 2)
    assert isinstance(frame, Frame)
    assert np.array_equal(frame.pixels, picture(3).pixels)
    assert closing == Closing(1)
    receiver.close()
