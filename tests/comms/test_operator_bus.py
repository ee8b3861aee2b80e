"""Operator bus: commands, replies, telemetry and pictures; invalid data is ignored."""

from __future__ import annotations

import select
from collections.abc import Iterator

import pytest
import zmq

from comms.bus_content import Content, Hello, Record, Request, StreamEnd, Telemetry
from comms.bus_folder import address, opened
from comms.endpoints import BUS
from comms.errors import PortInUse
from comms.link import LinkCount
from comms.messages import Command, Phase, Reply, Verb
from comms.operator_bus import DRAIN_LIMIT, Context, OperatorBus, TaskBus, identity
from comms.operator_request import OperatorRequests
from comms.records import Event, LinkRow, Receipts, TaskTiming
from comms.udp import free_ports, port_is_free
from tests.comms.wire_reference import SESSION

HOST = "127.0.0.1"
LOOKS, LOOK_MS = 100, 50  # five seconds, far beyond what the loopback needs
REPLY = Reply(
    seq=1, t_ns=2, id=3, sender="vision", ok=True, phase=Phase.ARMED, text="armed, 20 °C", exit=None
)
RECORDS = (
    Receipts(channel="frame_1", rows=[(1, 2, "duplicate")]),
    TaskTiming(task="vision", t_ns=1, late_ticks=2, lateness_ns=[3]),
    LinkRow(channel="frame_1", count=LinkCount(sent=2, delivered=1, rejected={"crc": 1})),
    Event(t_ns=4, level="error", source="vision", text="lost"),
)


@pytest.fixture
def context() -> Iterator[Context]:
    """A ZeroMQ context, destroyed after the test with all its sockets."""
    context = zmq.Context()
    yield context
    context.destroy(0)


Heard = list[tuple[str, Content | Request]]
Addresses = dict[str, str]


def tcp_addresses() -> Addresses:
    """Free ports for the sockets of the operator."""
    ports = free_ports(HOST, [False] * len(BUS))
    return {name: f"tcp://{HOST}:{port}" for name, port in zip(BUS, ports, strict=True)}


@pytest.fixture(params=["tcp", "ipc"])
def addresses(request: pytest.FixtureRequest) -> Iterator[Addresses]:
    """Addresses of the operator: free ports, and local sockets in a folder of their own."""
    with opened(request.param == "ipc") as folder:
        yield {name: address(folder, name) for name in BUS} if folder else tcp_addresses()


@pytest.fixture
def operator(context: Context, addresses: Addresses) -> Iterator[OperatorBus]:
    """The operator's end, with two known tasks."""
    bus = OperatorBus(context, ("vision", "bench"), SESSION, addresses)
    yield bus
    bus.close()


@pytest.fixture
def vision(context: Context, operator: OperatorBus, addresses: Addresses) -> Iterator[TaskBus]:
    """The end of a task named vision, known to the operator."""
    bus = TaskBus(context, "vision", SESSION, addresses)
    bus.hello()
    assert received(operator, 1) == [("vision", Hello())]
    yield bus
    bus.close()


def received(operator: OperatorBus, count: int, foreign: int = 0) -> Heard:
    """The next `count` messages that the operator hears, and as many foreign ones in all."""
    got: Heard = []
    for _ in range(LOOKS):
        got += operator.drain()
        if len(got) >= count and operator.foreign >= foreign:
            break
        operator.wait(LOOK_MS)
    assert (len(got), operator.foreign) == (count, foreign)
    return got


def commands(task: TaskBus, count: int) -> list[Command | None]:
    """The next `count` commands and heartbeats that a task receives."""
    poller, got = zmq.Poller(), list[Command | None]()
    poller.register(task.fileno(), zmq.POLLIN)
    for _ in range(LOOKS):
        got += task.drain()
        if len(got) >= count:
            break
        poller.poll(LOOK_MS)
    assert len(got) == count
    return got


def test_commands_and_heartbeats_reach_the_addressed_task(
    operator: OperatorBus, vision: TaskBus
) -> None:
    start = Command(seq=1, t_ns=5, id=1, to="vision", verb=Verb.START, t_start_ns=600)
    # a task that is not connected: dropped
    operator.send(Command(seq=0, t_ns=5, id=1, to="bench", verb=Verb.START))
    operator.heartbeat("vision")
    operator.send(start)
    assert commands(vision, 2) == [None, start]


def test_a_reply_and_every_kind_of_record_arrive_unchanged(
    operator: OperatorBus, vision: TaskBus
) -> None:
    vision.reply(REPLY)
    for record in RECORDS:
        vision.record(record)
    assert received(operator, 5) == [
        ("vision", REPLY),
        *(("vision", Record(record)) for record in RECORDS),
    ]


