"""Records of a task for the log: lateness of its ticks, receipts of packets and events."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from comms.clock import Clock
from comms.ends import ChannelReceiver
from comms.operator_bus import TaskBus
from comms.records import Event, Receipts, TaskTiming
from comms.task import Task


class TaskRecords:
    """Records collected between two sendings to the operator."""

    def __init__(
        self, task: Task, bus: TaskBus, receivers: Iterable[ChannelReceiver], clock: Clock
    ) -> None:
        self._task = task
        self._bus = bus
        self._receivers = tuple(receivers)
        self._clock = clock
        self._lateness_ns: list[int] = []

    def add_lateness(self, lateness_ns: int) -> None:
        """Take the lateness of a tick."""
        self._lateness_ns.append(lateness_ns)

    def send(self) -> None:
        """Send what was collected."""
        if self._lateness_ns:
            timing = TaskTiming(
                task=self._task.name,
                t_ns=self._clock.now_ns(),
                late_ticks=self._task.late_ticks,
                lateness_ns=self._lateness_ns,
            )
            self._bus.record(timing)
            self._lateness_ns = []
        for receiver in self._receivers:
            if receiver.receipts:
                self._bus.record(Receipts(channel=receiver.name, rows=receiver.receipts))
                receiver.receipts = []

    def event(self, level: str, text: str) -> None:
        """Send an event of this task."""
        t_ns = self._clock.now_ns()
        self._bus.record(Event(t_ns=t_ns, level=level, source=self._task.name, text=text))

    def exit_reason(self, reason: str) -> None:
        """Say on standard error and on the bus why this task exits by itself."""
        sys.stderr.write(f"{self._task.name}: {reason}\n")
        self.event("error", reason)
