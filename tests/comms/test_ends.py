"""Both ends of a channel over real sockets: every packet that was sent is in the ledger once."""

from __future__ import annotations

import heapq
import select
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest
import zmq
from hypothesis import given, settings
from hypothesis import strategies as st

from comms import frames, udp
from comms.codec import encode
from comms.endpoints import DatagramPorts, choose_ports, endpoints
from comms.ends import ChannelReceiver, ChannelSender, Wiring
from comms.frames import FrameSender
from comms.link import LinkCount, LinkFaults, merge_counts
from comms.messages import Frame, Message, Reference, axis_setpoint
from comms.operator_bus import Context
from comms.task import Send
from comms.task_output import TaskOutput
from comms.udp import UdpReceiver, UdpSender, free_ports
from tests.comms.wire_reference import HEADER, SESSION, VERSION, WIRE, with_values

HOST, MS = "127.0.0.1", 1_000_000
LOOKS, LOOK_S = 250, 0.02  # five seconds in all; only a failure takes them
ZERO = (0.0, 0.0, 0.0)
NO_BUS = dict.fromkeys(("commands", "telemetry", "pictures"), f"tcp://{HOST}:9")


class At:
    """Clock that stands at an instant."""

    def __init__(self, t_ns: int = 0) -> None:
        self.t_ns = t_ns

    def now_ns(self) -> int:
        """Read the time."""
        return self.t_ns


def wiring(**changes: Any) -> Wiring:
    """Wiring of a run on free ports."""
    ends = endpoints(HOST, choose_ports(HOST, 0), None)
    made = Wiring(
        session=SESSION,
        seed=5,
        zero_ns=0,
        host=HOST,
        ports=dict(ends.ports),
        addresses=dict(ends.addresses),
    )
    return msgspec.structs.replace(made, **changes)


@pytest.fixture
def context() -> Iterator[Context]:
    """A ZeroMQ context, destroyed after the test with all its sockets."""
    context: Context = zmq.Context()
    yield context
    context.destroy(0)


@contextmanager
def channel(name: str, context: Context, **changes: Any) -> Iterator[Ends]:
    """Both ends of a channel; the sender may be closed before the end."""
    made = wiring(**changes)
    receiver = ChannelReceiver(name, made, context)
    ends = Ends(ChannelSender(name, made, context), receiver)
    yield ends
    ends.sender.close(0)
    receiver.socket.close()


class Ends(NamedTuple):
    """Both ends of a channel."""

    sender: ChannelSender
    receiver: ChannelReceiver

    def row(self) -> LinkCount:
        """Row of the ledger."""
        return merge_counts(self.sender.count, self.receiver.count)

    def send(self, seq: int, t_ns: int = 0) -> None:
        """Send a packet through the link model, at once."""
        if self.sender.apply_link(seq) is not None:
            self.sender.send(reference(seq, t_ns))


def reference(seq: int, t_target_ns: int = 0) -> bytes:
    """A datagram with a sequence number."""
    message = Reference(seq=seq, t_ns=0, t_target_ns=t_target_ns, position_m=ZERO)
    return encode("reference", message, SESSION)


def read_all(receiver: ChannelReceiver, clock: At) -> list[Message]:
    """Everything that waits in the socket: loopback delivers at once."""
    got: list[Message] = []
    while select.select([receiver], [], [], 0)[0]:
        got += receiver.read(clock)
    return got


# the ledger, with a network between the ends that does to packets what networks do


class Packet(NamedTuple):
    """What happens to a packet between the ends."""

    copies: int  # 0: lost on the way
    flipped: int | None  # bit that changes
    extra_ms: int  # beside the jitter of the link model


packets = st.builds(
    Packet,
    st.sampled_from([0, 1, 1, 1, 2, 3]),
    st.one_of(st.none(), st.none(), st.none(), st.integers(0, 8 * 64 - 1)),
    st.integers(0, 30),
)
link_faults = st.builds(
    LinkFaults,
    delay_ms=st.floats(0, 20),
    jitter_ms=st.sampled_from([0.0, 15.0, 60.0]),
    loss=st.sampled_from([0.0, 0.2, 0.7]),
    burst=st.integers(1, 4),
)


