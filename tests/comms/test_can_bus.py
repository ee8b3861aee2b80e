"""Field bus between processes: frames by UDP unicast, bus objects of python-can, identifiers."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comms import can_bus
from comms.can_bus import CanEnd, CanSettings, CanUnavailable, chosen, is_of_node, open_bus
from comms.can_udp import UdpUnicastBus
from comms.messages import CanMessage

UNTIMED = settings(deadline=None)  # a busy machine is no failure
BOUND_S = 5.0  # of every wait
HOST = "127.0.0.1"
PORTS = 8  # of a bus


class StillClock:
    """Clock that stands at 7 ns."""

    def now_ns(self) -> int:
        return 7

    def sleep_until_ns(self, t_ns: int) -> None:
        raise AssertionError(f"slept until {t_ns}")


def free_channel() -> str:
    """Name a channel with eight free ports."""
    return f"{HOST}:{chosen(CanSettings(interface='swayless_udp')).port}"


@pytest.fixture
def channel() -> str:
    return free_channel()


@pytest.fixture(scope="module")
def pair() -> Iterator[tuple[UdpUnicastBus, UdpUnicastBus]]:
    """Two bus objects of a channel of their own; each test takes what it sends."""
    channel = free_channel()
    with UdpUnicastBus(channel) as one, UdpUnicastBus(channel) as other:
        yield one, other


@st.composite
def can_messages(draw: st.DrawFn) -> can.Message:
    is_extended, is_remote = draw(st.booleans()), draw(st.booleans())
    data = draw(st.binary(max_size=8))
    return can.Message(
        arbitration_id=draw(st.integers(0, 2**29 - 1 if is_extended else 0x7FF)),
        is_extended_id=is_extended,
        is_remote_frame=is_remote,
        is_error_frame=draw(st.booleans()) and not is_remote,
        dlc=len(data),
        data=None if is_remote else data,
        check=True,
    )


@given(message=can_messages())
@UNTIMED
def test_any_frame_arrives_at_the_other_bus_object_as_it_was_sent(
    pair: tuple[UdpUnicastBus, UdpUnicastBus], message: can.Message
) -> None:
    one, other = pair
    one.send(message)
    got = other.recv(BOUND_S)
    assert got is not None
    assert got.equals(message, timestamp_delta=None, check_channel=False)
    assert other.recv(0) is None
    assert one.recv(0) is None  # nobody hears itself


def test_a_frame_arrives_at_every_other_bus_object(channel: str) -> None:
    with (
        UdpUnicastBus(channel) as one,
        UdpUnicastBus(channel) as other,
        UdpUnicastBus(channel) as third,
    ):
        one.send(can.Message(arbitration_id=0x123, is_extended_id=False, data=b"\1\2"))
        for bus in (other, third):
            got = bus.recv(BOUND_S)
            assert (got.arbitration_id, bytes(got.data)) == (0x123, b"\1\2")


STRANGE = st.binary(max_size=40) | st.builds(
    struct.Struct("<IBBd8s").pack,
    st.integers(0, 2**32 - 1),
    st.integers(0, 255),
    st.integers(0, 255),
    st.just(0.0),
    st.binary(max_size=8),
)


@given(data=STRANGE)
@UNTIMED
def test_a_datagram_of_a_stranger_is_ignored(
    pair: tuple[UdpUnicastBus, UdpUnicastBus], data: bytes
) -> None:
    one, other = pair
    port = int(other.channel_info.rsplit(":", 1)[1])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(data, (HOST, port))
    assert other.recv(0) is None
    one.send(can.Message(arbitration_id=0x55, is_extended_id=False))
    got = other.recv(BOUND_S)
    assert got is not None
    assert got.arbitration_id == 0x55


def test_a_datagram_of_a_member_that_is_no_frame_is_ignored(channel: str) -> None:
    base = int(channel.rsplit(":", 1)[1])
    whole = struct.pack("<IBBd8s", 0x123, 0, 8, 0.0, bytes(8))
    too_long = struct.pack("<IBBd8s", 0x123, 0, 9, 0.0, bytes(8))
    with UdpUnicastBus(channel) as bus, socket.socket(type=socket.SOCK_DGRAM) as member:
        member.bind((HOST, base + PORTS - 1))
        own = int(bus.channel_info.rsplit(":", 1)[1])
        for data in (b"", whole[:-1], whole + b"\0", too_long):
            member.sendto(data, (HOST, own))
            assert bus.recv(0) is None
        member.sendto(whole, (HOST, own))
        assert bus.recv(BOUND_S) is not None


def test_a_bus_without_a_free_port_says_so_and_what_to_do() -> None:
    port = chosen(CanSettings(interface="swayless_udp")).port
    members = [UdpUnicastBus(f"{HOST}:{port}") for _ in range(PORTS)]
    try:
        with pytest.raises(CanUnavailable) as refused:
            open_bus(CanSettings(interface="swayless_udp", channel=f"{HOST}:{port}"))
    finally:
        for member in members:
            member.shutdown()
    assert f"no free port of {HOST}:{port} to {port + PORTS - 1}" in str(refused.value)
    assert "close a program on this bus, or name another channel" in str(refused.value)


@pytest.mark.parametrize("bad", ["can0", "127.0.0.1", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:-1"])
def test_a_channel_that_is_no_host_and_port_is_named(bad: str) -> None:
    with pytest.raises(CanUnavailable) as refused:
        open_bus(CanSettings(interface="swayless_udp", channel=bad))
    assert f"channel {bad!r}; must be host:port, e.g. 127.0.0.1:47300" in str(refused.value)


@pytest.mark.parametrize("port", [0, 65_529, 65_535, 70_000])
def test_a_channel_whose_eight_ports_do_not_exist_is_refused(port: int) -> None:
    with pytest.raises(CanUnavailable, match=f":{port}'; must be .* port of 1 to 65528"):
        open_bus(CanSettings(interface="swayless_udp", channel=f"127.0.0.1:{port}"))


def test_an_unknown_interface_is_named_with_the_next_step() -> None:
    with pytest.raises(CanUnavailable) as refused:
        open_bus(CanSettings(interface="warpdrive", channel="can7"))
    text = str(refused.value)
    assert text.startswith("[can] interface = 'warpdrive', channel = 'can7': ")
    assert text.endswith(
        "; look for the device and its driver, or take interface = 'auto' for a simulated bus"
    )


def test_a_device_that_is_not_there_is_named_with_the_next_step() -> None:
    with pytest.raises(
        CanUnavailable, match=r"interface = 'socketcan', channel = 'nocan9'.*; look"
    ):
        open_bus(CanSettings(interface="socketcan", channel="nocan9"))


@pytest.mark.parametrize(("has", "interface"), [(True, "udp_multicast"), (False, "swayless_udp")])
def test_auto_takes_multicast_where_it_works_and_unicast_else(
    monkeypatch: pytest.MonkeyPatch, has: bool, interface: str
) -> None:
    monkeypatch.setattr(can_bus, "has_multicast", lambda port: has)
    found = chosen(CanSettings())
    assert found.interface == interface
    assert found.port > 0
    assert chosen(CanSettings(interface="virtual", channel="a")).interface == "virtual"


MASTER, NODE = False, True
CONNECTION_SET = {  # CiA 301, tables of the predefined connection set; by function code
    0x080: NODE,  # emergency, node 1 to 127
    0x180: NODE,  # TPDO 1 to 4
    0x280: NODE,
    0x380: NODE,
    0x480: NODE,
    0x200: MASTER,  # RPDO 1 to 4
    0x300: MASTER,
    0x400: MASTER,
    0x500: MASTER,
    0x580: NODE,  # answer of the SDO server
    0x600: MASTER,  # request of the SDO client
    0x700: NODE,  # error control
}
BROADCAST = {0x000: MASTER, 0x080: MASTER, 0x100: MASTER}  # NMT, SYNC, TIME
LAYER_SETTING = {0x7E4: NODE, 0x7E5: MASTER}  # LSS, CiA 305: slave, master
HEARTBEAT_OF_MASTER = 0x77F  # of the node-ID 127, which is the master's own


@pytest.mark.parametrize("function", CONNECTION_SET)
def test_the_sender_of_an_identifier_is_that_of_the_connection_set(function: int) -> None:
    for node in range(1, 127):
        assert is_of_node(function + node) is CONNECTION_SET[function]


def test_broadcasts_and_the_heartbeat_of_the_master_are_not_of_a_node() -> None:
    assert {can_id: is_of_node(can_id) for can_id in BROADCAST} == BROADCAST
    assert not is_of_node(HEARTBEAT_OF_MASTER)


def can_end(channel: str) -> CanEnd:
    return CanEnd(CanSettings(interface="swayless_udp", channel=channel))


def frame(
    can_id: int, data: bytes = b"", *, is_remote: bool = False, length: int = 0
) -> CanMessage:
    return CanMessage(
        seq=0,
        t_ns=0,
        can_id=can_id,
        is_extended=can_id > 0x7FF,
        is_remote=is_remote,
        length=length or len(data),
        data=data,
    )


def test_a_process_hears_the_other_side_alone(channel: str) -> None:
    master, bench = can_end(channel), can_end(channel)
    try:
        for can_id in (0x080, 0x201, 0x601, 0x77F, 0x181, 0x701):
            assert master.send(frame(can_id, b"\5"))
        down = list(bench.drain(StillClock(), of_nodes=False))
        assert [(m.can_id, m.seq, m.t_ns) for m in down] == [
            *[(0x080, 0, 7), (0x201, 1, 7)],
            *[(0x601, 2, 7), (0x77F, 3, 7)],
        ]
        for can_id in (0x181, 0x581, 0x081, 0x701, 0x201):
            assert bench.send(frame(can_id, b"\1\2\3"))
        up = list(master.drain(StillClock(), of_nodes=True))
        assert [(m.can_id, m.length, m.data) for m in up] == [
            (can_id, 3, b"\1\2\3") for can_id in (0x181, 0x581, 0x081, 0x701)
        ]
    finally:
        master.close()
        bench.close()


def test_a_remote_frame_keeps_its_length_and_has_no_data(channel: str) -> None:
    master, bench = can_end(channel), can_end(channel)
    try:
        assert master.send(frame(0x601, is_remote=True, length=5))
        (got,) = bench.drain(StillClock(), of_nodes=False)
        assert (got.is_remote, got.length, got.data) == (True, 5, b"")
    finally:
        master.close()
        bench.close()


def test_a_drain_is_bounded_says_that_more_waits_and_the_next_one_goes_on(channel: str) -> None:
    master, bench = can_end(channel), can_end(channel)
    try:
        for number in range(100):
            assert master.send(frame(0x201, bytes([number])))
        first = list(bench.drain(StillClock(), of_nodes=False))
        assert bench.has_pending()
        rest = list(bench.drain(StillClock(), of_nodes=False))
        assert not bench.has_pending()
        assert len(first) < 100
        assert [m.data[0] for m in first + rest] == list(range(100))
        assert [m.seq for m in first + rest] == list(range(100))
    finally:
        master.close()
        bench.close()


def test_an_error_frame_is_counted_as_foreign(channel: str) -> None:
    end = can_end(channel)
    try:
        with UdpUnicastBus(channel) as bus:
            bus.send(can.Message(is_error_frame=True, arbitration_id=0x181, is_extended_id=False))
        assert list(end.drain(StillClock(), of_nodes=True)) == []
        assert end.foreign == 1
    finally:
        end.close()


def test_a_frame_that_the_interface_does_not_take_is_told(
    channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise can.CanOperationError("bus off")

    end = can_end(channel)
    monkeypatch.setattr(UdpUnicastBus, "send", refuse)
    assert end.send(frame(0x201)) is False
    end.close()
