"""Other programs on the machine: they are not heard, and they cost nothing."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import Any

import pytest
import zmq

from comms import operator_bus
from comms.bus_content import Hello, Request, Telemetry
from comms.bus_folder import address, opened
from comms.codec import encode
from comms.frames import FrameReceiver
from comms.messages import Reference
from comms.operator_bus import Context, OperatorBus, TaskBus
from comms.udp import UdpReceiver, UdpSender, free_ports

HOST = "127.0.0.1"
SESSION = 0x1234
LOOKS = 250  # of 20 ms; only a failure takes them all
REPLY = b'{"seq":0,"t_ns":0,"id":1,"sender":"controller","ok":true,"phase":"stopped"}'
REFERENCE = Reference(seq=0, t_ns=0, t_target_ns=0, position_m=(0.0, 0.0, 0.0))
Addresses = dict[str, str]


class Bench:
    """Operator's bus with one known task, and whoever else connects; closed at the end."""

    def __init__(self, context: Context, addresses: dict[str, str]) -> None:
        self.context, self.addresses = context, addresses
        self.bus = OperatorBus(context, ["controller"], SESSION, addresses)
        self._opened: list[Any] = [self.bus]

    def stranger(self, kind: int, socket_name: str, *parts: bytes, name: bytes = b"") -> None:
        """Connect and send one message."""
        stranger: Any = self.context.socket(kind)
        stranger.setsockopt(zmq.LINGER, 0)
        if name:
            stranger.setsockopt(zmq.IDENTITY, name)
        stranger.connect(self.addresses[socket_name])
        stranger.send_multipart(parts)
        self._opened.append(stranger)

    def task(self, name: str) -> TaskBus:
        """Connect a task that knows the session."""
        task = TaskBus(self.context, name, SESSION, self.addresses)
        self._opened.append(task)
        return task

    def heard(self, count: int = 1) -> list[tuple[str, Any]]:
        """What the operator hears: at least so many messages, foreign ones counted."""
        found: list[tuple[str, Any]] = []
        for _ in range(LOOKS):
            found += self.bus.drain()
            if len(found) + self.bus.foreign >= count:
                break
            self.bus.wait(20)
        return found

    def close(self) -> None:
        """Close every socket."""
        for opened_one in self._opened:
            opened_one.close()


@pytest.fixture
def context() -> Iterator[Context]:
    """Sockets that are all closed at the end."""
    made: Context = zmq.Context()
    yield made
    made.destroy(0)


@pytest.fixture
def bench(context: Context) -> Iterator[Bench]:
    """A bus on local sockets."""
    with opened(True) as folder:
        assert folder is not None
        names = ("commands", "telemetry", "pictures", "frame_1")
        made = Bench(context, {name: address(folder, name) for name in names})
        yield made
        made.close()


@pytest.mark.parametrize("parts", [[b"hello"], [b"reply", REPLY], [b"farewell"], [b"junk"], [b""]])
@pytest.mark.parametrize("name", [b"", b"controller", b"controller:0000000000001235"])
def test_who_does_not_know_the_session_is_no_task(
    bench: Bench, parts: list[bytes], name: bytes
) -> None:
    bench.stranger(zmq.DEALER, "commands", *parts, name=name)
    assert (bench.heard(), bench.bus.foreign) == ([], 1)


def test_a_stranger_with_the_name_of_a_task_does_not_shut_it_out(bench: Bench) -> None:
    bench.stranger(zmq.DEALER, "commands", b"hello", name=b"controller")
    bench.heard()
    bench.task("controller").hello()
    assert bench.heard(2) == [("controller", Hello())]


def test_a_task_that_the_operator_did_not_start_is_foreign(bench: Bench) -> None:
    bench.task("streamer").hello()
    assert (bench.heard(), bench.bus.foreign) == ([], 1)


def test_a_request_of_another_terminal_is_heard(bench: Bench) -> None:
    bench.stranger(zmq.DEALER, "commands", b"", b"stop")
    [(sender, request)] = bench.heard()
    assert sender == ""
    assert isinstance(request, Request)
    assert request.text == "stop"


@pytest.mark.parametrize(
    "parts",
    [[b"farewell", b"controller"], [b"unknown", b"x"], [b"command", b"x"], [b"truth"], [b"\xff"]],
)
def test_telemetry_of_no_task_is_foreign(bench: Bench, parts: list[bytes]) -> None:
    bench.stranger(zmq.PUSH, "telemetry", *parts)
    assert (bench.heard(), bench.bus.foreign) == ([], 1)


def test_a_message_beyond_the_bound_ends_its_connection_and_no_other(bench: Bench) -> None:
    too_long = bytes(operator_bus.MAX_COMMAND_BYTES + 1)
    bench.stranger(zmq.DEALER, "commands", b"reply", too_long)
    too_long = bytes(operator_bus.MAX_TELEMETRY_BYTES + 1)
    bench.stranger(zmq.PUSH, "telemetry", b"reference", too_long)
    task = bench.task("controller")
    task.add_telemetry("reference", encode("reference", REFERENCE, SESSION))
    task.flush_telemetry()
    task.hello()
    assert {type(content) for _, content in bench.heard(2)} == {Hello, Telemetry}
    assert bench.bus.foreign == 0


def test_a_frame_of_no_run_is_foreign_and_not_in_the_sum(bench: Bench) -> None:
    receiver = FrameReceiver(bench.context, bench.addresses["frame_1"], "frame_1", SESSION)
    for data in (b"", b"junk", bytes(84), encode("reference", REFERENCE, SESSION)):
        bench.stranger(zmq.PUSH, "frame_1", data)
    for _ in range(LOOKS):
        assert list(receiver.drain()) == []
        if receiver.foreign == 4:
            break
        bench.bus.wait(20)
    assert receiver.foreign == 4
    receiver.close()


def test_a_datagram_from_another_port_is_not_received() -> None:
    own, ours, stranger = free_ports(HOST, [True] * 3)
    receiver = UdpReceiver(HOST, own, "reference", ours)
    sender = UdpSender(HOST, own, ours, "reference")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind((HOST, stranger))
        other.sendto(b"forged", (HOST, own))
        sender.send(b"ours")
        other.sendto(b"forged", (HOST, own))
    assert list(receiver.drain()) == [b"ours"]
    receiver.close()
    sender.close()


def test_what_arrived_before_the_receiver_was_connected_is_foreign(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    own, ours = free_ports(HOST, [True] * 2)
    connect = socket.socket.connect

    def late(connected: socket.socket, where: Any) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.sendto(b"early", (HOST, own))
        connect(connected, where)

    with monkeypatch.context() as patch:
        patch.setattr("comms.udp.connect", late)
        receiver = UdpReceiver(HOST, own, "reference", ours)
    assert list(receiver.drain()) == []
    assert receiver.foreign == 1
    receiver.close()


def test_a_sender_goes_on_after_its_receiver_was_missing() -> None:
    own, ours = free_ports(HOST, [True] * 2)
    sender = UdpSender(HOST, own, ours, "reference")
    assert [sender.send(b"lost") for _ in range(3)] == [True] * 3
    receiver = UdpReceiver(HOST, own, "reference", ours)
    sender.send(b"first")
    assert sender.send(b"second")
    assert list(receiver.drain())[-1] == b"second"
    receiver.close()
    sender.close()
