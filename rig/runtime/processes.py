"""The wall clock: one process a task, the operator as a fifth. The one table of processes."""

from __future__ import annotations

import os
import secrets
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, Any, NamedTuple

import msgspec
import zmq

from comms.channels import CHANNELS, DATA
from comms.clock import MonotonicClock, cpu_of_s
from comms.codec import decode
from comms.frames import with_pixels
from comms.link import LinkCount, LinkFaults, settle
from comms.messages import Command, Frame, Message, Reply
from comms.operator_bus import Hello, OperatorBus, Record, Tapped
from comms.priority import scheduling_of
from comms.records import LinkRow
from comms.runner import ADMISSION_NS, Wiring
from comms.task import Step
from comms.udp import free_port
from rig.errors import FAULT, REFUSED, STOPPED, Refused
from rig.operator import Operator, Stage
from rig.recorder import Recorder
from rig.runtime.interrupts import Interrupts


class Process(NamedTuple):
    """One row of the table: what is run, and the real-time priority asked for, ordered as in the source's controller."""

    module: str
    priority: int


PROCESSES = {
    "bench": Process("sim_rig", 25),
    "controller": Process("rig.controller", 30),
    "vision": Process("vision", 10),
    "streamer": Process("rig.streamer", 20),
}
BUS_PORTS = 3  # base_port .. base_port + 2 are the operator's, the channels follow
HEARTBEAT_NS = 500_000_000
LOOK_MS = 20  # longest wait for words, interrupts and the clock
GLANCE_NS = 100_000_000  # between glances at children, disk and screen
LEAVE_NS = 3_000_000_000  # for children to drain and report after the close order
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


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
        """settings: task name -> what it is told; folder receives each task's own words (stderr)."""
        self._settings, self._operator, self._clock = settings, operator, clock
        self._recorder, self._interrupts, self._progress = recorder, interrupts, progress
        self._folder = folder
        self._session = secrets.randbits(63)
        self._children: dict[str, subprocess.Popen[bytes]] = {}
        self._present: set[str] = set()  # tasks whose sockets are open
        self._gone: set[str] = set()
        self._heard = 0  # interrupts acted on
        self._logged = 0  # operator's events written
        self._rows: dict[tuple[str, str], LinkCount] = {}
        self._wake_ns: int | None = 0
        self.scheduling: dict[str, str] = {}  # what each task got of the real-time place it asked for
        self.cpu_share: dict[str, float] = {}  # of one core, from the first heartbeat to the close order
        self._beat_ns = self._glance_ns = 0

    def run(
        self, host: str, base_port: int, seed: int, faults: dict[str, LinkFaults], pictures_hz: float
    ) -> dict[str, LinkCount]:
        """Until every task has left; returns the settled ledger. Raises PortInUse before anything starts."""
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._bus = OperatorBus(context, host, base_port)
        try:
            wiring = Wiring(
                session=self._session,
                seed=seed,
                zero_ns=self._clock.zero_ns,
                host=host,
                ports=_ports(host, base_port),
                commands=self._bus.commands,
                taps=self._bus.taps,
                pictures=self._bus.pictures,
                faults=faults,
                pictures_hz=pictures_hz,
            )
            self._announce()
            self._spawn(wiring)
            self._admit()
            began_ns, used_s = self._clock.now_ns(), self._cpu_s()
            self._carry_out(self._operator.start(began_ns))
            while self._operator.stage is not Stage.CLOSED:
                self._look()
            span_s = (self._clock.now_ns() - began_ns) * 1e-9
            self.scheduling = {name: scheduling_of(child.pid) for name, child in self._children.items()}
            self.cpu_share = {name: (used - used_s[name]) / span_s for name, used in self._cpu_s().items()}
            self._let_leave()
        finally:
            self._end_children()
            (self._folder / "operator.json").unlink(missing_ok=True)
            self._bus.close()
            context.term()
        return self._settle()

    def _cpu_s(self) -> dict[str, float]:
        own = {"operator": cpu_of_s(os.getpid())}
        return own | {name: cpu_of_s(child.pid) for name, child in self._children.items()}

    def _announce(self) -> None:
        """Where `rig stop` finds this run."""
        word = {"address": self._bus.commands, "pid": os.getpid()}
        (self._folder / "operator.json").write_bytes(msgspec.json.encode(word))

    def _spawn(self, wiring: Wiring) -> None:
        for name, settings in self._settings.items():
            words: IO[bytes] = (self._folder / f"{name}.log").open("wb")
            with words:
                child = subprocess.Popen(
                    [sys.executable, "-P", "-m", PROCESSES[name].module],
                    stdin=subprocess.PIPE,
                    stderr=words,
                    env=os.environ | ONE_THREAD,
                )
            self._children[name] = child
            assert child.stdin is not None
            own = msgspec.structs.replace(wiring, priority=PROCESSES[name].priority)
            child.stdin.write(msgspec.json.encode({"wiring": own, "settings": settings}))
            child.stdin.close()

    def _admit(self) -> None:
        """Begin when every task's sockets are open: the first heartbeat starts them all."""
        until = self._clock.now_ns() + ADMISSION_NS
        while self._present != set(self._children):
            self._bus.wait(LOOK_MS)
            self._hear()
            self._miss_the_dead(self._clock.now_ns())
            if self._interrupts.count or self._gone or self._clock.now_ns() > until:
                return

    def _look(self) -> None:
        now = self._clock.now_ns()
        due_ms = LOOK_MS if self._wake_ns is None else max(0, min(LOOK_MS, (self._wake_ns - now) // 1_000_000))
        self._bus.wait(due_ms)
        self._hear()
        now = self._clock.now_ns()
        if self._wake_ns is not None and now >= self._wake_ns:
            self._wake_ns = None
            self._carry_out(self._operator.on_tick(now))
        self._heed_interrupts(now)
        if now >= self._glance_ns:
            self._glance_ns = now + GLANCE_NS
            self._beat(now)
            self._miss_the_dead(now)
            self._recorder.tick(now)
            self._progress(now)

    def _hear(self) -> None:
        for who, said in self._bus.drain():
            now = self._clock.now_ns()
            if isinstance(said, Hello):
                self._present.add(who.decode())
            elif isinstance(said, Reply):
                self._recorder.message("reply", said, now)
                self._carry_out(self._operator.on_message("reply", said, now))
            elif isinstance(said, Tapped):
                self._log(said, now)
            elif isinstance(said, Record):
                self._keep(who.decode(), said, now)
            else:
                self._serve(who, said, now)

    def _log(self, tapped: Tapped, now: int) -> None:
        message = decode(tapped.channel, tapped.data, self._session)
        if isinstance(message, Frame) and tapped.pixels is not None:
            frame = with_pixels(message, memoryview(tapped.pixels))
            if isinstance(frame, Frame):
                self._recorder.picture(frame, now)
        elif isinstance(message, Message):
            self._recorder.message(tapped.channel, message, now)

    def _keep(self, who: str, said: Record, now: int) -> None:
        if isinstance(said.record, LinkRow):
            self._rows[said.record.channel, who] = said.record.count
        else:
            self._recorder.record(said.record, now)

    def _serve(self, who: bytes, request: str, now: int) -> None:
        """A second terminal: `stop` or `estop`; anything else is told what is understood."""
        if request in ("stop", "estop"):
            code = STOPPED if request == "stop" else FAULT
            self._carry_out(self._operator.end(f"{request} from another terminal", code, now))
            self._bus.answer(who, f"stopping, was {self._operator.stage.value}")
        else:
            self._bus.answer(who, "understood are: stop, estop")

    def _carry_out(self, step: Step) -> None:
        if step.wake_ns is not None:
            self._wake_ns = step.wake_ns
        for _, message, _ in step.sends:
            if isinstance(message, Command):
                self._recorder.message("command", message, message.t_ns)
                self._bus.send(message)
        for event in self._operator.events[self._logged :]:
            self._recorder.record(event, event.t_ns)
        self._logged = len(self._operator.events)

    def _beat(self, now: int) -> None:
        if now >= self._beat_ns:
            self._beat_ns = now + HEARTBEAT_NS
            for name in self._children:
                self._bus.heartbeat(name)

    def _heed_interrupts(self, now: int) -> None:
        if self._interrupts.count >= 2:
            self._carry_out(self._operator.stop_now("stopped at once by the operator (second Ctrl-C)", STOPPED, now))
        elif self._interrupts.count > self._heard:
            self._carry_out(self._operator.end("stopped by the operator (Ctrl-C)", STOPPED, now))
        self._heard = self._interrupts.count

    def _miss_the_dead(self, now: int) -> None:
        if self._operator.stage is Stage.CLOSED:
            return
        for name, child in self._children.items():
            code = child.poll()
            if code is not None and name not in self._gone:
                self._gone.add(name)
                words = self._last_words(name)
                if code == REFUSED:
                    raise Refused(words)
                how = f"signal {-code}" if code < 0 else f"exit code {code}"
                self._carry_out(self._operator.lost(name, f"task '{name}' died ({how}): {words}", now))

    def _last_words(self, name: str) -> str:
        lines = (self._folder / f"{name}.log").read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else "it said nothing"

    def _let_leave(self) -> None:
        until = self._clock.now_ns() + LEAVE_NS
        while self._clock.now_ns() < until and any(child.poll() is None for child in self._children.values()):
            self._bus.wait(LOOK_MS)
            self._hear()
        self._hear()

    def _end_children(self) -> None:
        """Only our own, and only those that did not leave by themselves."""
        for name, child in self._children.items():
            if child.poll() is None:
                child.kill()
            child.wait()
            words = self._folder / f"{name}.log"
            if words.stat().st_size == 0:
                words.unlink()

    def _settle(self) -> dict[str, LinkCount]:
        rows = {}
        for name in DATA:
            sender, receiver = CHANNELS[name].sender, CHANNELS[name].receiver
            if sender in self._settings and receiver in self._settings:
                rows[name] = settle(self._rows.get((name, sender), LinkCount()), self._rows.get((name, receiver), LinkCount()))
        told = self._rows.get(("truth", "bench"), LinkCount())
        rows["truth"] = settle(told, LinkCount(delivered=self._recorder.counts.get("truth", 0)))
        return rows


def _ports(host: str, base_port: int) -> dict[str, int]:
    """A port for each data channel: counted from base_port, or free ones (all different)."""
    if base_port:
        return {name: base_port + BUS_PORTS + i for i, name in enumerate(DATA)}
    ports: dict[str, int] = {}
    while len(set(ports.values())) < len(DATA):
        ports = {name: free_port(host) for name in DATA}
    return ports
