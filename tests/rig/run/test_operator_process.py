"""The operator's process: a signal is acted on whatever else arrives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from comms.clock import new_run_clock
from comms.messages import Command, Phase, Reply, Verb
from comms.operator_bus import Hello
from rig.run.runtime import processes
from rig.run.runtime.processes import ProcessRunner
from rig.run.tasks.operator import Operator, Stage

TASKS = ("controller", "streamer")


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
    """Bus on which the tasks answer at once, and a stranger sends without end once running.

    The signal comes with the message of that number.
    """

    commands = telemetry = pictures = "tcp://127.0.0.1:9"
    signal_at = 3

    def __init__(self, context: object, host: str, port: int) -> None:
        self.answers: list[tuple[bytes, Any]] = [(name.encode(), Hello()) for name in TASKS]
        self.strangers = 0
        self.read_before_the_stop = 0
        self.orders: list[Verb] = []
        FloodedBus.newest = self

    def send(self, command: Command) -> None:
        """Answer the order."""
        if command.verb is Verb.STOP and Verb.STOP not in self.orders:
            self.read_before_the_stop = self.strangers
        self.orders.append(command.verb)
        reply = Reply(seq=0, t_ns=0, id=command.id, sender=command.to, ok=True, phase=Phase.RUNNING)
        self.answers.append((command.to.encode(), reply))

    def drain(self) -> Iterator[tuple[bytes, Any]]:
        """Yield the answers, then junk without end as soon as the run is started."""
        while self.answers:
            yield self.answers.pop(0)
        while Verb.START in self.orders and Verb.CLOSE not in self.orders:
            self.strangers += 1
            if self.strangers == self.signal_at:
                Interrupts.count = 1
            assert self.strangers < 1000, "the signal is not looked at while messages arrive"
            yield b"stranger", Hello()
            while self.answers:
                yield self.answers.pop(0)

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None


def test_a_signal_stops_the_robot_before_the_next_message_is_read(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "OperatorBus", FloodedBus)
    monkeypatch.setattr(processes, "Children", Children)
    monkeypatch.setattr(Interrupts, "count", 0)
    operator = Operator(list(TASKS), 10**9)
    runner = ProcessRunner(
        dict.fromkeys(TASKS),
        operator,
        new_run_clock(),
        Recorder(),  # type: ignore[arg-type]
        Interrupts(),  # type: ignore[arg-type]
        lambda _: None,
        tmp_path,
    )
    runner.run("127.0.0.1", 0, 1, {}, 0.0, 0, 0)
    assert operator.stage is Stage.CLOSED
    assert operator.reasons == ["stopped by the operator (Ctrl-C)"]
    assert FloodedBus.newest.read_before_the_stop == FloodedBus.signal_at