def test_telemetry_arrives_in_order_once_flushed_and_pictures_at_once(
    operator: OperatorBus, vision: TaskBus
) -> None:
    vision.add_telemetry("angle_1", b"\0datagram")
    vision.add_telemetry("frame_1", b"")
    vision.flush_telemetry()
    vision.flush_telemetry()  # the batch is empty
    assert received(operator, 2) == [
        ("", Telemetry("angle_1", b"\0datagram", None)),
        ("", Telemetry("frame_1", b"", None)),
    ]
    vision.picture("frame_1", b"head", b"pixels")
    assert received(operator, 1) == [("", Telemetry("frame_1", b"head", b"pixels"))]
    assert (vision.dropped_telemetry, vision.dropped_pictures) == (0, 0)


def test_telemetry_and_pictures_beyond_the_queue_are_dropped_and_counted(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("comms.operator_bus.TELEMETRY_HIGH_WATER", 5)
    monkeypatch.setattr("comms.operator_bus.LINGER_MS", 0)
    nobody = "tcp://127.0.0.1:9"  # the discard port, where nobody listens
    task = TaskBus(context, "vision", SESSION, dict.fromkeys(BUS, nobody))
    for _ in range(8):
        task.add_telemetry("angle_1", b"")
        task.add_telemetry("angle_1", b"")
        task.flush_telemetry()
        task.picture("frame_1", b"", b"")
    assert (task.dropped_telemetry, task.dropped_pictures) == (2 * 3, 6)  # pictures keep two
    task.close()


NOISE = [
    [b""],
    [b"hello", b"hello"],
    [b"reply"],
    [b"reply", b"{}"],
    [b"reply", b'{"seq":-1,"t_ns":0,"id":0,"sender":"x","ok":true,"phase":"idle"}'],
    [b"reply", b'{"x":' + b"[" * 100_000],
    [b"TaskTiming", b"\xff"],
    [b"Nothing", b"{}"],
    [b"\xff\xfe", b"{}"],
    [b"", b"\xff"],
    [b"a", b"b", b"c"],
]


def stranger_at(context: Context, kind: int, where: str, name: bytes = b"") -> zmq.Socket[bytes]:
    """A socket of another program."""
    stranger = context.socket(kind)
    if name:
        stranger.setsockopt(zmq.IDENTITY, name)
    stranger.connect(where)
    return stranger


@pytest.mark.parametrize("name", [b"stranger", b"vision", identity("vision", SESSION)])
def test_invalid_messages_change_nothing_and_are_counted_as_foreign(
    context: Context, operator: OperatorBus, addresses: Addresses, name: bytes
) -> None:
    stranger = stranger_at(context, zmq.DEALER, addresses["commands"], name)
    for parts in (*NOISE, [b"", b"status"]):
        stranger.send_multipart(parts)
    [(sender, request)] = received(operator, 1, foreign=len(NOISE))
    assert (sender, request) == ("", Request(name, "status"))
    stranger.close()


@pytest.mark.parametrize(
    "parts",
    [[b""], [b"angle_1"], [b"\xff", b"", b""], [b"nothing", b"", b""], [b"angle", b"", b""]],
)
def test_invalid_telemetry_is_ignored_and_counted_as_foreign(
    context: Context, operator: OperatorBus, addresses: Addresses, parts: list[bytes]
) -> None:
    foreign = 0
    for socket, good in (
        ("telemetry", [b"angle_1", b"good"]),
        ("pictures", [b"angle_1", b"good", b"pixels"]),
    ):
        stranger = stranger_at(context, zmq.PUSH, addresses[socket])
        stranger.send_multipart(parts)
        stranger.send_multipart(good)
        foreign += -(-len(parts) // len(good))  # each started copy
        pixels = good[2] if len(good) == 3 else None
        got = received(operator, 1, foreign)
        assert got == [("", Telemetry("angle_1", b"good", pixels))]
        stranger.close()


def test_a_task_is_known_by_its_name_and_the_session_of_the_run() -> None:
    assert identity("vision", 0x1234) == b"vision:0000000000001234"
    assert identity("vision", 2**63 - 1) == b"vision:7fffffffffffffff"


def test_each_stream_of_a_task_ends_on_its_own(operator: OperatorBus, vision: TaskBus) -> None:
    vision.add_telemetry("angle_1", b"last")
    vision.end_streams()
    heard = received(operator, 3)
    assert ("vision", StreamEnd("control")) in heard
    ends = [("", Telemetry("angle_1", b"last", None)), ("vision", StreamEnd("telemetry"))]
    assert [message for message in heard if message in ends] == ends


def test_a_command_to_a_task_of_another_run_does_not_reach_it(
    context: Context, operator: OperatorBus, addresses: Addresses, vision: TaskBus
) -> None:
    other = TaskBus(context, "vision", SESSION + 1, addresses)
    other.hello()
    assert received(operator, 0, foreign=1) == []
    operator.heartbeat("vision")
    assert commands(vision, 1) == [None]
    assert list(other.drain()) == []
    other.close()


def test_a_second_terminal_gets_its_answers_in_order(
    operator: OperatorBus, addresses: Addresses
) -> None:
    terminal = OperatorRequests(addresses["commands"])
    for request in ("stop", "status"):
        terminal.send(request)
    requests = [message for _, message in received(operator, 2) if isinstance(message, Request)]
    assert [request.text for request in requests] == ["stop", "status"]
    for asked in requests:
        operator.answer(asked.client, f"{asked.text} answered")
    answers = [terminal.receive(LOOKS * LOOK_MS) for _ in requests]
    assert answers == ["stop answered", "status answered"]
    terminal.close()


def test_a_request_without_an_operator_gives_none_after_the_timeout() -> None:
    terminal = OperatorRequests("tcp://127.0.0.1:9")
    terminal.send("stop")
    assert terminal.receive(timeout_ms=20) is None
    terminal.close()


def test_an_address_that_is_none_is_named() -> None:
    with pytest.raises(ValueError, match="address = 'nowhere'"):
        OperatorRequests("nowhere")


@pytest.mark.parametrize("taken", BUS)
def test_an_address_in_use_is_named_with_what_to_do_and_the_others_are_freed(taken: str) -> None:
    held, refused = zmq.Context(), zmq.Context()
    first = tcp_addresses()
    bus = OperatorBus(held, ("vision",), SESSION, first)
    second = tcp_addresses() | {taken: first[taken]}
    told = rf"{first[taken]} for the operator's bus: .*network\.base_port"
    with pytest.raises(PortInUse, match=told):
        OperatorBus(refused, ("vision",), SESSION, second)
    refused.term()  # returns when its sockets are closed
    for where in (*second.values(), *first.values()):
        port = int(where.rpartition(":")[2])
        assert port_is_free(HOST, port, udp=False) == (where not in first.values())
    bus.close()
    held.term()


def fill(context: Context, where: str, kind: int, parts: list[bytes]) -> zmq.Socket[bytes]:
    """Send a socket of the operator far more than one drain may read."""
    stranger = stranger_at(context, kind, where)
    for _ in range(5 * DRAIN_LIMIT):
        stranger.send_multipart(parts)
    return stranger


@pytest.mark.parametrize("socket", ["commands", "telemetry", "pictures"])
def test_a_drain_of_the_operator_is_bounded_and_the_next_one_goes_on(
    context: Context, operator: OperatorBus, addresses: Addresses, socket: str
) -> None:
    kind, parts = (zmq.DEALER, [b"", b"status"])
    if socket != "commands":
        kind, parts = (zmq.PUSH, [b"angle_1", b"good", b"pixels"])
    stranger = fill(context, addresses[socket], kind, parts)
    counts = []
    for _ in range(5 * DRAIN_LIMIT * 2):  # pictures may come one by one
        operator.wait(LOOK_MS)
        counts.append(len(list(operator.drain())))
        if sum(counts) == 5 * DRAIN_LIMIT:
            break
    assert sum(counts) == 5 * DRAIN_LIMIT
    assert max(counts) <= DRAIN_LIMIT
    stranger.close()


def test_a_drain_of_a_task_is_bounded_and_says_that_more_waits(
    operator: OperatorBus, vision: TaskBus
) -> None:
    for _ in range(5 * DRAIN_LIMIT):
        operator.heartbeat("vision")
    drains: list[list[Command | None]] = []
    for _ in range(LOOKS):
        select.select([vision], [], [], 0 if vision.has_pending() else LOOK_MS / 1000)
        drains.append(list(vision.drain()))
        if sum(map(len, drains)) == 5 * DRAIN_LIMIT:
            break
    assert {command for drain in drains for command in drain} == {None}
    assert sum(map(len, drains)) == 5 * DRAIN_LIMIT
    assert max(map(len, drains)) <= DRAIN_LIMIT
    assert not vision.has_pending()
