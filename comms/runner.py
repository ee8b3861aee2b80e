"""The wall runner: one task in one process, real sockets, absolute deadlines.

A late tick is counted, never made up; ticks that are due go before messages that arrive at the same time.
"""

from __future__ import annotations

import gc
import heapq
import select
import signal
import sys
from collections.abc import Callable
from typing import Any

import msgspec
import zmq

from comms.channels import CHANNELS, MS, received_by, sent_by
from comms.clock import Clock, MonotonicClock
from comms.codec import encode
from comms.ends import In, Out, Wiring
from comms.errors import CommsError
from comms.link import LinkCount
from comms.messages import Command, Frame, Message, Reply, Verb
from comms.operator_bus import Context, TaskBus
from comms.priority import take_priority
from comms.records import Event, LinkRow, Receipts, TaskTiming
from comms.task import Step, Task

LONGEST_WAIT_NS = 50 * MS  # the edge of a ZeroMQ descriptor can be missed; look again then
RECORD_EVERY_NS = 250 * MS
TAP_EVERY_NS = (
    50 * MS
)  # taps leave together: a message each would wake the operator a thousand times a second
DRAIN_NS = 200 * MS  # after the last send, beyond the link's own delay
OPERATOR_SILENT_NS = (
    2_000 * MS
)  # ten heartbeats; then the operator is gone, and the robot stops where it is
ADMISSION_NS = 30_000 * MS  # the slowest task's imports on a busy machine
ORPHANED, REFUSED = 5, 3  # exit codes


