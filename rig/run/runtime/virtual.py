"""Run in virtual time: all tasks in one process, one event queue, a link model instead of sockets.

Events of one instant are ordered: ticks by task, then messages by channel and sequence number.
The order never depends on arrival, so equal seeds give equal digests.
"""

from __future__ import annotations

import hashlib
import heapq
import struct
import zlib
from collections.abc import Callable, Mapping, Sequence

from comms.channels import CHANNELS, MS, Transport, data_channels, ends
from comms.codec import encode
from comms.ends import admit
from comms.link import LinkCount, LinkFaults, LinkModel, SequenceWindow, merge_counts
from comms.messages import Command, Frame, Message, Reply, Verb
from comms.records import Receipts, TaskTiming
from comms.task import Step, Task
from rig.errors import STOPPED
from rig.run.recorder import Recorder
from rig.run.runtime.interrupts import Interrupts
from rig.run.tasks.operator import Operator

RECEIPTS_PER_RECORD = 512
PROGRESS_PERIOD_NS = 250 * MS
_STAMP = struct.Struct("<qB")


class _Link:
    """Both ends of a channel and the fault model between them."""

    def __init__(self, name: str, receiver: str, faults: LinkFaults | None, seed: int) -> None:
        row = CHANNELS[name]
        self.id = row.id
        self.receiver = receiver
        self.is_in_order = row.transport is Transport.CAN  # no frame overtakes another
        self.last_due_ns = 0
        self.late_ns = round(row.late_after_ms * MS)
        self.model = LinkModel(faults, seed, row.id) if faults else None
        self.window = SequenceWindow()
        self.sender_count = LinkCount()
        self.receiver_count = LinkCount()
        self.receipts: list[tuple[int, int, str]] = []


# t_ns, rank, order within the rank, name of task or channel, message (None = tick of a task)
QueuedEvent = tuple[int, int, int, str, Message | None]


