"""Wall-clock runner: one task in one process, real sockets, absolute deadlines.

A late tick is counted and not repeated. A tick that is due is served before anything is read, and
every read is bounded: what a stranger sends delays no tick.
"""

from __future__ import annotations

import gc
import select
import signal
import sys
from collections.abc import Callable

import msgspec
import zmq

from comms.channels import MS, received_by, sent_by
from comms.clock import Clock, MonotonicClock
from comms.codec import encode
from comms.ends import ChannelReceiver, ChannelSender, Wiring
from comms.errors import CommsError
from comms.intake import MAX_WAIT_NS, Intake, Source
from comms.link import LinkCount
from comms.messages import Command, Frame, Message, Reply, Verb
from comms.operator_bus import Context, TaskBus
from comms.outbox import Outbox
from comms.priority import take_priority
from comms.records import Event, LinkRow, Receipts, TaskTiming
from comms.task import Step, Task

RECORD_PERIOD_NS = 250 * MS
# telemetry is sent in batches: one by one it would wake the operator a thousand times a second
TELEMETRY_PERIOD_NS = 50 * MS
DRAIN_NS = 200 * MS  # after the last send, in addition to the delay of the link
OPERATOR_TIMEOUT_NS = 2_000 * MS  # ten heartbeats; then the task stops, and with it the robot
START_TIMEOUT_NS = 30_000 * MS  # the imports of the slowest task on a busy machine
DRAIN_POLL_S = 0.01
ORPHANED, REFUSED = 5, 3  # exit codes