def main(build: Callable[[bytes], Task]) -> int:
    """Body of a task's __main__: {"wiring": ..., "settings": ...} on standard input; returns the exit code."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the operator acts on Ctrl-C
    parts = msgspec.json.decode(sys.stdin.buffer.read(), type=dict[str, msgspec.Raw])
    wiring = msgspec.json.decode(parts["wiring"], type=Wiring)
    task = build(bytes(parts["settings"]))
    take_priority(
        wiring.priority
    )  # before any thread is started: those of ZeroMQ carry the pictures
    try:
        runner = WallRunner(task, wiring, MonotonicClock(wiring.zero_ns))
    except CommsError as error:
        sys.stderr.write(f"{error}\n")
        return REFUSED
    return runner.run()


class WallRunner:
    """Carries out the steps of one task until it exits."""

    def __init__(self, task: Task, wiring: Wiring, clock: Clock) -> None:
        self._task, self._wiring, self._clock = task, wiring, clock
        self._context: Context = zmq.Context()
        self._out = {name: Out(name, wiring, self._context) for name in sent_by(task.name)}
        self._in = {name: In(name, wiring, self._context) for name in received_by(task.name)}
        self._bus = TaskBus(self._context, task.name, wiring.commands, wiring.taps, wiring.pictures)
        self._quiet = [link for name, link in self._in.items() if not CHANNELS[name].wakes]
        ends: list[Any] = [
            *(link for link in self._in.values() if link not in self._quiet),
            self._bus,
        ]
        self._listening = {end.fileno(): end for end in ends}
        self._early: list[Command] = []  # orders that came before the task began
        self._told: dict[str, LinkCount] = {}  # channels that end at the operator
        self._outbox: list[
            tuple[int, int, Out, Frame | bytes]
        ] = []  # due_ns, order, channel, what leaves
        self._order = 0
        self._wake_ns: int | None = None
        self._exit: int | None = None
        self._lateness_ns: list[int] = []
        self._record_ns = self._tap_ns = self._look_ns = 0
        self._operator_ns = 0
        self._picture_ns = 0

    def run(self) -> int:
        """Until the task asks to exit; returns its exit code."""
        gc.collect()
        gc.freeze()
        if not self._admitted():
            return self._abandon()
        now = self._clock.now_ns()
        self._operator_ns = now
        self._carry_out(self._task.start(now))
        for command in self._early:
            self._obey(command)
        while self._exit is None:
            self._pass(self._wait())
        self._close()
        return self._exit

    def _admitted(self) -> bool:
        """Wait for the first heartbeat: it comes when every task's sockets are open, so nothing is sent to nobody."""
        self._bus.hello()
        until = self._clock.now_ns() + ADMISSION_NS
        while self._clock.now_ns() < until:
            words = list(self._bus.drain())
            self._early += [word for word in words if word is not None]
            if None in words:
                return True
            select.select([self._bus], [], [], LONGEST_WAIT_NS * 1e-9)
        return False

    def _abandon(self) -> int:
        for out in self._out.values():
            out.close(self._clock.now_ns())
        for link in self._in.values():
            link.endpoint.close()
        self._bus.close()
        self._context.destroy(0)
        return ORPHANED

    def _wait(self) -> list[Any]:
        """Sleep until something is due or arrives; returns what is to be read."""
        now = self._clock.now_ns()
        due = now + LONGEST_WAIT_NS
        if self._wake_ns is not None:
            due = min(due, self._wake_ns)
        if self._outbox:
            due = min(due, self._outbox[0][0])
        ready = select.select(self._listening, [], [], max(0, due - now) * 1e-9)[0]
        if now >= self._look_ns:
            self._look_ns = now + LONGEST_WAIT_NS
            return list(self._listening.values())
        return [self._listening[descriptor] for descriptor in ready]

    def _pass(self, ready: list[Any]) -> None:
        for link in self._quiet:
            self._read(link)
        now = self._clock.now_ns()
        if self._wake_ns is not None and self._wake_ns <= now:
            self._lateness_ns.append(now - self._wake_ns)
            self._wake_ns = None
            self._carry_out(self._task.on_tick(now))
        self._send_due()
        for source in ready:
            if source is self._bus:
                self._hear_operator()
            else:
                self._read(source)
        self._send_due()
        if now >= self._tap_ns:
            self._tap_ns = now + TAP_EVERY_NS
            self._bus.flush_taps()
        if now >= self._record_ns:
            self._record_ns = now + RECORD_EVERY_NS
            self._record(now)

    def _read(self, link: In) -> None:
        for message in link.read(self._clock):
            self._carry_out(self._task.on_message(link.name, message, self._clock.now_ns()))

    def _hear_operator(self) -> None:
        for command in self._bus.drain():
            self._operator_ns = self._clock.now_ns()
            if command is not None:
                self._obey(command)
        now = self._clock.now_ns()
        if now - self._operator_ns > OPERATOR_SILENT_NS:
            self._leave(ORPHANED)

    def _obey(self, command: Command) -> None:
        if command.verb is Verb.CLOSE:
            self._leave(0)
        else:
            self._carry_out(self._task.on_message("command", command, self._clock.now_ns()))

    def _leave(self, code: int) -> None:
        self._carry_out(self._task.stop(self._clock.now_ns()))
        self._exit = code

    def _carry_out(self, step: Step) -> None:
        if step.wake_ns is not None:
            self._wake_ns = step.wake_ns
        if step.exit is not None:
            self._exit = step.exit
        for channel, message, at_ns in step.sends:
            if isinstance(message, Reply):
                self._bus.reply(message)
            elif channel in self._out:
                self._queue(self._out[channel], message, at_ns)
            else:  # truth: straight to the operator
                self._told.setdefault(channel, LinkCount()).sent += 1
                self._bus.tap(channel, encode(channel, message, self._wiring.session))

    def _queue(self, out: Out, message: Message, at_ns: int) -> None:
        data = encode(out.name, message, self._wiring.session)
        self._bus.tap(out.name, data)
        frame = message if isinstance(message, Frame) else None
        if frame is not None:
            self._show(out.name, frame, data)
        delay_ns = out.fate(message.seq)
        if delay_ns is not None:
            self._order += 1
            heapq.heappush(self._outbox, (at_ns + delay_ns, self._order, out, frame or data))

    def _show(self, channel: str, frame: Frame, data: bytes) -> None:
        """A picture now and then, for people."""
        if self._wiring.pictures_hz > 0 and frame.t_ns >= self._picture_ns:
            self._picture_ns = frame.t_ns + round(1e9 / self._wiring.pictures_hz)
            self._bus.picture(channel, data, frame.pixels.tobytes())

    def _send_due(self) -> None:
        while self._outbox and self._outbox[0][0] <= self._clock.now_ns():
            _, _, out, payload = heapq.heappop(self._outbox)
            out.send(payload)

    def _record(self, now: int) -> None:
        if self._lateness_ns:
            timing = TaskTiming(
                task=self._task.name,
                t_ns=now,
                late_ticks=self._task.late_ticks,
                lateness_ns=self._lateness_ns,
            )
            self._bus.record(timing)
            self._lateness_ns = []
        for link in self._in.values():
            if link.receipts:
                self._bus.record(Receipts(channel=link.name, rows=link.receipts))
                link.receipts = []

    def _close(self) -> None:
        """Send what is under way, say how much was sent, read what still arrives, report, leave."""
        while self._outbox:
            select.select([], [], [], max(0, self._outbox[0][0] - self._clock.now_ns()) * 1e-9)
            self._send_due()
        for out in self._out.values():
            out.close(self._clock.now_ns())
        until = (
            self._clock.now_ns()
            + DRAIN_NS
            + max((link.delay_ns for link in self._in.values()), default=0)
        )
        while self._clock.now_ns() < until and not all(link.closed for link in self._in.values()):
            select.select(list(self._in.values()), [], [], 0.01)
            for link in self._in.values():
                for _ in link.read(self._clock):
                    pass
        self._report()

    def _report(self) -> None:
        now = self._clock.now_ns()
        self._bus.flush_taps()
        self._record(now)
        counts = {name: out.count for name, out in self._out.items()} | {
            name: link.count for name, link in self._in.items()
        }
        for name, count in (counts | self._told).items():
            self._bus.record(LinkRow(channel=name, count=count))
        if self._bus.dropped_taps or self._bus.dropped_pictures:
            text = f"{self._bus.dropped_taps} messages and {self._bus.dropped_pictures} pictures were not logged"
            self._bus.record(Event(t_ns=now, level="warning", source=self._task.name, text=text))
        self._bus.farewell()
        for link in self._in.values():
            link.endpoint.close()
        self._bus.close()
        self._context.term()
