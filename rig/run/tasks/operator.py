"""The operator of a run as a sans-IO task: connect, arm, start, watch, stop, close."""

from __future__ import annotations

import enum
from collections.abc import Sequence

from comms.channels import MS
from comms.messages import Command, Message, Reply, Verb
from comms.records import Event
from comms.task import NO_STEP, Send, Step
from rig.errors import FAULT, OK, STOPPED

RETRY_PERIOD_NS = 100 * MS
CONNECT_TIMEOUT_NS = 15_000 * MS
ANSWER_TIMEOUT_NS = 2_000 * MS  # for arm, start, stop
MIN_START_DELAY_NS = 500 * MS  # from the start order to t_start
START_GRID_NS = 60 * MS  # t_start is a common multiple of all periods (5, 10, 20, 30 ms)
REST_NS = 400 * MS  # watched after a stop, beside its duration: the servos settle in 60 ms
MOVERS = ("controller", "streamer", "drive")  # a stop goes to these, and all must confirm it


class Stage(enum.Enum):
    """Stages of a run, in their order."""

    CONNECTING = "connecting"
    ARMING = "arming"
    STARTING = "starting"
    RUNNING = "running"
    STOPPING = "stopping"
    RESTING = "coming to rest"
    CLOSED = "closed"


class Operator:
    """Sans-IO task `operator`.

    exit_code and reasons: outcome of the run. events: for the log and the screen.
    """

    name = "operator"

    def __init__(self, tasks: Sequence[str], duration_ns: int, stop_ns: int = 0) -> None:
        """duration_ns: time to watch from the start on. stop_ns: longest time of a stop."""
        self._tasks = tuple(tasks)
        self._duration_ns = duration_ns
        self._stop_ns = stop_ns
        self._waiting: set[str] = set(tasks)
        self._last_refusal: dict[str, str] = {}  # by task
        self._deadline_ns = CONNECT_TIMEOUT_NS
        self._seq = 0
        self._order_id = 0  # of the order whose answers are awaited
        self.stage = Stage.CONNECTING
        self.t_start_ns: int | None = None
        self.exit_code = OK
        self.reasons: list[str] = []
        self.events: list[Event] = []
        self.late_ticks = 0

    @property
    def t_end_ns(self) -> int | None:
        """End of the watched time; None before the start."""
        return None if self.t_start_ns is None else self.t_start_ns + self._duration_ns

    def start(self, t_ns: int) -> Step:
        """Begin to ask the tasks for their status; a task may have exited before."""
        if self.stage is Stage.CONNECTING:
            self._deadline_ns = t_ns + CONNECT_TIMEOUT_NS
        return Step(wake_ns=t_ns)

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Take a reply; enter the next stage after the last one, end the run at an exit code."""
        if not isinstance(message, Reply):
            return NO_STEP
        if message.id == 0:
            return self._take_report(message, t_ns)
        if message.id != self._order_id or message.sender not in self._waiting:
            return NO_STEP
        if not message.ok:
            self._last_refusal[message.sender] = message.text
            if self.stage in (Stage.ARMING, Stage.STARTING):
                return self.end(f"{message.sender}: {message.text}", message.exit or FAULT, t_ns)
            return NO_STEP
        self._waiting.discard(message.sender)
        return NO_STEP if self._waiting else self._advance(t_ns)

    def on_tick(self, t_ns: int) -> Step:
        """Repeat the status order while connecting, end the watch, and handle timeouts."""
        if self.stage is Stage.CLOSED:
            return NO_STEP
        if self.stage is Stage.RUNNING:
            end_ns = self.t_end_ns or t_ns
            if t_ns >= end_ns:
                return self._close(t_ns)
            return Step(wake_ns=end_ns)
        if self.stage is Stage.RESTING and t_ns >= self._deadline_ns:
            return self._close(t_ns)
        if t_ns >= self._deadline_ns:
            return self._handle_timeout(t_ns)
        if self.stage is Stage.CONNECTING:
            orders = self._orders(Verb.STATUS, sorted(self._waiting), t_ns)
            return Step(orders, t_ns + RETRY_PERIOD_NS)
        return Step(wake_ns=self._deadline_ns)

    def stop(self, t_ns: int) -> Step:
        """Stop without action."""
        return NO_STEP

    def end(self, reason: str, exit_code: int, t_ns: int) -> Step:
        """Stop the robot, then close: after a stop, an exited task, a refusal or a fault.

        While stopping, only a first fault counts: it becomes the exit code, and the emergency stop
        is sent.
        """
        if self.stage is Stage.CLOSED:
            return NO_STEP
        is_first_fault = exit_code == FAULT != self.exit_code
        if self.stage in (Stage.STOPPING, Stage.RESTING) and not is_first_fault:
            return NO_STEP
        self.exit_code = exit_code
        self.reasons.append(reason)
        self._add_event("warning" if exit_code == STOPPED else "error", reason, t_ns)
        verb = Verb.ESTOP if exit_code == FAULT else Verb.STOP
        step = self._enter(Stage.STOPPING, t_ns)
        self._waiting = {name for name in MOVERS if name in self._tasks}
        if not self._waiting:
            return self._close(t_ns)
        movers = [name for name in self._tasks if name in MOVERS]
        return Step(self._orders(verb, movers, t_ns), step.wake_ns)

    def stop_now(self, reason: str, exit_code: int, t_ns: int) -> Step:
        """Stop and close without waiting for answers; the stop order is sent first."""
        stopping = self.end(reason, exit_code, t_ns)
        closing = self._close(t_ns)
        return Step((*stopping.sends, *closing.sends), exit=self.exit_code)

    def on_task_exit(self, task: str, reason: str, t_ns: int) -> Step:
        """End the run as a fault after a task exited during it."""
        self._forget(task)
        step = self.end(reason, FAULT, t_ns)
        if self.stage is Stage.STOPPING and not self._waiting:
            return self._close(t_ns)
        return step

    def on_task_absent(self, task: str, t_ns: int) -> Step:
        """Continue to stop a run without a task that was not present when the run ended."""
        self._forget(task)
        if self.stage is Stage.STOPPING and not self._waiting:
            return self._close(t_ns)
        return NO_STEP

    def _forget(self, task: str) -> None:
        self._tasks = tuple(name for name in self._tasks if name != task)
        self._waiting.discard(task)

    def _advance(self, t_ns: int) -> Step:
        if self.stage is Stage.CONNECTING:
            step = self._enter(Stage.ARMING, t_ns)
            return Step(self._orders(Verb.ARM, self._tasks, t_ns), step.wake_ns)
        if self.stage is Stage.ARMING:
            step = self._enter(Stage.STARTING, t_ns)
            grid_steps = -(-(t_ns + MIN_START_DELAY_NS) // START_GRID_NS)  # rounded up
            self.t_start_ns = grid_steps * START_GRID_NS
            self._add_event("info", f"armed; t_start = {self.t_start_ns * 1e-9:.3f} s", t_ns)
            return Step(self._orders(Verb.START, self._tasks, t_ns, self.t_start_ns), step.wake_ns)
        if self.stage is Stage.STARTING:
            return self._enter(Stage.RUNNING, t_ns)._replace(wake_ns=self.t_end_ns)
        return self._await_rest(t_ns) if self.stage is Stage.STOPPING else NO_STEP

    def _await_rest(self, t_ns: int) -> Step:
        """Watch until the robot is at rest after a stop; close at once if it never moved."""
        if self.t_start_ns is None or t_ns < self.t_start_ns:
            return self._close(t_ns)
        self.stage = Stage.RESTING
        self._deadline_ns = t_ns + self._stop_ns + REST_NS
        return Step(wake_ns=self._deadline_ns)

    def _enter(self, stage: Stage, t_ns: int) -> Step:
        self.stage = stage
        self._waiting = set(self._tasks)
        self._deadline_ns = t_ns + ANSWER_TIMEOUT_NS
        return Step(wake_ns=self._deadline_ns)

    def _close(self, t_ns: int) -> Step:
        if self.stage is Stage.CLOSED:
            return NO_STEP
        self.stage = Stage.CLOSED
        return Step(self._orders(Verb.CLOSE, self._tasks, t_ns), exit=self.exit_code)

    def _handle_timeout(self, t_ns: int) -> Step:
        silent = [self._with_refusal(name) for name in sorted(self._waiting)]
        text = f"{self.stage.value}: no answer in time from {', '.join(silent)}"
        if self.stage is Stage.STOPPING:
            self.reasons.append(text)
            return self._close(t_ns)
        return self.end(text, FAULT, t_ns)

    def _with_refusal(self, task: str) -> str:
        refusal = self._last_refusal.get(task)
        return task if refusal is None else f"{task} ({refusal})"

    def _take_report(self, reply: Reply, t_ns: int) -> Step:
        """Log a report that answers no order; end the run where it has an exit code."""
        text = f"{reply.sender}: {reply.text}"
        step = NO_STEP if reply.exit is None else self.end(text, reply.exit, t_ns)
        if step is NO_STEP and reply.text:
            self._add_event("info" if reply.ok else "error", text, t_ns)
        return step

    def _orders(self, verb: Verb, to: Sequence[str], t_ns: int, t_start_ns: int = 0) -> list[Send]:
        """Address an order to each task; all share one id.

        A repeated status order keeps its id, so that an answer to an earlier one still counts.
        """
        if verb is not Verb.STATUS or self._order_id == 0:
            self._order_id = self._seq + 1
        sends = []
        for name in to:
            self._seq += 1
            order = Command(
                seq=self._seq,
                t_ns=t_ns,
                id=self._order_id,
                to=name,
                verb=verb,
                t_start_ns=t_start_ns,
            )
            sends.append(Send("command", order, t_ns))
        return sends

    def _add_event(self, level: str, text: str, t_ns: int) -> None:
        self.events.append(Event(t_ns=t_ns, level=level, source=self.name, text=text))