class VirtualRunner:
    """Runner of tasks and operator in one process, to the end of the run."""

    def __init__(
        self,
        tasks: Sequence[Task],
        operator: Operator,
        faults: Mapping[str, LinkFaults],
        seed: int,
        recorder: Recorder,
        pictures_hz: float,
        interrupts: Interrupts,
        progress: Callable[[int], None],
    ) -> None:
        self._tasks: dict[str, Task] = {task.name: task for task in (operator, *tasks)}
        self._rank = {name: -100 + i for i, name in enumerate(self._tasks)}  # ticks before messages
        self._operator = operator
        self._recorder = recorder
        self._progress = progress
        self._interrupts = interrupts
        self._next_progress_ns = 0
        self._links: dict[str, _Link] = {}
        for name in data_channels(self._tasks):
            _, receiver = ends(name, self._tasks)
            self._links[name] = _Link(name, receiver, faults.get(name), seed)
        self._queue: list[QueuedEvent] = []
        self._wake_ns: dict[str, int] = {}
        self._closed: set[str] = set()
        self._calls = 0  # number of commands and replies so far
        self._hash = hashlib.sha256()
        self._picture_period_ns = round(1e9 / pictures_hz) if pictures_hz > 0 else 0
        self._next_picture_ns: dict[str, int] = {}  # by channel of frames
        self._truths_sent = 0
        self.t_ns = 0

    def run(self) -> dict[str, LinkCount]:
        """Run until the operator closes the run; return the settled ledger."""
        for name, task in self._tasks.items():
            self._carry_out(name, task.start(0))
        while self._queue:
            t_ns, _, _, name, message = heapq.heappop(self._queue)
            self.t_ns = t_ns
            if t_ns >= self._next_progress_ns:
                self._report_progress(t_ns)
            if message is None:
                if self._wake_ns.get(name) == t_ns:
                    del self._wake_ns[name]
                    self._carry_out(name, self._tasks[name].on_tick(t_ns))
            elif name in self._links:
                self._deliver(name, message)
            else:
                channel = "command" if isinstance(message, Command) else "reply"
                self._carry_out(name, self._tasks[name].on_message(channel, message, t_ns))
        return self._settle()

    def _report_progress(self, t_ns: int) -> None:
        """Report the progress, and stop the run after a signal."""
        self._next_progress_ns = t_ns + PROGRESS_PERIOD_NS
        self._progress(t_ns)
        if self._interrupts.count:
            reason = f"stopped by the operator ({self._interrupts.newest})"
            self._carry_out("operator", self._operator.end(reason, STOPPED, t_ns))

    @property
    def digest(self) -> str:
        """SHA-256 over everything that was sent; equal for equal seeds."""
        return self._hash.hexdigest()

    def _carry_out(self, name: str, step: Step) -> None:
        if step.wake_ns is not None and step.wake_ns != self._wake_ns.get(name):
            self._wake_ns[name] = step.wake_ns
            heapq.heappush(self._queue, (step.wake_ns, self._rank[name], 0, name, None))
        for channel, message, at_ns in step.sends:
            link = self._links.get(channel)
            if link is not None:
                self._send(channel, link, message, at_ns)
            elif isinstance(message, Command):
                self._deliver_order(message)
            elif isinstance(message, Reply):
                self._queue_call("reply", "operator", message, at_ns)
            else:
                self._truths_sent += 1
                self._log(channel, CHANNELS[channel].id, message)

    def _deliver_order(self, command: Command) -> None:
        """Close a task at once; queue any other order."""
        if command.verb is Verb.CLOSE:
            self._carry_out(command.to, self._tasks[command.to].stop(command.t_ns))
            self._wake_ns.pop(command.to, None)
            self._closed.add(command.to)
            self._recorder.message("command", command, command.t_ns)
        else:
            self._queue_call("command", command.to, command, command.t_ns)

    def _queue_call(self, channel: str, to: str, message: Message, at_ns: int) -> None:
        self._calls += 1
        heapq.heappush(self._queue, (at_ns, CHANNELS[channel].id, self._calls, to, message))
        self._recorder.message(channel, message, at_ns)

    def _send(self, channel: str, link: _Link, message: Message, at_ns: int) -> None:
        link.sender_count.sent += 1
        self._log(channel, link.id, message)
        delay_ns: int | None = 0
        if link.model is not None:
            delay_ns = link.model.delay_ns(message.seq)
            link.sender_count.confine(link.model.confinement)
        if delay_ns is None:
            link.sender_count.lost_link += 1
        else:
            due_ns = at_ns + delay_ns
            if link.is_in_order:
                due_ns = link.last_due_ns = max(due_ns, link.last_due_ns)
            heapq.heappush(self._queue, (due_ns, link.id, message.seq, channel, message))

    def _deliver(self, channel: str, message: Message) -> None:
        link = self._links[channel]
        accepted = admit(
            message, link.window, link.receiver_count, link.late_ns, self.t_ns, link.receipts
        )
        if len(link.receipts) >= RECEIPTS_PER_RECORD:
            self._flush(channel, link)
        if accepted is not None and link.receiver not in self._closed:
            receiver = self._tasks[link.receiver]
            self._carry_out(link.receiver, receiver.on_message(channel, message, self.t_ns))

    def _log(self, channel: str, channel_id: int, message: Message) -> None:
        crc32 = 0
        if isinstance(message, Frame):
            crc32 = zlib.crc32(message.pixels.data)
            if self._picture_period_ns and message.t_ns >= self._next_picture_ns.get(channel, 0):
                self._next_picture_ns[channel] = message.t_ns + self._picture_period_ns
                self._recorder.picture(channel, message, self.t_ns)
        self._hash.update(_STAMP.pack(self.t_ns, channel_id) + encode(channel, message, crc32))
        self._recorder.message(channel, message, self.t_ns, crc32)

    def _flush(self, channel: str, link: _Link) -> None:
        self._recorder.record(Receipts(channel=channel, rows=link.receipts), self.t_ns)
        link.receipts = []

    def _settle(self) -> dict[str, LinkCount]:
        for name, link in self._links.items():
            if link.receipts:
                self._flush(name, link)
        for task in self._tasks.values():
            timing = TaskTiming(
                task=task.name, t_ns=self.t_ns, late_ticks=task.late_ticks, lateness_ns=[]
            )
            self._recorder.record(timing, self.t_ns)
        for event in self._operator.events:
            self._recorder.record(event, event.t_ns)
        rows = {}
        for name, link in self._links.items():
            rows[name] = merge_counts(link.sender_count, link.receiver_count)
        truths_recorded = self._recorder.counts.get("truth", 0)
        rows["truth"] = LinkCount(sent=self._truths_sent, delivered=truths_recorded)
        return rows
