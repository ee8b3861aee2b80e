"""Run on the wall clock: tasks as processes, the operator between them and the log."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import zmq

from comms.bus_content import Request
from comms.channels import MS
from comms.clock import MonotonicClock
from comms.endpoints import Endpoints
from comms.ends import ORPHAN_NS, Wiring
from comms.errors import PortInUse
from comms.link import LinkCount, LinkFaults, longest_delay_ns
from comms.messages import Command, Verb
from comms.operator_bus import Context, OperatorBus
from comms.priority import drop_priority, scheduling_of, take_priority
from comms.records import Event
from comms.runner import START_TIMEOUT_NS
from comms.stop_port import KEY_BYTES
from comms.task import Step
from rig.errors import FAULT, REFUSED, STOPPED, Refused
from rig.run import operator_file
from rig.run.operator_file import OperatorFile
from rig.run.recorder import Recorder
from rig.run.runtime.children import Children
from rig.run.runtime.cpu_meter import CpuMeter
from rig.run.runtime.inbox import Inbox
from rig.run.runtime.interrupts import Interrupts
from rig.run.runtime.robot_watch import robot_watch
from rig.run.runtime.terminal_requests import TerminalRequests
from rig.run.tasks.operator import Operator, Stage

HEARTBEAT_PERIOD_NS = 50 * MS
PRIORITY = 5  # SCHED_FIFO of the operator, below all tasks, where it is allowed
MAX_WAIT_MS = 40  # longest wait for a message; then signals and the clock are checked
CHECK_PERIOD_NS = 100 * MS  # of processes, disk and progress
SHUTDOWN_TIMEOUT_NS = 3_000 * MS  # from the close order, plus the delay of the links


class ProcessRunner:
    """Runner of the tasks as processes, to the end of the run."""

    def __init__(
        self,
        settings: Mapping[str, Any],
        operator: Operator,
        clock: MonotonicClock,
        recorder: Recorder,
        interrupts: Interrupts,
        progress: Callable[[int], None],
        folder: Path,
    ) -> None:
        """settings: by task name. folder: receives the output of each task."""
        self._settings = settings
        self._operator = operator
        self._clock = clock
        self._recorder = recorder
        self._interrupts = interrupts
        self._progress = progress
        self._folder = folder
        self._session = secrets.randbits(63)
        self._children = Children(folder)
        robot, tasks = robot_watch(settings, operator), set(settings)
        self._inbox = Inbox(tasks, self._session, operator, recorder, self._carry_out, robot)
        self._roster = self._inbox.roster
        self._requests = TerminalRequests(operator, robot, self._carry_out)
        self._cpu = CpuMeter(self._children)
        self._handled_interrupts = 0
        self._logged_events = 0  # events of the operator that are in the log
        self._wake_ns: int | None = 0
        self._next_heartbeat_ns = 0
        self._next_check_ns = 0
        self.scheduling: dict[str, str] = {}  # policy of each process
        # share of one core, from the first heartbeat to the close order
        self.cpu_share: dict[str, float] = {}

    @property
    def uncounted(self) -> list[str]:
        """Ends of channels whose count did not arrive, as "channel: task"."""
        return self._inbox.counts.uncounted

    def run(
        self,
        host: str,
        ends: Endpoints,
        seed: int,
        faults: dict[str, LinkFaults],
        pictures_hz: float,
        silent_ns: int,
        stop_ns: int,
    ) -> dict[str, LinkCount]:
        """Run until every task has exited; return the settled ledger.

        silent_ns: silence of the operator after which the tasks that move stop. stop_ns: longest
        time of a stop. Raises PortInUse before anything starts.
        """
        context: Context = zmq.Context()
        try:
            self._bus = OperatorBus(context, self._settings, self._session, ends.addresses)
        except PortInUse:
            context.term()
            raise
        try:
            wiring = Wiring(
                session=self._session,
                seed=seed,
                zero_ns=self._clock.zero_ns,
                host=host,
                ports=dict(ends.ports),
                addresses=dict(ends.addresses),
                stop_ports=dict(ends.stop_ports),
                stop_key=secrets.token_hex(KEY_BYTES),
                tasks=tuple(self._settings),
                can=dict(ends.can),
                faults=faults,
                pictures_hz=pictures_hz,
                operator_silent_ns=silent_ns,
                orphan_ns=ORPHAN_NS + stop_ns,
            )
            rest = (wiring.stop_key, wiring.stop_ports, wiring.can)
            contact = OperatorFile(ends.addresses["commands"], os.getpid(), *rest)
            contact.write(self._folder)
            self._children.start(self._settings, wiring)
            self._await_tasks()
            self._loop()
            self._await_shutdown(longest_delay_ns(faults.values()))
            self._add_starvation()
            self._log_foreign()
        except BaseException:
            self._abort()
            raise
        finally:
            self._children.kill_running()
            (self._folder / operator_file.NAME).unlink(missing_ok=True)
            self._bus.close()
            context.term()
        return self._inbox.counts.settle(self._recorder.counts.get("truth", 0))

    def _await_tasks(self) -> None:
        """Wait until the sockets of every task are open; the first heartbeat then starts them."""
        until_ns = self._clock.now_ns() + START_TIMEOUT_NS
        roster = self._roster
        names = self._children.names
        while roster.present != names and self._operator.stage is Stage.CONNECTING:
            self._bus.wait(MAX_WAIT_MS)
            self._handle_signals(self._clock.now_ns())
            self._receive()
            now_ns = self._clock.now_ns()
            self._check_exited_tasks(now_ns)
            if now_ns > until_ns:
                return
        # the run ended before these tasks were present
        for name in self._children.kill_running(names - roster.present):
            roster.gone.add(name)
            self._carry_out(self._operator.on_task_absent(name, self._clock.now_ns()))

    def _loop(self) -> None:
        """Run the operator from its start until the run is closed."""
        start_ns = self._clock.now_ns()
        self._cpu.start(start_ns)
        self._carry_out(self._operator.start(start_ns))
        has_priority = take_priority(PRIORITY, is_bounded=False)
        try:
            while self._operator.stage is not Stage.CLOSED:
                self._step()
        finally:
            if has_priority:
                drop_priority()

    def _add_starvation(self) -> None:
        """Name the processes that the machine did not run, as a reason of a fault."""
        if self._operator.exit_code == FAULT:
            self._operator.reasons += self._inbox.starvation.reasons()

    def _step(self) -> None:
        """Wait for messages, at most until the next wake-up; then do what is due."""
        begin_ns = self._clock.now_ns()
        due_ns = min(begin_ns + MAX_WAIT_MS * MS, self._next_heartbeat_ns)
        if self._wake_ns is not None:
            due_ns = min(due_ns, self._wake_ns)
        wait_ms = max(0, -(-(due_ns - begin_ns) // MS))  # rounded up: never woken early
        self._bus.wait(wait_ms)
        now_ns = self._clock.now_ns()
        self._inbox.starvation.add("operator", [now_ns - begin_ns - wait_ms * MS])
        self._handle_signals(now_ns)
        self._send_heartbeats(now_ns)
        self._receive()
        now_ns = self._clock.now_ns()
        if now_ns >= self._next_check_ns:
            self._next_check_ns = now_ns + CHECK_PERIOD_NS
            self._check_exited_tasks(now_ns)
            self._recorder.tick(now_ns)
            self._progress(now_ns)
        if self._wake_ns is not None and now_ns >= self._wake_ns:
            self._wake_ns = None
            self._carry_out(self._operator.on_tick(now_ns))

    def _receive(self) -> None:
        """Handle what has arrived on the bus; a signal is handled before the next message."""
        for sender, content in self._bus.drain():
            now_ns = self._clock.now_ns()
            self._handle_signals(now_ns)
            if isinstance(content, Request):
                self._bus.answer(content.client, self._requests.answer(content.text, now_ns))
            else:
                self._inbox.handle(sender, content, now_ns)

    def _carry_out(self, step: Step) -> None:
        """Send and log what the operator returned: orders first, then the log."""
        if step.wake_ns is not None:
            self._wake_ns = step.wake_ns
        orders = [message for _, message, _ in step.sends if isinstance(message, Command)]
        if any(order.verb is Verb.CLOSE for order in orders):
            self._measure_processes()
        for order in orders:
            self._bus.send(order)
        for order in orders:
            self._recorder.message("command", order, order.t_ns)
        for event in self._operator.events[self._logged_events :]:
            self._recorder.record(event, event.t_ns)
        self._logged_events = len(self._operator.events)

    def _measure_processes(self) -> None:
        """Measure processor shares and scheduling; tasks exit soon after the close order."""
        self.cpu_share = self._cpu.shares(self._clock.now_ns())
        own = {"operator": scheduling_of(os.getpid())}
        self.scheduling = own | self._children.scheduling()

    def _send_heartbeats(self, now_ns: int) -> None:
        if now_ns >= self._next_heartbeat_ns:
            self._next_heartbeat_ns = now_ns + HEARTBEAT_PERIOD_NS
            for name in self._children.names:
                self._bus.heartbeat(name)

    def _handle_signals(self, now_ns: int) -> None:
        """Stop in order at the first signal, at once at the second."""
        count = self._interrupts.count
        if count >= 2:
            reason = "stopped at once by the operator (second Ctrl-C)"
            self._carry_out(self._operator.stop_now(reason, STOPPED, now_ns))
        elif count > self._handled_interrupts:
            reason = f"stopped by the operator ({self._interrupts.newest})"
            self._carry_out(self._operator.end(reason, STOPPED, now_ns))
        self._handled_interrupts = count

    def _check_exited_tasks(self, now_ns: int) -> None:
        """End the run when a task exited; raises Refused when the task refused to start."""
        for name, code in self._children.newly_exited():
            self._roster.gone.add(name)
            last_line = self._children.last_log_line(name)
            if code == REFUSED:
                raise Refused(last_line)
            cause = f"signal {-code}" if code < 0 else f"exit code {code}"
            reason = f"task '{name}' exited during the run ({cause}): {last_line}"
            self._carry_out(self._operator.on_task_exit(name, reason, now_ns))

    def _await_shutdown(self, delay_ns: int) -> None:
        """Wait for the tasks to shut down; kill and log those that exceed the timeout."""
        until_ns = self._clock.now_ns() + SHUTDOWN_TIMEOUT_NS + delay_ns
        expected = self._roster.expected_ends()
        while self._clock.now_ns() < until_ns:
            if not (expected - self._roster.left or self._children.any_alive()):
                break
            self._bus.wait(MAX_WAIT_MS)
            self._receive()
        now_ns = self._clock.now_ns()
        for name in self._children.kill_running():
            text = f"task '{name}' did not shut down in time and was killed"
            event = Event(t_ns=now_ns, level="warning", source="operator", text=text)
            self._recorder.record(event, now_ns)

    def _log_foreign(self) -> None:
        """Log the number of messages on the bus that no task of this run sent."""
        foreign = self._bus.foreign + self._inbox.foreign
        if foreign:
            now_ns = self._clock.now_ns()
            text = f"{foreign} foreign messages on the operator's bus were ignored"
            event = Event(t_ns=now_ns, level="info", source="operator", text=text)
            self._recorder.record(event, now_ns)

    def _abort(self) -> None:
        """Stop the robot and close after an error of the operator's process.

        Nothing is logged: the log may be what failed.
        """
        step = self._operator.stop_now("the operator's side failed", FAULT, self._clock.now_ns())
        for _, message, _ in step.sends:
            if isinstance(message, Command):
                self._bus.send(message)
        until_ns = self._clock.now_ns() + SHUTDOWN_TIMEOUT_NS
        while self._clock.now_ns() < until_ns and self._children.any_alive():
            self._bus.wait(MAX_WAIT_MS)
            for _ in self._bus.drain():
                pass
