"""The operator's wires: orders down, answers, taps and pictures up, and nothing that arrives breaks them."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
import zmq

from comms.errors import PortInUse
from comms.link import LinkCount
from comms.messages import Command, Phase, Reply, Verb
from comms.operator_bus import Context, Hello, OperatorBus, Record, TaskBus, Telemetry
from comms.operator_request import ask
from comms.records import Event, LinkRow, Receipts, TaskTiming
from comms.udp import free_port, port_is_free

HOST = "127.0.0.1"
LOOKS, LOOK_MS = 100, 50  # five seconds, far beyond what the loopback needs
REPLY = Reply(
    seq=1, t_ns=2, id=3, sender="vision", ok=True, phase=Phase.ARMED, text="armed, 20 °C", exit=None
)
RECORDS = (
    Receipts(channel="frame", rows=[(1, 2, "duplicate")]),
    TaskTiming(task="vision", t_ns=1, late_ticks=2, lateness_ns=[3]),
    LinkRow(channel="frame", count=LinkCount(sent=2, delivered=1, rejected={"crc": 1})),
    Event(t_ns=4, level="error", source="vision", text="lost"),
)


@pytest.fixture
def context() -> Iterator[Context]:
    """A ZeroMQ context that is gone after the test, whatever is still under way."""
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
    """The end of a task named vision, which the operator has heard of."""
    bus = TaskBus(context, "vision", operator.commands, operator.taps, operator.pictures)
    bus.hello()
    assert heard(operator, 1) == [(b"vision", Hello())]
    yield bus
    bus.close()


def heard(operator: OperatorBus, count: int) -> list[tuple[bytes, object]]:
    """The next `count` things the operator hears."""
    got: list[tuple[bytes, object]] = []
    for _ in range(LOOKS):
        got += operator.drain()
        if len(got) >= count:
            break
        operator.wait(LOOK_MS)
    assert len(got) == count
    return got


def ordered(task: TaskBus, count: int) -> list[Command | None]:
    """The next `count` orders and heartbeats a task hears."""
    poller, got = zmq.Poller(), list[Command | None]()
    poller.register(task.fileno(), zmq.POLLIN)
    for _ in range(LOOKS):
        got += task.drain()
        if len(got) >= count:
            break
        poller.poll(LOOK_MS)
    assert len(got) == count
    return got


def test_orders_and_heartbeats_reach_the_task_they_are_for(
    operator: OperatorBus, vision: TaskBus
) -> None:
    start = Command(seq=1, t_ns=5, id=1, to="vision", verb=Verb.START, t_start_ns=600)
    operator.send(
        Command(seq=0, t_ns=5, id=1, to="bench", verb=Verb.START)
    )  # nobody of that name: goes nowhere
    operator.heartbeat("vision")
    operator.send(start)
    assert ordered(vision, 2) == [None, start]


def test_a_reply_and_every_kind_of_record_arrive_as_they_were_said(
    operator: OperatorBus, vision: TaskBus
) -> None:
    vision.reply(REPLY)
    for record in RECORDS:
        vision.record(record)
    assert heard(operator, 5) == [
        (b"vision", REPLY),
        *((b"vision", Record(record)) for record in RECORDS),
    ]


def test_taps_arrive_in_order_once_flushed_and_pictures_at_once(
    operator: OperatorBus, vision: TaskBus
) -> None:
    vision.tap("angle", b"\0datagram")
    vision.tap("frame", b"")
    vision.flush_taps()
    vision.flush_taps()  # nothing is left to send
    assert heard(operator, 2) == [
        (b"", Telemetry("angle", b"\0datagram", None)),
        (b"", Telemetry("frame", b"", None)),
    ]
    vision.picture("frame", b"head", b"pixels")
    assert heard(operator, 1) == [(b"", Telemetry("frame", b"head", b"pixels"))]
    assert (vision.dropped_taps, vision.dropped_pictures) == (0, 0)


def test_what_the_operator_cannot_follow_is_dropped_and_counted(
    context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("comms.operator_bus.TAP_HIGH_WATER", 5)
    monkeypatch.setattr("comms.operator_bus.LINGER_MS", 0)
    nobody = "tcp://127.0.0.1:9"  # the discard port, where nobody listens
    task = TaskBus(context, "vision", nobody, nobody, nobody)
    for _ in range(8):
        task.tap("angle", b"")
        task.tap("angle", b"")
        task.flush_taps()
        task.picture("frame", b"", b"")
    assert (task.dropped_taps, task.dropped_pictures) == (2 * 3, 6)  # pictures keep two
    task.close()


NOISE = [
    [b""],
    [b"hello", b"hello"],
    [b"reply"],
    [b"reply", b"{}"],
    [b"reply", b'{"seq":-1,"t_ns":0,"id":0,"sender":"x","ok":true,"phase":"idle"}'],
    [b"reply", b'{"x":' + b"[" * 100_000],
    [b"Timing", b"\xff"],
    [b"Nothing", b"{}"],
    [b"\xff\xfe", b"{}"],
    [b"", b"\xff"],
    [b"a", b"b", b"c"],
]


def test_what_is_not_said_in_our_words_is_passed_over(
    context: Context, operator: OperatorBus
) -> None:
    stranger = context.socket(zmq.DEALER)
    stranger.setsockopt(zmq.IDENTITY, b"stranger")
    stranger.connect(operator.commands)
    for parts in (*NOISE, [b"hello"]):
        stranger.send_multipart(parts)
    assert heard(operator, 1) == [(b"stranger", Hello())]
    stranger.close()


@pytest.mark.parametrize("parts", [[b""], [b"angle"], [b"\xff", b"", b""], [b"nothing", b"", b""]])
def test_a_tap_that_is_not_one_is_passed_over(
    context: Context, operator: OperatorBus, parts: list[bytes]
) -> None:
    for address, good in (
        (operator.taps, [b"angle", b"good"]),
        (operator.pictures, [b"angle", b"good", b"pixels"]),
    ):
        stranger = context.socket(zmq.PUSH)
        stranger.connect(address)
        stranger.send_multipart(parts)
        stranger.send_multipart(good)
        pixels = good[2] if len(good) == 3 else None
        assert heard(operator, 1) == [(b"", Telemetry("angle", b"good", pixels))]
        stranger.close()


def test_a_second_terminal_gets_its_answer(operator: OperatorBus) -> None:
    answers: list[str | None] = []
    terminal = threading.Thread(
        target=lambda: answers.append(ask(operator.commands, "stop", LOOKS * LOOK_MS))
    )
    terminal.start()
    ((client, request),) = heard(operator, 1)
    assert request == "stop"
    operator.answer(client, "stopping")
    terminal.join(LOOKS * LOOK_MS / 1000)
    assert answers == ["stopping"]


def test_a_question_to_nobody_is_given_up_in_time() -> None:
    assert ask("tcp://127.0.0.1:9", "stop", timeout_ms=20) is None


def test_a_fixed_port_takes_the_two_above_it_too(context: Context) -> None:
    ports = iter(lambda: free_port(HOST, udp=False), None)
    port = next(
        port for port in ports if all(port_is_free(HOST, port + k, udp=False) for k in (1, 2))
    )
    bus = OperatorBus(context, HOST, port)
    assert [bus.commands, bus.taps, bus.pictures] == [f"tcp://{HOST}:{port + k}" for k in range(3)]
    bus.close()


def test_a_port_in_use_is_named_with_what_to_do(context: Context, operator: OperatorBus) -> None:
    port = int(operator.taps.rpartition(":")[2])
    with pytest.raises(PortInUse, match=rf"TCP port {port} on {HOST} .*network\.base_port"):
        OperatorBus(context, HOST, port)
