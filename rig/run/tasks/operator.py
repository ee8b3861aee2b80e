"""The operator's part of a run, as a task like the others: connect, arm, start, watch, stop, close."""

from __future__ import annotations

import enum
from collections.abc import Sequence

from comms.channels import MS
from comms.messages import Command, Message, Reply, Verb
from comms.records import Event
from comms.task import NO_STEP, Send, Step
from rig.errors import FAULT, OK, STOPPED

RETRY_NS = 100 * MS
CONNECT_NS = 15_000 * MS
ANSWER_NS = 2_000 * MS  # for arm, start, stop
LEAD_NS = 500 * MS  # from the start order to t_start
GRID_NS = 60 * MS  # t_start lies on a common multiple of all periods (5, 10, 20, 30 ms)
REST_NS = 400 * MS  # after a stop: the servos settle in 60 ms, and the log is to show it
MOVERS = ("controller", "streamer")  # a stop goes here, and is believed when both say so


class Stage(enum.Enum):
    """How far the run is; the order is the order of a run."""

    CONNECTING = "connecting"
    ARMING = "arming"
    STARTING = "starting"
    RUNNING = "running"
    STOPPING = "stopping"
    RESTING = "coming to rest"
    CLOSED = "closed"


class Operator:
    """Sans-IO task `operator`. exit_code and reasons say how the run went; events are for the log and the screen."""

    name = "operator"

    def __init__(self, tasks: Sequence[str], duration_ns: int) -> None:
        self._tasks = tuple(tasks)
        self._duration_ns = duration_ns
        self._waiting: set[str] = set(tasks)
        self._last_word: dict[str, str] = {}
        self._deadline_ns = CONNECT_NS
        self._seq = 0
        self._call = 0  # id of the order whose answers are awaited
        self.stage = Stage.CONNECTING
        self.t_start_ns: int | None = None
        self.exit_code = OK
        self.reasons: list[str] = []
        self.events: list[Event] = []
        self.late_ticks = 0

    @property
    def t_end_ns(self) -> int | None:
        """When the watch ends, once started."""
        return None if self.t_start_ns is None else self.t_start_ns + self._duration_ns

    def start(self, t_ns: int) -> Step:
        """Ask everybody whether they are there (a task may have been lost before)."""
        if self.stage is Stage.CONNECTING:
            self._deadline_ns = t_ns + CONNECT_NS
        return Step(wake_ns=t_ns)

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Replies move the run on; news with an exit code end it."""
        if not isinstance(message, Reply):
            return NO_STEP
        if message.id == 0:
            return self._hear(message, t_ns)
        if message.id != self._call or message.sender not in self._waiting:
            return NO_STEP
        if not message.ok:
            self._last_word[message.sender] = message.text
            if self.stage in (Stage.ARMING, Stage.STARTING):
                return self.end(f"{message.sender}: {message.text}", message.exit or FAULT, t_ns)
            return NO_STEP
        self._waiting.discard(message.sender)
        return NO_STEP if self._waiting else self._advance(t_ns)

    def on_tick(self, t_ns: int) -> Step:
        """Ask again while connecting, notice who does not answer, end the watch."""
        if self.stage is Stage.CLOSED:
            return NO_STEP
        if self.stage is Stage.RUNNING:
            end_ns = self.t_end_ns or t_ns
            return self._close(t_ns) if t_ns >= end_ns else Step(wake_ns=end_ns)
        if self.stage is Stage.RESTING and t_ns >= self._deadline_ns:
            return self._close(t_ns)
        if t_ns >= self._deadline_ns:
            return self._give_up(t_ns)
        if self.stage is Stage.CONNECTING:
            return Step(self._order(Verb.STATUS, sorted(self._waiting), t_ns), t_ns + RETRY_NS)
        return Step(wake_ns=self._deadline_ns)

    def stop(self, t_ns: int) -> Step:
        """Nothing is left to do."""
        return NO_STEP

    def end(self, reason: str, exit_code: int, t_ns: int) -> Step:
        """Stop the robot, then close: for an operator's stop, a dead task, a refusal, a fault.

        While it stops already, only a first fault counts: it becomes the exit code, and the emergency stop goes out.
        """
        worse = exit_code == FAULT != self.exit_code
        if self.stage is Stage.CLOSED or (
            self.stage in (Stage.STOPPING, Stage.RESTING) and not worse
        ):
            return NO_STEP
        self.exit_code = exit_code
        self.reasons.append(reason)
        self._note("warning" if exit_code == STOPPED else "error", reason, t_ns)
        verb = Verb.ESTOP if exit_code == FAULT else Verb.STOP
        step = self._enter(Stage.STOPPING, t_ns)
        self._waiting = {name for name in MOVERS if name in self._tasks}
        if not self._waiting:
            return self._close(t_ns)
        return Step(self._order(verb, [n for n in self._tasks if n in MOVERS], t_ns), step.wake_ns)

    def stop_now(self, reason: str, exit_code: int, t_ns: int) -> Step:
        """Stop without waiting for anybody's word; the stop order still goes out first."""
        stopping, closing = self.end(reason, exit_code, t_ns), self._close(t_ns)
        return Step((*stopping.sends, *closing.sends), exit=self.exit_code)

    def lost(self, task: str, reason: str, t_ns: int) -> Step:
        """A task died: that ends the run as a fault."""
        self._forget(task)
        step = self.end(reason, FAULT, t_ns)
        return self._close(t_ns) if self.stage is Stage.STOPPING and not self._waiting else step

    def never_came(self, task: str, t_ns: int) -> Step:
        """A run that is over already goes on without a task that had not come yet."""
        self._forget(task)
        return self._close(t_ns) if self.stage is Stage.STOPPING and not self._waiting else NO_STEP

    def _forget(self, task: str) -> None:
        self._tasks = tuple(name for name in self._tasks if name != task)
        self._waiting.discard(task)

    def _advance(self, t_ns: int) -> Step:
        if self.stage is Stage.CONNECTING:
            step = self._enter(Stage.ARMING, t_ns)
            return Step(self._order(Verb.ARM, self._tasks, t_ns), step.wake_ns)
        if self.stage is Stage.ARMING:
            step = self._enter(Stage.STARTING, t_ns)
            self.t_start_ns = -(-(t_ns + LEAD_NS) // GRID_NS) * GRID_NS
            self._note("info", f"armed; t_start = {self.t_start_ns * 1e-9:.3f} s", t_ns)
            return Step(self._order(Verb.START, self._tasks, t_ns, self.t_start_ns), step.wake_ns)
        if self.stage is Stage.STARTING:
            return self._enter(Stage.RUNNING, t_ns)._replace(wake_ns=self.t_end_ns)
        return self._rest(t_ns) if self.stage is Stage.STOPPING else NO_STEP

    def _rest(self, t_ns: int) -> Step:
        """The movers have stopped: watch until the robot stands, if it ever moved."""
        if self.t_start_ns is None or t_ns < self.t_start_ns:
            return self._close(t_ns)
        self.stage = Stage.RESTING
        self._deadline_ns = t_ns + REST_NS
        return Step(wake_ns=self._deadline_ns)

    def _enter(self, stage: Stage, t_ns: int) -> Step:
        self.stage = stage
        self._waiting = set(self._tasks)
        self._deadline_ns = t_ns + ANSWER_NS
        return Step(wake_ns=self._deadline_ns)

    def _close(self, t_ns: int) -> Step:
        if self.stage is Stage.CLOSED:
            return NO_STEP
        self.stage = Stage.CLOSED
        return Step(self._order(Verb.CLOSE, self._tasks, t_ns), exit=self.exit_code)

    def _give_up(self, t_ns: int) -> Step:
        silent = ", ".join(
            f"{name} ({self._last_word[name]})" if name in self._last_word else name
            for name in sorted(self._waiting)
        )
        text = f"{self.stage.value}: no answer in time from {silent}"
        if self.stage is Stage.STOPPING:
            self.reasons.append(text)
            return self._close(t_ns)
        return self.end(text, FAULT, t_ns)

    def _hear(self, reply: Reply, t_ns: int) -> Step:
        text = f"{reply.sender}: {reply.text}"
        step = NO_STEP if reply.exit is None else self.end(text, reply.exit, t_ns)
        if step is NO_STEP and reply.text:
            self._note("info" if reply.ok else "error", text, t_ns)
        return step

    def _order(self, verb: Verb, to: Sequence[str], t_ns: int, t_start_ns: int = 0) -> list[Send]:
        if (
            verb is not Verb.STATUS or self._call == 0
        ):  # asked again it keeps its id: a slow answer is an answer
            self._call = self._seq + 1  # all tasks of one order share an id
        sends = []
        for name in to:
            self._seq += 1
            order = Command(
                seq=self._seq, t_ns=t_ns, id=self._call, to=name, verb=verb, t_start_ns=t_start_ns
            )
            sends.append(Send("command", order, t_ns))
        return sends

    def _note(self, level: str, text: str, t_ns: int) -> None:
        self.events.append(Event(t_ns=t_ns, level=level, source=self.name, text=text))
