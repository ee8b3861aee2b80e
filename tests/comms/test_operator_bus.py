"""Operator bus: commands, replies, telemetry and pictures; invalid data is ignored."""

from __future__ import annotations

import select
from collections.abc import Iterator

import pytest
import zmq

from comms.errors import PortInUse
from comms.link import LinkCount
from comms.messages import Command, Phase, Reply, Verb
from comms.operator_bus import (
    DRAIN_LIMIT,
    Context,
    Hello,
    OperatorBus,
    Record,
    TaskBus,
    Telemetry,
)
from comms.operator_request import OperatorRequests
from comms.records import Event, LinkRow, Receipts, TaskTiming
from comms.udp import free_port, port_is_free

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


@pytest.fixture
def operator(context: Context) -> Iterator[OperatorBus]:
    """The operator's end on free ports."""
    bus = OperatorBus(context, HOST)
    yield bus
    bus.close()


@pytest.fixture
def vision(context: Context, operator: OperatorBus) -> Iterator[TaskBus]:
    """The end of a task named vision, known to the operator."""
    bus = TaskBus(context, "vision", operator.commands, operator.telemetry, operator.pictures)
    bus.hello()
    assert received(operator, 1) == [(b"vision", Hello())]
    yield bus
    bus.close()


def received(operator: OperatorBus, count: int) -> list[tuple[bytes, object]]:
    """The next `count` messages that the operator receives."""
    got: list[tuple[bytes, object]] = []
    for _ in range(LOOKS):
        got += operator.drain()
        if len(got) >= count:
            break
        operator.wait(LOOK_MS)
    assert len(got) == count
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
        (b"vision", REPLY),
        *((b"vision", Record(record)) for record in RECORDS),
    ]


def test_telemetry_arrives_in_order_once_flushed_and_pictures_at_once(
    operator: OperatorBus, vision: TaskBus
) -> None:
    vision.add_telemetry("angle_1", b"\0datagram")
    vision.add_telemetry("frame_1", b"")
    vision.flush_telemetry()
    vision.flush_telemetry()  # the batch is empty
    assert received(operator, 2) == [
        (b"", Telemetry("angle_1", b"\0datagram", None)),
        (b"", Telemetry("frame_1", b"", None)),
    ]
    vision.picture("frame_1", b"head", b"pixels")
    assert received(operator, 1) == [(b"", Telemetry("frame_1", b"head", b"pixels"))]
    assert (vision.dropped_telemetry, vision.dropped_pictures) == (0, 0)


def test_telemetry_and_pictures_beyond_the_queue_are_dropped_and_counted(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("comms.operator_bus.TELEMETRY_HIGH_WATER", 5)
    monkeypatch.setattr("comms.operator_bus.LINGER_MS", 0)
    nobody = "tcp://127.0.0.1:9"  # the discard port, where nobody listens
    task = TaskBus(context, "vision", nobody, nobody, nobody)
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


def test_invalid_messages_are_ignored(context: Context, operator: OperatorBus) -> None:
    stranger = context.socket(zmq.DEALER)
    stranger.setsockopt(zmq.IDENTITY, b"stranger")
    stranger.connect(operator.commands)
    for parts in (*NOISE, [b"hello"]):
        stranger.send_multipart(parts)
    assert received(operator, 1) == [(b"stranger", Hello())]
    stranger.close()


@pytest.mark.parametrize(
    "parts",
    [[b""], [b"angle_1"], [b"\xff", b"", b""], [b"nothing", b"", b""], [b"angle", b"", b""]],
)
def test_invalid_telemetry_is_ignored(
    context: Context, operator: OperatorBus, parts: list[bytes]
) -> None:
    for address, good in (
        (operator.telemetry, [b"angle_1", b"good"]),
        (operator.pictures, [b"angle_1", b"good", b"pixels"]),
    ):
        stranger = context.socket(zmq.PUSH)
        stranger.connect(address)
        stranger.send_multipart(parts)
        stranger.send_multipart(good)
        pixels = good[2] if len(good) == 3 else None
        assert received(operator, 1) == [(b"", Telemetry("angle_1", b"good", pixels))]
        stranger.close()


def test_a_second_terminal_gets_its_answers_in_order(operator: OperatorBus) -> None:
    terminal = OperatorRequests(operator.commands)
    for request in ("stop", "status"):
        terminal.send(request)
    requests = received(operator, 2)
    assert [request for _, request in requests] == ["stop", "status"]
    for client, request in requests:
        operator.answer(client, f"{request} answered")
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


def test_a_fixed_port_takes_the_two_above_it_too(context: Context) -> None:
    ports = iter(lambda: free_port(HOST, udp=False), None)
    port = next(
        port for port in ports if all(port_is_free(HOST, port + k, udp=False) for k in (1, 2))
    )
    bus = OperatorBus(context, HOST, port)
    assert [bus.commands, bus.telemetry, bus.pictures] == [
        f"tcp://{HOST}:{port + k}" for k in range(3)
    ]
    bus.close()


def test_a_port_in_use_is_named_with_what_to_do(context: Context, operator: OperatorBus) -> None:
    port = int(operator.telemetry.rpartition(":")[2])
    with pytest.raises(PortInUse, match=rf"TCP port {port} on {HOST} .*network\.base_port"):
        OperatorBus(context, HOST, port)


def fill(context: Context, address: str, kind: int, parts: list[bytes]) -> zmq.Socket[bytes]:
    """Send a socket of the operator far more than one drain may read."""
    stranger = context.socket(kind)
    stranger.connect(address)
    for _ in range(5 * DRAIN_LIMIT):
        stranger.send_multipart(parts)
    return stranger


@pytest.mark.parametrize("socket", ["commands", "telemetry", "pictures"])
def test_a_drain_of_the_operator_is_bounded_and_the_next_one_goes_on(
    context: Context, operator: OperatorBus, socket: str
) -> None:
    kind, parts = (zmq.DEALER, [b"hello"])
    if socket != "commands":
        kind, parts = (zmq.PUSH, [b"angle_1", b"good", b"pixels"])
    stranger = fill(context, getattr(operator, socket), kind, parts)
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