def main(build: Callable[[bytes], Task]) -> int:
    """Run the task of a process; return its exit code.

    Standard input: {"wiring": ..., "settings": ...} in JSON; build makes the task from settings.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the operator handles Ctrl-C
    parts = msgspec.json.decode(sys.stdin.buffer.read(), type=dict[str, msgspec.Raw])
    wiring = msgspec.json.decode(parts["wiring"], type=Wiring)
    task = build(bytes(parts["settings"]))
    # before any thread starts: those of ZeroMQ carry the frames and inherit the priority
    take_priority(wiring.priority)
    try:
        runner = WallRunner(task, wiring, MonotonicClock(wiring.zero_ns))
    except CommsError as error:
        sys.stderr.write(f"{error}\n")
        return REFUSED
    return runner.run()


class WallRunner:
    """Runner of one task: executes its steps until it exits."""

    def __init__(self, task: Task, wiring: Wiring, clock: Clock) -> None:
        self._task = task
        self._wiring = wiring
        self._clock = clock
        self._context: Context = zmq.Context()
        self._senders = {
            name: ChannelSender(name, wiring, self._context) for name in sent_by(task.name)
        }
        self._receivers = {
            name: ChannelReceiver(name, wiring, self._context) for name in received_by(task.name)
        }
        self._bus = TaskBus(
            self._context, task.name, wiring.commands, wiring.telemetry, wiring.pictures
        )
        self._intake = Intake(self._receivers, clock)
        self._intake.add(self._bus)
        self._early_commands: list[Command] = []  # received before the start of the task
        self._operator_counts: dict[str, LinkCount] = {}  # of channels to the operator
        self._outbox = Outbox()
        self._wake_ns: int | None = None
        self._exit: int | None = None
        self._lateness_ns: list[int] = []
        self._record_ns = self._telemetry_ns = self._read_all_ns = 0
        self._operator_ns = self._picture_ns = 0  # last message of the operator, last picture

    def run(self) -> int:
        """Run the task until it exits; return its exit code."""
        gc.collect()
        gc.freeze()
        if not self._wait_for_heartbeat():
            return self._give_up()
        now = self._clock.now_ns()
        self._operator_ns = now
        self._execute(self._task.start(now))
        for command in self._early_commands:
            self._handle_command(command)
        while self._exit is None:
            self._serve(self._wait())
        self._close()
        return self._exit

    def _wait_for_heartbeat(self) -> bool:
        """Wait for the first heartbeat; return False after START_TIMEOUT_NS.

        The operator sends it when the sockets of all tasks are open, so no packet is sent before.
        """
        self._bus.hello()
        until = self._clock.now_ns() + START_TIMEOUT_NS
        while self._clock.now_ns() < until:
            received = list(self._bus.drain())
            self._early_commands += [command for command in received if command is not None]
            if None in received:
                return True
            if not self._bus.has_pending():
                select.select([self._bus], [], [], MAX_WAIT_NS * 1e-9)
        return False

    def _give_up(self) -> int:
        """Close the sockets of a task that was never started; return its exit code."""
        self._report_exit(f"no heartbeat of the operator within {START_TIMEOUT_NS / MS:.0f} ms")
        for sender in self._senders.values():
            sender.close(self._clock.now_ns())
        self._close_sockets()
        self._context.destroy(0)
        return ORPHANED

    def _wait(self) -> list[Source]:
        """Wait until a deadline or a message; return the receivers and the bus to read."""
        due_ns = self._clock.now_ns() + MAX_WAIT_NS
        if self._wake_ns is not None:
            due_ns = min(due_ns, self._wake_ns)
        if self._outbox.due_ns is not None:
            due_ns = min(due_ns, self._outbox.due_ns)
        return self._intake.wait(due_ns)

    def _serve(self, ready: list[Source]) -> None:
        """Serve what is due: tick, packets to send, received data, telemetry, records.

        No read delays a tick by more than its bound: a tick that is due comes before each of them.
        """
        for source in (*self._intake.polled, *ready):
            self._tick_if_due()
            if self._exit is None:
                self._read(source)
        self._tick_if_due()
        now = self._clock.now_ns()
        if now >= self._telemetry_ns:
            self._telemetry_ns = now + TELEMETRY_PERIOD_NS
            self._bus.flush_telemetry()
        if now >= self._record_ns:
            self._record_ns = now + RECORD_PERIOD_NS
            self._send_records(now)

    def _tick_if_due(self) -> None:
        now = self._clock.now_ns()
        if self._exit is None and self._wake_ns is not None and self._wake_ns <= now:
            self._lateness_ns.append(now - self._wake_ns)
            self._wake_ns = None
            self._execute(self._task.on_tick(now))
        self._send_due()

    def _read(self, source: Source) -> None:
        if isinstance(source, ChannelReceiver):
            for message in source.read(self._clock):
                self._execute(self._task.on_message(source.name, message, self._clock.now_ns()))
        else:
            self._read_commands()

    def _read_commands(self) -> None:
        for command in self._bus.drain():
            self._operator_ns = self._clock.now_ns()
            if command is not None:
                self._handle_command(command)
        now = self._clock.now_ns()
        silent_ns = now - self._operator_ns
        if silent_ns > OPERATOR_TIMEOUT_NS:
            self._report_exit(
                f"no message from the operator for {silent_ns / MS:.0f} ms; "
                f"must be <= {OPERATOR_TIMEOUT_NS / MS:.0f} ms: its process exited or was not run"
            )
            self._stop_task(ORPHANED)

    def _report_exit(self, reason: str) -> None:
        """Say on standard error and on the bus why this task exits by itself."""
        sys.stderr.write(f"{self._task.name}: {reason}\n")
        self._record_event("error", reason)

    def _record_event(self, level: str, text: str) -> None:
        t_ns = self._clock.now_ns()
        self._bus.record(Event(t_ns=t_ns, level=level, source=self._task.name, text=text))

    def _handle_command(self, command: Command) -> None:
        if command.verb is Verb.CLOSE:
            self._stop_task(0)
        else:
            self._execute(self._task.on_message("command", command, self._clock.now_ns()))

    def _stop_task(self, code: int) -> None:
        self._execute(self._task.stop(self._clock.now_ns()))
        self._exit = code

    def _execute(self, step: Step) -> None:
        if step.wake_ns is not None:
            self._wake_ns = step.wake_ns
        if step.exit is not None:
            self._exit = step.exit
        for channel, message, at_ns in step.sends:
            if isinstance(message, Reply):
                self._bus.reply(message)
            elif channel in self._senders:
                self._queue(self._senders[channel], message, at_ns)
            else:  # truth: to the operator only
                self._operator_counts.setdefault(channel, LinkCount()).sent += 1
                self._bus.add_telemetry(channel, encode(channel, message, self._wiring.session))

    def _queue(self, sender: ChannelSender, message: Message, at_ns: int) -> None:
        data = encode(sender.name, message, self._wiring.session)
        self._bus.add_telemetry(sender.name, data)
        frame = message if isinstance(message, Frame) else None
        if frame is not None:
            self._send_picture(sender.name, frame, data)
        delay_ns = sender.apply_link(message.seq)
        if delay_ns is not None:
            self._outbox.add(at_ns + delay_ns, sender, frame or data)

    def _send_picture(self, channel: str, frame: Frame, data: bytes) -> None:
        """Send a frame with its pixels to the log, at most pictures_hz times a second."""
        if self._wiring.pictures_hz > 0 and frame.t_ns >= self._picture_ns:
            self._picture_ns = frame.t_ns + round(1e9 / self._wiring.pictures_hz)
            self._bus.picture(channel, data, frame.pixels.tobytes())

    def _send_due(self) -> None:
        while self._outbox.send_due(self._clock.now_ns()):
            pass

    def _send_records(self, now: int) -> None:
        if self._lateness_ns:
            timing = TaskTiming(
                task=self._task.name,
                t_ns=now,
                late_ticks=self._task.late_ticks,
                lateness_ns=self._lateness_ns,
            )
            self._bus.record(timing)
            self._lateness_ns = []
        for receiver in self._receivers.values():
            if receiver.receipts:
                self._bus.record(Receipts(channel=receiver.name, rows=receiver.receipts))
                receiver.receipts = []

    def _close(self) -> None:
        """Send the queued packets and the closing counts, drain the receivers, send the ledger."""
        while (due_ns := self._outbox.due_ns) is not None:
            select.select([], [], [], max(0, due_ns - self._clock.now_ns()) * 1e-9)
            self._send_due()
        for sender in self._senders.values():
            sender.close(self._clock.now_ns())
        self._drain()
        self._send_ledger()

    def _drain(self) -> None:
        """Read the receivers until all senders are closed, or for DRAIN_NS and the link delay."""
        receivers = list(self._receivers.values())
        delay_ns = max((receiver.max_delay_ns for receiver in receivers), default=0)
        until = self._clock.now_ns() + DRAIN_NS + delay_ns
        while self._clock.now_ns() < until and not all(r.closed for r in receivers):
            select.select(receivers, [], [], DRAIN_POLL_S)
            for receiver in receivers:
                receiver.read(self._clock)  # counted; the task is stopped

    def _send_ledger(self) -> None:
        now = self._clock.now_ns()
        self._bus.flush_telemetry()
        self._send_records(now)
        counts = {name: sender.count for name, sender in self._senders.items()}
        counts |= {name: receiver.count for name, receiver in self._receivers.items()}
        counts |= self._operator_counts
        for name, count in counts.items():
            self._bus.record(LinkRow(channel=name, count=count))
        dropped = (self._bus.dropped_telemetry, self._bus.dropped_pictures)
        if any(dropped):
            text = "{} messages and {} pictures were not logged".format(*dropped)
            self._record_event("warning", text)
        self._bus.end_streams()
        self._close_sockets()
        self._context.term()

    def _close_sockets(self) -> None:
        for receiver in self._receivers.values():
            receiver.socket.close()
        self._bus.close()
