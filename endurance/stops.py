"""Stop orders past the operator, in virtual time, while every link loses packets.

Usage: `python -m endurance.stops [--runs N] [--short]`. In each run 30 % of the packets of every
data channel are lost, and 30 % of the stop datagrams, which `rig stop` repeats every 100 ms.
Measures the time from the first datagram that arrives to the phase in the robot state that the
controller sends. Ends with exit code 1 where an order was lost or took more than two ticks.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import msgspec

from comms.channels import DATA, MS
from comms.link import LinkFaults, LinkModel
from comms.messages import Command, Message, Phase, RobotState, Verb
from comms.stop_order import stop_order
from comms.stop_port import REQUESTS
from comms.task import Step, Task
from rig.analysis.run_log import RunLog
from rig.run import config
from rig.run.job import Job, plan_move, prepare
from rig.run.recorder import Recorder
from rig.run.run_metadata import start_metadata
from rig.run.runs import LOG
from rig.run.runtime import bench
from rig.run.runtime.execute import make_task
from rig.run.runtime.interrupts import Interrupts
from rig.run.runtime.virtual import VirtualRunner
from rig.run.tasks.operator import Operator

RUNS, SHORT_RUNS = 1000, 20
TICK_NS = 5 * MS
REPEAT_NS = 100 * MS
LOSS = 0.3
STOP_PORT_ID = 100  # of the random numbers of its losses
FIRST_NS, LAST_NS = 700 * MS, 3_600 * MS  # of the first datagram: before, in and after the move
CHANGES = [
    "camera.rate_hz=0",
    "experiment.quiet_s=0.5",
    "experiment.watch_s=0.5",
    "safety.robot_stale_ms=1000",
    "safety.reference_stale_ms=1000",
]


class Stopped(NamedTuple):
    """What a stop order did."""

    moving: bool
    arrived_ns: (
        int | None
    )  # first datagram at either port that was not lost; None: the run ended before
    phase_ns: int | None  # first robot state in STOPPED


class AtStopPort:
    """Task behind a stop port that loses datagrams."""

    def __init__(self, task: Task, first_ns: int, verb: Verb, seed: int) -> None:
        self.name = task.name
        self.arrived_ns: int | None = None
        self._task = task
        self._verb = verb
        self._link = LinkModel(LinkFaults(loss=LOSS), seed, STOP_PORT_ID + len(task.name))
        self._datagram = 0
        self._datagram_ns = first_ns
        self._wake_ns: int | None = None

    @property
    def late_ticks(self) -> int:
        """Late ticks of the task."""
        return self._task.late_ticks

    def start(self, t_ns: int) -> Step:
        """Start the task."""
        return self._step(self._task.start(t_ns))

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Give the task a message."""
        return self._step(self._task.on_message(channel, message, t_ns))

    def on_tick(self, t_ns: int) -> Step:
        """Serve the datagram or the tick that is due."""
        if t_ns >= self._datagram_ns:
            return self._step(self._take_datagram(t_ns))
        self._wake_ns = None
        return self._step(self._task.on_tick(t_ns))

    def stop(self, t_ns: int) -> Step:
        """Stop the task."""
        return self._task.stop(t_ns)

    def _take_datagram(self, t_ns: int) -> Step:
        is_lost = self._link.delay_ns(self._datagram) is None
        self._datagram += 1
        self._datagram_ns += REPEAT_NS
        if is_lost or self.arrived_ns is not None:  # a repeated order has no effect
            return Step()
        self.arrived_ns = t_ns
        code = REQUESTS[self._verb.value]
        return stop_order(self._task, self._verb, "at the stop port", code, t_ns)

    def _step(self, step: Step) -> Step:
        if step.wake_ns is not None:
            self._wake_ns = step.wake_ns
        due_ns = self._datagram_ns
        if self._wake_ns is not None:
            due_ns = min(due_ns, self._wake_ns)
        return step._replace(wake_ns=due_ns)


def prepared(seed: int) -> Job:
    """Job of a move in which every data channel loses packets."""
    lossy = LinkFaults(loss=LOSS)
    experiment = config.read_experiment("move", [*CHANGES, f"experiment.seed={seed}"])
    experiment = msgspec.structs.replace(experiment, links=dict.fromkeys(DATA, lossy))
    return prepare(experiment, plan_move(experiment), bench.plant(experiment))


def stop_once(seed: int, folder: Path) -> Stopped:
    """Run, order a stop past the operator at an instant given by the seed, and read the log."""
    job = prepared(seed)
    first_ns = FIRST_NS + seed * 7_919_000 % (LAST_NS - FIRST_NS)
    verb = (Verb.STOP, Verb.ESTOP)[seed % 2]
    ported = [
        AtStopPort(make_task(name, job.settings[name]), first_ns, verb, seed)
        for name in ("controller", "streamer")
    ]
    others = [make_task(name, job.settings[name]) for name in ("bench", "vision")]
    operator = Operator(list(job.settings), round(job.plan.duration_s * 1e9), 300 * MS)
    recorder = Recorder(folder / LOG, start_metadata(job, "virtual", "stops"), job.attachments(), 0)
    with Interrupts() as interrupts:
        runner = VirtualRunner(
            tasks=[*others, *ported],
            operator=operator,
            faults=job.experiment.links,
            seed=seed,
            recorder=recorder,
            pictures_hz=0.0,
            interrupts=interrupts,
            progress=lambda t_ns: None,
        )
        recorder.close(runner.run(), {"exit_status": "stopped"}, runner.t_ns)
    arrivals = [task.arrived_ns for task in ported if task.arrived_ns is not None]
    return _judge(folder, min(arrivals, default=None))


def _judge(folder: Path, arrived_ns: int | None) -> Stopped:
    run = RunLog.open(folder / LOG)
    states = run.log.read("/robot_state", RobotState)
    stops = [s.t_ns for s in states if s.phase in (Phase.STOPPED, Phase.FAULT)]
    phase_ns = None
    if arrived_ns is not None:
        phase_ns = next((t_ns for t_ns in stops if t_ns >= arrived_ns), None)
    start_s = run.t_move_s
    moving = arrived_ns is not None and start_s < arrived_ns * 1e-9 < start_s + run.plan.time_s
    orders = [c for c in run.log.read("/command", Command) if c.verb is Verb.CLOSE]
    if arrived_ns is not None and orders and orders[0].t_ns < arrived_ns:
        arrived_ns = None  # the run was over
    return Stopped(moving, arrived_ns, phase_ns)


def main() -> int:
    """Run all seeds; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--short", action="store_true")
    chosen = parser.parse_args()
    runs = SHORT_RUNS if chosen.short else chosen.runs
    ticks: Counter[str] = Counter()
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(1, runs + 1):
            found = stop_once(seed, Path(folder))
            if found.arrived_ns is None:
                ticks["after the run"] += 1
            elif found.phase_ns is None:
                ticks["lost"] += 1
                failed += 1
            else:
                late_ns = found.phase_ns - found.arrived_ns
                ticks[f"{'moving' if found.moving else 'still'}, {late_ns / TICK_NS:.1f}"] += 1
                failed += late_ns > 2 * TICK_NS
    print(f"{runs} runs, {failed} failed; ticks from datagram to phase: {dict(ticks)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
