"""The wall clock: the tasks as processes, the operator between them and the log."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import msgspec
import zmq

from comms.channels import CHANNELS, DATA, MS, Transport
from comms.clock import MonotonicClock, cpu_of_s
from comms.codec import decode
from comms.ends import Wiring
from comms.frames import with_pixels
from comms.link import LinkCount, LinkFaults, merge_counts
from comms.messages import Command, Frame, Message, Reply, Verb
from comms.operator_bus import Hello, OperatorBus, StreamEnd, Telemetry
from comms.records import Event, LinkRow
from comms.runner import START_TIMEOUT_NS
from comms.task import Step
from comms.udp import free_ports
from rig.errors import FAULT, REFUSED, STOPPED, Refused
from rig.run.recorder import Recorder
from rig.run.runtime.children import Children
from rig.run.runtime.interrupts import Interrupts
from rig.run.tasks.operator import Operator, Stage

BUS_PORTS = 3  # base_port .. base_port + 2 are the operator's, the channels follow
HEARTBEAT_NS = 200 * MS
LOOK_MS = 40  # longest wait for words, interrupts and the clock
GLANCE_NS = 100 * MS  # between glances at children, disk and screen
LEAVE_NS = (
    3_000 * MS
)  # for tasks to drain and report after the close order, beyond the links' own delay


class ProcessRunner:
    """Runs tasks as processes to the end of the run."""

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
        """settings: task name -> what it is told; folder receives each task's own words."""
        self._settings, self._operator, self._clock = settings, operator, clock
        self._recorder, self._interrupts, self._progress = recorder, interrupts, progress
        self._folder = folder
        self._session = secrets.randbits(63)
        self._children = Children(folder)
        self._present: set[str] = set()  # tasks whose sockets are open
        self._left: set[tuple[str, str]] = set()  # (task, socket) whose stream ended
        self._gone: set[str] = set()  # tasks that died without
        self._heard = 0  # interrupts acted on
        self._logged = 0  # operator's events written
        self._rows: dict[tuple[str, str], LinkCount] = {}
        self._wake_ns: int | None = 0
        self._beat_ns = self._glance_ns = self._began_ns = 0
        self._used_s: dict[str, float] = {}  # processor seconds when the run began
        self.scheduling: dict[
            str, str
        ] = {}  # what each task got of the real-time place it asked for
        self.cpu_share: dict[
            str, float
        ] = {}  # of one core, from the first heartbeat to the close order
        self.uncounted: list[str] = []  # "link: task" whose count never came

    def run(
        self,
        host: str,
        base_port: int,
        seed: int,
        faults: dict[str, LinkFaults],
        pictures_hz: float,
    ) -> dict[str, LinkCount]:
        """Until every task has left; returns the settled ledger. Raises PortInUse before anything starts."""
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._bus = OperatorBus(context, host, base_port)
        try:
            wiring = self._wiring(host, base_port, seed, faults, pictures_hz)
            self._announce()
            self._children.start(self._settings, wiring)
            self._admit()
            self._watch()
            self._let_leave(
                round(max((f.delay_ms + f.jitter_ms for f in faults.values()), default=0) * MS)
            )
        except BaseException:
            self._abort()
            raise
        finally:
            self._children.end()
            (self._folder / "operator.json").unlink(missing_ok=True)
            self._bus.close()
            context.term()
        return self._settle()

    def _wiring(
        self,
        host: str,
        base_port: int,
        seed: int,
        faults: dict[str, LinkFaults],
        pictures_hz: float,
    ) -> Wiring:
        return Wiring(
            session=self._session,
            seed=seed,
            zero_ns=self._clock.zero_ns,
            host=host,
            ports=channel_ports(host, base_port),
            commands=self._bus.commands,
            telemetry=self._bus.telemetry,
            pictures=self._bus.pictures,
            faults=faults,
            pictures_hz=pictures_hz,
        )

    def _announce(self) -> None:
        """Where `rig stop` finds this run; never seen half written."""
        word = {"address": self._bus.commands, "pid": os.getpid()}
        draft = self._folder / "operator.json.new"
        draft.write_bytes(msgspec.json.encode(word))
        draft.rename(self._folder / "operator.json")

    def _admit(self) -> None:
        """Begin when every task's sockets are open: the first heartbeat starts them all."""
        until = self._clock.now_ns() + START_TIMEOUT_NS
        while self._present != self._children.names and self._operator.stage is Stage.CONNECTING:
            self._bus.wait(LOOK_MS)
            self._hear()
            now = self._clock.now_ns()
            self._heed_interrupts(now)
            self._miss_the_dead(now)
            if now > until:
                return
        for name in self._children.end(
            self._children.names - self._present
        ):  # the run was over before they came
            self._gone.add(name)
            self._carry_out(self._operator.never_came(name, self._clock.now_ns()))

    def _watch(self) -> None:
        self._began_ns, self._used_s = self._clock.now_ns(), self._cpu_s()
        self._carry_out(self._operator.start(self._began_ns))
        while self._operator.stage is not Stage.CLOSED:
            self._look()

    def _measure(self) -> None:
        """What the tasks took of the processors; asked before the close order, for they leave quickly."""
        span_s = max(1e-3, (self._clock.now_ns() - self._began_ns) * 1e-9)
        self.cpu_share = {
            name: (used - self._used_s.get(name, used)) / span_s
            for name, used in self._cpu_s().items()
        }
        self.scheduling = self._children.scheduling()

    def _cpu_s(self) -> dict[str, float]:
        return {"operator": cpu_of_s(os.getpid())} | self._children.cpu_s()

    def _look(self) -> None:
        now = self._clock.now_ns()
        due_ms = (
            LOOK_MS if self._wake_ns is None else max(0, min(LOOK_MS, (self._wake_ns - now) // MS))
        )
        self._bus.wait(due_ms)
        self._hear()
        now = self._clock.now_ns()
        if now >= self._glance_ns:
            self._glance_ns = now + GLANCE_NS
            self._beat(now)
            self._miss_the_dead(now)
            self._recorder.tick(now)
            self._progress(now)
        self._heed_interrupts(now)
        if self._wake_ns is not None and now >= self._wake_ns:
            self._wake_ns = None
            self._carry_out(self._operator.on_tick(now))

    def _hear(self) -> None:
        for who, said in self._bus.drain():
            now, name = self._clock.now_ns(), who.decode("ascii", "replace")
            if isinstance(said, Telemetry):
                self._log(said, now)
            elif isinstance(said, str):
                self._serve(who, said, now)
            elif name not in self._children.names:
                continue  # a stranger on the bus
            elif isinstance(said, Hello):
                self._present.add(name)
            elif isinstance(said, StreamEnd):
                self._left.add((name, said.socket))
            elif isinstance(said, Reply):
                self._recorder.message("reply", said, now)
                self._carry_out(self._operator.on_message("reply", said, now))
            elif isinstance(said.record, LinkRow):
                self._rows[said.record.channel, name] = said.record.count
            else:
                self._recorder.record(said.record, now)

    def _log(self, tapped: Telemetry, now: int) -> None:
        message = decode(tapped.channel, tapped.data, self._session)
        if isinstance(message, Frame) and tapped.pixels is not None:
            frame = with_pixels(message, memoryview(tapped.pixels))
            if isinstance(frame, Frame):
                self._recorder.picture(frame, now)
        elif isinstance(message, Message):
            self._recorder.message(tapped.channel, message, now)

    def _serve(self, who: bytes, request: str, now: int) -> None:
        """A second terminal: `stop` or `estop`; anything else is told what is understood."""
        if request in ("stop", "estop"):
            was = self._operator.stage.value
            code = STOPPED if request == "stop" else FAULT
            self._carry_out(self._operator.end(f"{request} from another terminal", code, now))
            self._bus.answer(who, f"stopping, was {was}")
        else:
            self._bus.answer(who, "understood are: stop, estop")

    def _carry_out(self, step: Step) -> None:
        if step.wake_ns is not None:
            self._wake_ns = step.wake_ns
        orders = [message for _, message, _ in step.sends if isinstance(message, Command)]
        if any(order.verb is Verb.CLOSE for order in orders):
            self._measure()
        for order in orders:  # the robot first, the log after
            self._bus.send(order)
        for order in orders:
            self._recorder.message("command", order, order.t_ns)
        for event in self._operator.events[self._logged :]:
            self._recorder.record(event, event.t_ns)
        self._logged = len(self._operator.events)

    def _beat(self, now: int) -> None:
        if now >= self._beat_ns:
            self._beat_ns = now + HEARTBEAT_NS
            for name in self._children.names:
                self._bus.heartbeat(name)

    def _heed_interrupts(self, now: int) -> None:
        if self._interrupts.count >= 2:
            self._carry_out(
                self._operator.stop_now(
                    "stopped at once by the operator (second Ctrl-C)", STOPPED, now
                )
            )
        elif self._interrupts.count > self._heard:
            self._carry_out(
                self._operator.end(
                    f"stopped by the operator ({self._interrupts.what})", STOPPED, now
                )
            )
        self._heard = self._interrupts.count

    def _miss_the_dead(self, now: int) -> None:
        for name, code in self._children.newly_dead():
            self._gone.add(name)
            words = self._children.last_words(name)
            if code == REFUSED:
                raise Refused(words)
            how = f"signal {-code}" if code < 0 else f"exit code {code}"
            self._carry_out(self._operator.lost(name, f"task '{name}' died ({how}): {words}", now))

    def _let_leave(self, delay_ns: int) -> None:
        """Hear everybody out; a task that does not leave in time is ended, and that is told."""
        until = self._clock.now_ns() + LEAVE_NS + delay_ns
        awaited = {
            (name, socket)
            for name in self._present - self._gone
            for socket in ("control", "telemetry")
        }
        while self._clock.now_ns() < until and (awaited - self._left or self._children.any_alive()):
            self._bus.wait(LOOK_MS)
            self._hear()
        now = self._clock.now_ns()
        for name in self._children.end():
            text = f"task '{name}' did not leave in time and was ended"
            self._recorder.record(
                Event(t_ns=now, level="warning", source="operator", text=text), now
            )

    def _abort(self) -> None:
        """Something broke on this side: stop the robot and close, without the log, which may be what broke."""
        step = self._operator.stop_now("the operator's side failed", FAULT, self._clock.now_ns())
        for _, message, _ in step.sends:
            if isinstance(message, Command):
                self._bus.send(message)
        until = self._clock.now_ns() + LEAVE_NS
        while self._clock.now_ns() < until and self._children.any_alive():
            self._bus.wait(LOOK_MS)
            for _ in self._bus.drain():
                pass

    def _settle(self) -> dict[str, LinkCount]:
        rows = {}
        for name in DATA:
            ends = [(name, CHANNELS[name].sender), (name, CHANNELS[name].receiver)]
            if all(end in self._rows for end in ends):
                rows[name] = merge_counts(self._rows[ends[0]], self._rows[ends[1]])
            self.uncounted += [
                f"{link}: {task}" for link, task in ends if (link, task) not in self._rows
            ]
        told = self._rows.get(("truth", "bench"))
        if told is not None:
            logged = LinkCount(delivered=self._recorder.counts.get("truth", 0))
            rows["truth"] = merge_counts(told, logged)
        return rows


def channel_ports(host: str, base_port: int) -> dict[str, int]:
    """A port for each data channel: counted from base_port, or free ones (all different)."""
    if base_port:
        return {name: base_port + BUS_PORTS + i for i, name in enumerate(DATA)}
    return dict(
        zip(
            DATA,
            free_ports(host, [CHANNELS[name].transport is Transport.UDP for name in DATA]),
            strict=True,
        )
    )