@contextmanager
def network(context: Context, faults: LinkFaults) -> Iterator[Network]:
    """A channel that passes through a program of the test; all sockets are closed at the end."""
    into, from_, out, arrive = free_ports(HOST, [True] * 4)
    base = wiring(faults={"reference": faults})
    before = msgspec.structs.replace(base, ports={"reference": DatagramPorts(into, from_)})
    behind = msgspec.structs.replace(base, ports={"reference": DatagramPorts(arrive, out)})
    ends = Ends(
        ChannelSender("reference", before, context), ChannelReceiver("reference", behind, context)
    )
    made = Network(
        ends, UdpReceiver(HOST, into, "reference", from_), UdpSender(HOST, arrive, out, "reference")
    )
    yield made
    ends.sender.close(0)
    ends.receiver.socket.close()
    made.entry.close()
    made.exit.close()


class Network(NamedTuple):
    """Both ends, and what lies between: `entry` of the sender, `exit` to the receiver."""

    ends: Ends
    entry: UdpReceiver
    exit: UdpSender

    def pass_on(self, data: bytes, packet: Packet) -> None:
        """Deliver one packet to the receiver, or not."""
        changed = bytearray(data)
        if packet.flipped is not None:
            changed[packet.flipped // 8] ^= 1 << packet.flipped % 8
        for _ in range(packet.copies):
            self.exit.send(bytes(changed))


class Truth:
    """What a receiver must count, from the arrivals alone."""

    def __init__(self) -> None:
        self.seen: set[int] = set()
        self.newest: list[int] = []  # packets that were the newest at their arrival
        self.superseded = self.copies = self.damaged = self.dropped = 0

    def take(self, seq: int, packet: Packet) -> None:
        """Take a packet with its copies."""
        self.dropped += packet.copies == 0
        if packet.flipped is not None:
            self.damaged += packet.copies
            return
        for _ in range(packet.copies):
            self.copies += seq in self.seen
            if seq not in self.seen:
                self.superseded += bool(self.newest) and seq < self.newest[-1]
                if not self.newest or seq > self.newest[-1]:
                    self.newest.append(seq)
            self.seen.add(seq)


@settings(deadline=None, max_examples=60)
@given(st.lists(packets, max_size=40), link_faults, st.lists(st.binary(max_size=100), max_size=5))
def test_sent_is_delivered_lost_and_rejected_with_copies_and_strangers_outside(
    fates: list[Packet], faults: LinkFaults, junk: list[bytes]
) -> None:
    context: Context = zmq.Context()
    with network(context, faults) as net:
        arrivals: list[tuple[int, int]] = []
        kept: list[int] = []  # by the link model
        for seq, packet in enumerate(fates):  # 10 ms apart
            delay_ns = net.ends.sender.apply_link(seq)
            if delay_ns is not None:
                kept.append(seq)
                heapq.heappush(arrivals, (seq * 10 * MS + packet.extra_ms * MS + delay_ns, seq))
        truth, messages = Truth(), list[Message]()
        stranger = UdpSender(HOST, net.ends.receiver.socket.port, 0, "a stranger")  # type: ignore[union-attr]
        for data in (*junk, reference(3)):
            stranger.send(data)
        while arrivals:
            t_ns, seq = heapq.heappop(arrivals)
            net.ends.sender.send(reference(seq))
            (data,) = net.entry.drain()
            net.pass_on(data, fates[seq])
            truth.take(seq, fates[seq])
            messages += read_all(net.ends.receiver, At(t_ns))
        stranger.close()
        row = net.ends.row()
        receipts = net.ends.receiver.receipts
    context.term()
    rejected = sum(row.rejected.values())
    assert [message.seq for message in messages] == truth.newest
    assert (row.sent, row.lost) == (len(fates), len(fates) - len(kept))
    assert row.delivered == len(truth.seen)
    assert (row.superseded, row.duplicated) == (truth.superseded, truth.copies)
    assert rejected == truth.damaged
    assert (row.foreign, row.lost_kernel, row.lost_queue) == (0, 0, 0)
    assert len(receipts) == row.delivered + row.duplicated
    # what the network took is missing; a damaged packet that came twice is there once too often
    damaged = [fates[seq] for seq in kept if fates[seq].flipped is not None]
    came_again = sum(max(0, packet.copies - 1) for packet in damaged)
    assert row.unaccounted == truth.dropped - came_again


@pytest.mark.parametrize("loss", [0.0, 0.3])
def test_without_a_network_between_the_ends_the_row_balances(context: Context, loss: float) -> None:
    faults = {"reference": LinkFaults(loss=loss)}
    with channel("reference", context, faults=faults) as ends:
        for seq in range(200):
            ends.send(seq)
        read_all(ends.receiver, At())
        row = ends.row()
    assert (row.sent, row.unaccounted) == (200, 0)
    assert row.delivered == 200 - row.lost_link
    assert (row.lost_link > 0) == (loss > 0)


def test_a_packet_that_the_socket_refuses_is_lost_in_the_queue(context: Context) -> None:
    with channel("reference", context) as ends:
        ends.send(0)
        ends.sender.apply_link(1)
        ends.sender.send(bytes(70_000))  # beyond what UDP can carry
        ends.send(2)
        assert [message.seq for message in read_all(ends.receiver, At())] == [0, 2]
        row = ends.row()
    assert (row.sent, row.delivered, row.lost_queue, row.unaccounted) == (3, 2, 1, 0)


def test_what_the_kernel_drops_is_lost_in_the_row(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(udp, "RECEIVE_BUFFER_BYTES", 16_384)
    with channel("reference", context) as ends:
        for seq in range(500):  # not read
            ends.send(seq)
        read = len(read_all(ends.receiver, At()))
        ends.send(500)  # its arrival tells the count
        read += len(read_all(ends.receiver, At()))
        row = ends.row()
    assert 0 < row.lost_kernel == 501 - read
    assert (row.delivered, row.lost, row.unaccounted) == (read, row.lost_kernel, 0)


def test_what_came_before_the_receiver_was_connected_is_foreign_in_the_row(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    connect = udp.connect
    stranger = UdpSender(HOST, 9, 0, "a stranger")  # port 9: discard

    def late(connected: Any, where: tuple[str, int]) -> None:
        stranger._socket.connect(connected.getsockname())
        stranger.send(reference(7))  # knows even the session
        connect(connected, where)

    made = wiring()
    with monkeypatch.context() as patch:
        patch.setattr(udp, "connect", late)
        receiver = ChannelReceiver("reference", made, context)
    ends = Ends(ChannelSender("reference", made, context), receiver)
    ends.send(0)
    assert [message.seq for message in read_all(receiver, At())] == [0]
    row = ends.row()
    assert (row.foreign, row.delivered, row.rejected, row.unaccounted) == (1, 1, {}, 0)
    assert [seq for seq, _, _ in receiver.receipts] == [0]
    ends.sender.close(0)
    receiver.socket.close()
    stranger.close()


def picture(seq: int, t_ns: int = 0) -> Frame:
    """A small grey frame."""
    times = {"t_ns": t_ns, "t_exposure_start_ns": t_ns, "exposure_ns": 10, "row_ns": 0}
    pixels = np.full((2, 2), seq % 256, np.uint8)
    return Frame(
        seq=seq, camera="front", encoding="mono8", height=2, width=2, pixels=pixels, **times
    )


def read_until(receiver: ChannelReceiver, clock: At, count: int) -> list[Message]:
    """Read frames until so many packets arrived, foreign ones counted."""
    got: list[Message] = []
    for _ in range(LOOKS):
        got += receiver.read(clock)
        if receiver.count.delivered + receiver.count.foreign >= count:
            break
        # an edge of a ZeroMQ descriptor can be missed, hence the short timeout
        select.select([receiver], [], [], 0 if receiver.has_pending() else LOOK_S)
    return got


def test_a_frame_of_another_run_is_foreign_in_the_row(context: Context) -> None:
    made = wiring()
    receiver = ChannelReceiver("frame_1", made, context)
    ends = Ends(ChannelSender("frame_1", made, context), receiver)
    stranger = FrameSender(context, made.addresses["frame_1"], "frame_1", SESSION + 1)
    assert stranger.send(picture(5))
    ends.sender.apply_link(0)
    ends.sender.send(picture(0))
    assert [message.seq for message in read_until(receiver, At(), 2)] == [0]
    row = ends.row()
    assert (row.foreign, row.delivered, row.rejected, row.unaccounted) == (1, 1, {}, 0)
    stranger.close(1, 0)
    ends.sender.close(0)
    receiver.socket.close()


def test_frames_that_nobody_takes_are_lost_in_the_queue(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frames, "LINGER_MS", 0)
    sender = ChannelSender("frame_1", wiring(), context)
    for seq in range(frames.HIGH_WATER + 3):
        sender.apply_link(seq)
        sender.send(picture(seq))
    assert (sender.count.sent, sender.count.lost_queue) == (frames.HIGH_WATER + 3, 3)
    sender.close(0)


# the closing datagram


def test_the_closing_datagram_tells_the_receiver_that_nothing_follows(context: Context) -> None:
    with channel("reference", context) as ends:
        ends.send(0)
        read_all(ends.receiver, At())
        before = msgspec.structs.asdict(ends.receiver.count)
        is_closed = [ends.receiver.closed]
        ends.sender.close(0)
        assert read_all(ends.receiver, At()) == []
        is_closed.append(ends.receiver.closed)
        assert is_closed == [False, True]
        assert msgspec.structs.asdict(ends.receiver.count) == before  # no packet of the ledger


@pytest.mark.parametrize("taken", [0, 1, 5])
def test_the_closing_datagram_carries_the_number_of_packets_that_the_socket_took(
    context: Context, taken: int
) -> None:
    made = wiring(faults={"reference": LinkFaults(loss=0.5)})
    ports = made.ports["reference"]
    end = UdpReceiver(HOST, ports.receiver, "reference", ports.sender)
    sender = ChannelSender("reference", made, context)
    sender.apply_link(90)  # may be lost; that is not sent
    for seq in range(taken):
        sender.send(reference(seq))
    sender.send(bytes(70_000))  # refused
    sender.close(77)
    *sent, first, second, third = end.drain()
    assert sent == [reference(seq) for seq in range(taken)]
    assert first == second == third  # one of them may be lost
    assert first == closing(taken, 77)
    end.close()


def closing(count: int, t_ns: int) -> bytes:
    """The closing datagram of the references, by the page of the wire."""
    head = struct.pack(HEADER, b"SW", VERSION, 3, 32, 1, SESSION, count, t_ns)
    return head + struct.pack("<I", zlib.crc32(head))


# late packets

LATE_AFTER_MS = {  # of docs/wire.md
    **dict.fromkeys(("reference", "setpoint", "joint_state", "robot_state"), 30),
    **dict.fromkeys(("platform_1", "platform_2", "platform_3"), 30),
    **dict.fromkeys(("angle_1", "angle_2", "angle_3"), 80),
    "truth": 1000,
}


@pytest.mark.parametrize("name", LATE_AFTER_MS.keys() - {"truth"})
@pytest.mark.parametrize(("more_ms", "late"), [(-1, 0), (0, 0), (1, 1)])
def test_a_packet_is_late_beyond_the_age_of_its_channel(
    context: Context, name: str, more_ms: int, late: int
) -> None:
    """Stamped 0, as its target: age and time of the arrival are the same."""
    with channel(name, context) as ends:
        ends.sender.send(with_values(name, {}))
        age_ns = (LATE_AFTER_MS[name] + more_ms) * MS
        assert len(read_all(ends.receiver, At(age_ns))) == 1
        count = ends.receiver.count
    assert (count.delivered, count.late) == (1, late)
    assert ends.receiver.receipts == [(0, age_ns, "")]


@pytest.mark.parametrize(("age_ms", "late"), [(29, 0), (31, 1)])
def test_a_reference_is_late_by_its_target(context: Context, age_ms: int, late: int) -> None:
    with channel("reference", context) as ends:
        ends.sender.send(reference(0, t_target_ns=500 * MS))
        read_all(ends.receiver, At((500 + age_ms) * MS))
        assert (ends.receiver.count.delivered, ends.receiver.count.late) == (1, late)


FRAMES = ("frame_1", "frame_2", "frame_3")


@pytest.mark.parametrize("name", FRAMES)
@pytest.mark.parametrize(("age_ms", "late"), [(39, 0), (40, 0), (41, 1)])
def test_a_frame_is_late_beyond_40_ms(context: Context, name: str, age_ms: int, late: int) -> None:
    with channel(name, context) as ends:
        ends.sender.send(picture(0, t_ns=100 * MS))
        read_until(ends.receiver, At((100 + age_ms) * MS), 1)
        assert (ends.receiver.count.delivered, ends.receiver.count.late) == (1, late)


def test_the_age_of_every_channel_of_data_was_tested() -> None:
    stamped_on_arrival = {"can_down", "can_up"}  # a frame of the field bus has no stamp
    assert LATE_AFTER_MS.keys() | {*FRAMES} | stamped_on_arrival == WIRE.keys()


# the wiring


def test_a_wiring_has_defaults_for_what_most_tasks_do_not_need() -> None:
    made = wiring()
    assert (made.faults, made.stop_ports, made.stop_key, made.priority) == ({}, {}, "", 0)
    assert made.pictures_hz == 2.0
    assert (made.operator_silent_ns, made.orphan_ns) == (2000 * MS, 800 * MS)


def test_a_wiring_travels_as_json() -> None:
    made = wiring(faults={"reference": LinkFaults(loss=0.5)}, stop_ports={"controller": 5})
    assert msgspec.json.decode(msgspec.json.encode(made), type=Wiring) == made
    assert isinstance(made.ports["reference"], DatagramPorts)


@pytest.mark.parametrize(
    ("faults", "delay_ns"),
    [
        ({}, 0),
        ({"angle_1": LinkFaults(delay_ms=900)}, 0),
        ({"reference": LinkFaults(delay_ms=1.5)}, 1_500_000),
        ({"reference": LinkFaults(delay_ms=1.5, jitter_ms=20, loss=0.5)}, 21_500_000),
    ],
)
def test_a_receiver_knows_the_longest_delay_of_its_link(
    context: Context, faults: dict[str, LinkFaults], delay_ns: int
) -> None:
    with channel("reference", context, faults=faults) as ends:
        assert ends.receiver.max_delay_ns == delay_ns


class Pictures:
    """Bus that keeps the pictures."""

    def __init__(self) -> None:
        self.taken: list[int] = []

    def picture(self, channel: str, data: bytes, pixels: bytes) -> None:
        """Keep the number of a picture, which is the value of its pixels."""
        self.taken.append(pixels[0])

    def add_telemetry(self, channel: str, data: bytes) -> None:
        """Keep nothing."""


@pytest.mark.parametrize(
    ("changes", "pictures"),
    [
        ({}, [0, 25, 50, 75]),  # two a second
        ({"pictures_hz": 10.0}, list(range(0, 100, 5))),
        ({"pictures_hz": 0.0}, []),
    ],
)
def test_of_50_frames_a_second_so_many_are_logged_as_pictures(
    context: Context,
    monkeypatch: pytest.MonkeyPatch,
    changes: dict[str, float],
    pictures: list[int],
) -> None:
    monkeypatch.setattr(frames, "LINGER_MS", 0)
    bus = Pictures()
    output = TaskOutput("bench", wiring(**changes), context, bus, At())  # type: ignore[arg-type]
    for k in range(100):
        output.take([Send("frame_1", picture(k, t_ns=k * 20 * MS), k * 20 * MS)])
    assert bus.taken == pictures
    output.close()


def test_the_log_gets_pictures_of_every_camera(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frames, "LINGER_MS", 0)
    bus, tasks = Pictures(), ("bench", "vision", "vision_2")
    output = TaskOutput("bench", wiring(tasks=tasks), context, bus, At())  # type: ignore[arg-type]
    for k in range(100):
        for channel, seq in (("frame_1", k), ("frame_2", 100 + k)):
            output.take([Send(channel, picture(seq, t_ns=k * 20 * MS), k * 20 * MS)])
    assert bus.taken == [0, 100, 25, 125, 50, 150, 75, 175]
    output.close()


def test_a_task_sends_on_the_ports_of_its_channels_and_on_no_other(context: Context) -> None:
    made = wiring()
    ends = {name: made.ports[name] for name in ("robot_state", "platform_1", "setpoint")}
    receivers = {n: UdpReceiver(HOST, p.receiver, n, p.sender) for n, p in ends.items()}
    output = TaskOutput("controller", made, context, Pictures(), At())  # type: ignore[arg-type]
    output.take([Send("setpoint", axis_setpoint(4, 0, ZERO), 0)])
    output.send_due()
    assert [len(list(receiver.drain())) for receiver in receivers.values()] == [0, 0, 1]
    output.close()
    for receiver in receivers.values():
        receiver.close()
