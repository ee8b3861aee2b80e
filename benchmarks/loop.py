"""How fast the virtual loop and the tracker are, and where the time goes: `make bench`.

Medians over repeats. The first line is the speed of the interpreter itself, for machines differ and
share their cores.
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import interpreter_line, is_short, timed_s
from comms.clock import stopwatch_s
from comms.messages import Frame, Truth
from comms.task import Step, Task
from rig.run import config
from rig.run.job import Job, plan_move, prepare
from rig.run.recorder import Recorder
from rig.run.runtime import bench
from rig.run.runtime.execute import make_task
from rig.run.runtime.interrupts import Interrupts
from rig.run.runtime.virtual import VirtualRunner
from rig.run.tasks.operator import Operator
from rig.studies.vision.bench import pivot_px
from vision.tracker import Tracker

REPEATS = 1 if is_short() else 7
FRAMES = 100 if is_short() else 400


class Timed:
    """A task whose calls are timed."""

    def __init__(self, task: Task) -> None:
        self._task, self.name, self.spent_s = task, task.name, 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._task, name)

    def start(self, t_ns: int) -> Step:
        return self._time(self._task.start, t_ns)

    def on_message(self, channel: str, message: Any, t_ns: int) -> Step:
        return self._time(self._task.on_message, channel, message, t_ns)

    def on_tick(self, t_ns: int) -> Step:
        return self._time(self._task.on_tick, t_ns)

    def stop(self, t_ns: int) -> Step:
        return self._time(self._task.stop, t_ns)

    def _time(self, call: Callable[..., Step], *arguments: Any) -> Step:
        began = stopwatch_s()
        step = call(*arguments)
        self.spent_s += stopwatch_s() - began
        return step


class TimedRecorder(Recorder):
    """A recorder whose messages are timed."""

    spent_s = 0.0

    def message(self, *arguments: Any) -> None:
        began = stopwatch_s()
        super().message(*arguments)
        self.spent_s += stopwatch_s() - began

    def picture(self, *arguments: Any) -> None:
        began = stopwatch_s()
        super().picture(*arguments)
        self.spent_s += stopwatch_s() - began


def loop(job: Job, timed: bool) -> tuple[float, dict[str, float]]:
    """Seconds of one virtual loop, and who spent them when asked for."""
    operator = Operator(list(job.settings), round(job.plan.duration_s * 1e9))
    tasks = [make_task(name, settings) for name, settings in job.settings.items()]
    watched = [Timed(task) for task in tasks] if timed else []
    e = job.experiment
    with tempfile.TemporaryDirectory() as folder:
        recorder = (TimedRecorder if timed else Recorder)(
            Path(folder) / "run.mcap", {}, job.attachments(), 0
        )
        runner = VirtualRunner(
            tasks=watched or tasks,
            operator=operator,
            faults=e.links,
            seed=e.experiment.seed,
            recorder=recorder,
            pictures_hz=e.record.pictures_hz,
            interrupts=Interrupts(),
            progress=lambda _: None,
        )
        seconds = timed_s(runner.run)
        recorder.close({}, {}, 0)
    spent = {task.name: task.spent_s for task in watched}
    return seconds, spent | (
        {"log": recorder.spent_s} if isinstance(recorder, TimedRecorder) else {}
    )


def tracker() -> tuple[float, float]:
    """Median seconds a frame, following and cold, on frames of a load swinging by 20 degrees."""
    chosen = config.read_experiment(
        "free_decay", ["bench.pendulum.initial_swing_rad=0.349", "bench.camera.pitch_deg=0"]
    )
    world = bench.task(prepare(chosen, None, bench.plant(chosen)).settings["bench"])
    sends = list(world.start(0).sends)
    for t in range(5, FRAMES * 20, 5):
        sends += world.on_tick(t * 1_000_000).sends
    frames = [s.message.pixels for s in sends if isinstance(s.message, Frame)]
    truths = [s.message.links[0].angle_x_rad for s in sends if isinstance(s.message, Truth)]
    assert len(frames) > FRAMES * 0.9
    assert max(np.abs(truths)) > 0.34
    height, width = frames[0].shape
    eye, pivot = Tracker(width, height), pivot_px(chosen)
    following = [timed_s(lambda f=f: eye.measure(f, pivot)) for f in frames]

    def cold(frame: Any) -> None:
        eye.forget()
        eye.measure(frame, pivot)

    return statistics.median(following), statistics.median(
        timed_s(lambda f=f: cold(f)) for f in frames
    )


def main() -> None:
    """Print all of it."""
    print(interpreter_line())
    for name, changes in (
        ("with camera and log", []),
        ("without camera, with log", ["camera.rate_hz=0"]),
    ):
        chosen = config.read_experiment("move", changes)
        job = prepare(chosen, plan_move(chosen), bench.plant(chosen))
        seconds = statistics.median(loop(job, timed=False)[0] for _ in range(REPEATS))
        whole, spent = loop(job, timed=True)
        rest = whole - sum(spent.values())
        shares = ", ".join(
            f"{who} {part / whole:.0%}"
            for who, part in sorted(spent.items(), key=lambda item: -item[1])
        )
        speed = job.plan.duration_s / seconds
        print(
            f"virtual loop {name}: {seconds * 1e3:.0f} ms for {job.plan.duration_s:g} s of rig: "
            f"{speed:.0f}x real time"
        )
        print(f"    where it goes: {shares}, scheduler, codec and digest {rest / whole:.0%}")
    following, cold = tracker()
    for name, seconds in (("following the cable", following), ("cold, full frame", cold)):
        print(f"tracker, every row, {name}: {seconds * 1e6:.0f} us ({1 / seconds:.0f} frames/s)")
    print(interpreter_line())


if __name__ == "__main__":
    main()
