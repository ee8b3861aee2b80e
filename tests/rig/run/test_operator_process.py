"""The operator's process: a signal is acted on whatever else arrives."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from comms.bus_content import Hello, Request, Telemetry
from comms.clock import new_run_clock
from comms.codec import encode_closing
from comms.endpoints import PORTS, endpoints
from comms.messages import Command, Phase, Reply, Verb
from comms.records import Event
from rig.run import operator_file
from rig.run.operator_file import OperatorFile
from rig.run.runtime import processes
from rig.run.runtime.processes import ProcessRunner
from rig.run.tasks.operator import Operator, Stage

TASKS = ("controller", "streamer")
HOST = "127.0.0.1"


class Interrupts:
    """Signals counted so far."""

    count, newest = 0, "Ctrl-C"


class Recorder:
    """Log that keeps nothing."""

    counts: dict[str, int] = {}

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None


class Children:
    """Processes that never exit by themselves."""

    names = set(TASKS)

    def __init__(self, folder: object) -> None:
        self.alive = True

    def start(self, settings: object, wiring: object) -> None:
        """Start nothing."""

    def newly_exited(self) -> list[tuple[str, int]]:
        """No task exits."""
        return []

    def any_alive(self) -> bool:
        """No task has to be awaited."""
        return False

    def kill_running(self, only: object = None) -> list[str]:
        """Nothing to kill."""
        return []

    def cpu_s(self) -> dict[str, float]:
        """No processor time."""
        return {}

    def scheduling(self) -> dict[str, str]:
        """No process."""
        return {}


class FloodedBus:
    """Bus on which the tasks answer at once, and other terminals ask without end once running.

    The signal comes with the message of that number.
    """

    foreign = 0
    signal_at = 3
    newest: FloodedBus

    def __init__(
        self, context: object, tasks: Collection[str], session: int, addresses: Mapping[str, str]
    ) -> None:
        self.answers: list[tuple[str, Any]] = [(name, Hello()) for name in tasks]
        self.answered: list[tuple[bytes, str]] = []
        self.strangers = 0
        self.read_before_the_stop = 0
        self.orders: list[Verb] = []
        self.addresses = addresses
        FloodedBus.newest = self

    def send(self, command: Command) -> None:
        """Answer the order."""
        if command.verb is Verb.STOP and Verb.STOP not in self.orders:
            self.read_before_the_stop = self.strangers
        self.orders.append(command.verb)
        reply = Reply(seq=0, t_ns=0, id=command.id, sender=command.to, ok=True, phase=Phase.RUNNING)
        self.answers.append((command.to, reply))

    def answer(self, client: bytes, text: str) -> None:
        """Keep the answer to another terminal."""
        self.answered.append((client, text))

    def drain(self) -> Iterator[tuple[str, Any]]:
        """Yield the answers, then requests without end as soon as the run is started."""
        while self.answers:
            yield self.answers.pop(0)
        while Verb.START in self.orders and Verb.CLOSE not in self.orders:
            self.strangers += 1
            if self.strangers == self.signal_at:
                Interrupts.count = 1
            assert self.strangers < 1000, "the signal is not looked at while messages arrive"
            yield "", Request(b"stranger", "status")
            while self.answers:
                yield self.answers.pop(0)

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None


class Kept(Recorder):
    """Log that keeps the events."""

    def __init__(self) -> None:
        self.events: list[Event] = []

    def record(self, record: Any, t_ns: int) -> None:
        """Keep an event."""
        if isinstance(record, Event):
            self.events.append(record)


def run(
    folder: Path, monkeypatch: pytest.MonkeyPatch, bus: type[FloodedBus], recorder: Recorder
) -> Operator:
    """Run the operator's process on a bus without sockets, with tasks that are none."""
    monkeypatch.setattr(processes, "OperatorBus", bus)
    monkeypatch.setattr(processes, "Children", Children)
    monkeypatch.setattr(processes, "SHUTDOWN_TIMEOUT_NS", 0)  # these tasks say no farewell
    monkeypatch.setattr(Interrupts, "count", 0)
    operator = Operator(list(TASKS), 10**9)
    runner = ProcessRunner(
        dict.fromkeys(TASKS),
        operator,
        new_run_clock(),
        recorder,  # type: ignore[arg-type]
        Interrupts(),  # type: ignore[arg-type]
        lambda _: None,
        folder,
    )
    ends = endpoints(HOST, list(range(40_000, 40_000 + PORTS)), None)  # none of them is opened
    runner.run(HOST, ends, 1, {}, 0.0, 0, 0)
    return operator


def test_a_signal_stops_the_robot_before_the_next_message_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    operator = run(tmp_path, monkeypatch, FloodedBus, Recorder())
    assert operator.stage is Stage.CLOSED
    assert operator.reasons == ["stopped by the operator (Ctrl-C)"]
    assert FloodedBus.newest.read_before_the_stop == FloodedBus.signal_at


def test_every_request_of_another_terminal_is_answered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(tmp_path, monkeypatch, FloodedBus, Recorder())
    answered = FloodedBus.newest.answered
    assert {client for client, _ in answered} == {b"stranger"}
    assert len(answered) == FloodedBus.newest.strangers >= FloodedBus.signal_at


def test_what_no_task_of_the_run_sent_is_counted_in_one_event(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Noisy(FloodedBus):
        """Bus that ignored some messages; telemetry of another session gets as far as the log."""

        foreign = 4

        def drain(self) -> Iterator[tuple[str, Any]]:
            """Yield telemetry of another run with each hello."""
            if not self.orders:
                yield "", Telemetry("angle_1", b"junk", None)
                yield "", Telemetry("reference", encode_closing("reference", 1, 0, 77), None)
            yield from super().drain()

    recorder = Kept()
    run(tmp_path, monkeypatch, Noisy, recorder)
    told = [event for event in recorder.events if "foreign" in event.text]
    assert [(event.level, event.source) for event in told] == [("info", "operator")]
    count = int(told[0].text.split()[0])
    assert count >= 4 + 2
    assert told[0].text == f"{count} foreign messages on the operator's bus were ignored"


def test_a_run_without_foreign_messages_says_nothing_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = Kept()
    run(tmp_path, monkeypatch, FloodedBus, recorder)
    assert [event for event in recorder.events if "foreign" in event.text] == []


def test_the_bus_and_the_file_of_the_operator_have_the_addresses_of_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[OperatorFile] = []

    class Reading(Children):
        """Children at whose start the file is there."""

        def start(self, settings: object, wiring: Any) -> None:
            """Read the file."""
            written.append(operator_file.read(tmp_path / operator_file.NAME))
            assert dict(written[0].stop_ports) == wiring.stop_ports
            assert written[0].stop_key == wiring.stop_key

    monkeypatch.setitem(globals(), "Children", Reading)
    run(tmp_path, monkeypatch, FloodedBus, Recorder())
    assert FloodedBus.newest.addresses["commands"] == f"tcp://{HOST}:40000"
    assert [file.address for file in written] == [f"tcp://{HOST}:40000"]
    assert written[0].stop_ports == {"controller": 40_026, "streamer": 40_027}
    assert not (tmp_path / operator_file.NAME).exists()  # the run has ended
