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

from comms.channels import MS, received_by
from comms.clock import Clock, MonotonicClock
from comms.ends import ChannelReceiver, Wiring
from comms.errors import CommsError
from comms.intake import MAX_WAIT_NS, Intake, Source
from comms.messages import Command, Verb
from comms.operator_bus import Context, TaskBus
from comms.operator_watch import OperatorWatch
from comms.priority import take_priority
from comms.records import LinkRow
from comms.stop_order import stop_order
from comms.stop_port import REQUESTS, StopPort
from comms.task import Step, Task
from comms.task_output import TaskOutput
from comms.task_records import TaskRecords

RECORD_PERIOD_NS = 250 * MS
# telemetry is sent in batches: one by one it would wake the operator a thousand times a second
TELEMETRY_PERIOD_NS = 50 * MS
DRAIN_NS = 200 * MS  # after the last send, in addition to the delay of the link
START_TIMEOUT_NS = 30_000 * MS  # the imports of the slowest task on a busy machine
DRAIN_POLL_S = 0.01
ORPHANED, REFUSED = 5, 3  # exit codes


def main(build: Callable[[bytes], Task]) -> int:
    """Run the task of a process; return its exit code.

    Standard input: {"wiring": ..., "settings": ...} in JSON on one line; build makes the task from
    settings. It then stays open: its end tells that the process of the operator has exited.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the operator handles Ctrl-C
    parts = msgspec.json.decode(sys.stdin.buffer.readline(), type=dict[str, msgspec.Raw])
    wiring = msgspec.json.decode(parts["wiring"], type=Wiring)
    task = build(bytes(parts["settings"]))
    # before any thread starts: those of ZeroMQ carry the frames and inherit the priority
    take_priority(wiring.priority)
    clock = MonotonicClock(wiring.zero_ns)
    try:
        runner = WallRunner(task, wiring, clock, sys.stdin.fileno())
    except CommsError as error:
        sys.stderr.write(f"{error}\n")
        return REFUSED
    return runner.run()


class WallRunner:
    """Runner of one task: executes its steps until it exits."""

    def __init__(self, task: Task, wiring: Wiring, clock: Clock, pipe: int | None = None) -> None:
        """pipe: descriptor whose end tells that the process of the operator has exited."""
        self._task = task
        self._wiring = wiring
        self._clock = clock
        self._context: Context = zmq.Context()
        self._receivers = {
            name: ChannelReceiver(name, wiring, self._context)
            for name in received_by(task.name, wiring.tasks)
        }
        self._bus = TaskBus(self._context, task.name, wiring.session, wiring.addresses)
        self._output = TaskOutput(task.name, wiring, self._context, self._bus, clock)
        self._records = TaskRecords(task, self._bus, self._receivers.values(), clock)
        self._intake = Intake(self._receivers, clock)
        self._intake.add(self._bus)
        self._watch = OperatorWatch(wiring.operator_silent_ns, pipe)
        if self._watch.has_pipe:
            self._intake.add(self._watch)
        self._stop_port: StopPort | None = None
        if task.name in wiring.stop_ports:
            key = bytes.fromhex(wiring.stop_key)
            self._stop_port = StopPort(wiring.stop_ports[task.name], key)
            self._intake.add(self._stop_port)
        self._taken: set[str] = set()  # requests of the stop port
        self._early_commands: list[Command] = []  # received before the start of the task
        self._wake_ns: int | None = None
        self._exit: int | None = None
        self._record_ns = self._telemetry_ns = 0
        self._leave_ns: int | None = None  # after the loss of the operator

    def run(self) -> int:
        """Run the task until it exits; return its exit code."""
        gc.collect()
        gc.freeze()
        if not self._wait_for_heartbeat():
            return self._give_up()
        now = self._clock.now_ns()
        self._watch.hear(now)
        self._execute(self._task.start(now))
        for command in self._early_commands:
            self._handle_command(command)
        while self._exit is None:
            self._serve(self._wait())
            self._check_operator()
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
                self._await_operator()
            if self._watch.is_gone:
                return False
        return False

    def _await_operator(self) -> None:
        """Wait for a message of the operator or the end of its process, at most MAX_WAIT_NS."""
        sources: list[Source] = [self._bus]
        if self._watch.has_pipe:
            sources.append(self._watch)
        if self._watch in select.select(sources, [], [], MAX_WAIT_NS * 1e-9)[0]:
            self._watch.read_pipe()

    def _give_up(self) -> int:
        """Close the sockets of a task that was never started; return its exit code."""
        reason = f"no heartbeat of the operator within {START_TIMEOUT_NS / MS:.0f} ms"
        self._records.exit_reason(self._watch.loss(0) or reason)
        self._output.close()
        self._close_sockets()
        self._context.destroy(0)
        return ORPHANED

    def _wait(self) -> list[Source]:
        """Wait until a deadline or a message; return the receivers and the bus to read."""
        due_ns = self._clock.now_ns() + MAX_WAIT_NS
        if self._wake_ns is not None:
            due_ns = min(due_ns, self._wake_ns)
        if self._output.due_ns is not None:
            due_ns = min(due_ns, self._output.due_ns)
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
            self._records.send()

    def _tick_if_due(self) -> None:
        now = self._clock.now_ns()
        if self._exit is None and self._wake_ns is not None and self._wake_ns <= now:
            self._records.add_lateness(now - self._wake_ns)
            self._wake_ns = None
            self._execute(self._task.on_tick(now))
        self._output.send_due()

    def _read(self, source: Source) -> None:
        if isinstance(source, ChannelReceiver):
            for message in source.read(self._clock):
                self._execute(self._task.on_message(source.name, message, self._clock.now_ns()))
        elif isinstance(source, StopPort):
            for request in source.drain():
                self._take_stop(request)
        elif source is self._watch:
            self._watch.read_pipe()
            if self._watch.is_gone:
                self._intake.remove(source)
        else:
            self._read_commands()

    def _read_commands(self) -> None:
        for command in self._bus.drain():
            self._watch.hear(self._clock.now_ns())
            if command is not None:
                self._handle_command(command)

    def _check_operator(self) -> None:
        """Stop the task when its operator is lost; exit once the robot had the time to stop."""
        now = self._clock.now_ns()
        if self._leave_ns is not None and now >= self._leave_ns:
            self._stop_task(ORPHANED)
        is_leaving = self._leave_ns is not None or self._exit is not None
        if is_leaving or self._watch.loss(now) is None:
            return
        self._read_commands()  # what arrived while this process itself was not run
        reason = self._watch.loss(now)
        if reason is not None and self._exit is None:
            self._leave_ns = now + self._wiring.orphan_ns
            self._records.exit_reason(reason)
            self._order_stop(Verb.STOP, reason, ORPHANED)

    def _take_stop(self, request: str) -> None:
        """Carry out an order of the stop port; a repeated one has no effect."""
        if request not in self._taken:
            self._taken.add(request)
            reason = f"{request} at the stop port, past the operator"
            self._order_stop(Verb(request), reason, REQUESTS[request])

    def _order_stop(self, verb: Verb, reason: str, code: int) -> None:
        self._execute(stop_order(self._task, verb, reason, code, self._clock.now_ns()))

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
        self._output.take(step.sends)

    def _close(self) -> None:
        """Send the queued packets and the closing counts, drain the receivers, send the ledger."""
        self._output.flush()
        self._output.close()
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
        self._bus.flush_telemetry()
        self._records.send()
        counts = self._output.counts
        counts |= {name: receiver.count for name, receiver in self._receivers.items()}
        counts |= self._output.operator_counts
        for name, count in counts.items():
            self._bus.record(LinkRow(channel=name, count=count))
        dropped = (self._bus.dropped_telemetry, self._bus.dropped_pictures)
        if any(dropped):
            text = "{} messages and {} pictures were not logged".format(*dropped)
            self._records.event("warning", text)
        if self._stop_port is not None and self._stop_port.ignored:
            text = f"{self._stop_port.ignored} foreign datagrams at the stop port were ignored"
            self._records.event("info", text)
        self._bus.end_streams()
        self._close_sockets()
        if self._watch.is_gone:
            self._context.destroy(0)
        else:
            self._context.term()

    def _close_sockets(self) -> None:
        for receiver in self._receivers.values():
            receiver.socket.close()
        if self._stop_port is not None:
            self._stop_port.close()
        self._bus.close()
