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

from benchmarks.timing import interpreter_line, is_short, timed_s
from comms.clock import stopwatch_s
from comms.task import Step, Task
from rig.run import config
from rig.run.job import Job, plan_move, prepare
from rig.run.recorder import Recorder
from rig.run.runtime import bench
from rig.run.runtime.execute import make_task
from rig.run.runtime.interrupts import Interrupts
from rig.run.runtime.virtual import VirtualRunner
from rig.run.tasks.operator import Operator
from rig.studies.vision.scene import picture_size, read_scene, scene_frames
from sim_rig.imager import Imager
from sim_rig.plain_imager import PlainImager, is_plain
from sim_rig.synthetic import swinging_video
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
    """Median seconds a frame, following and cold, on frames of a load swinging by 0.3 rad."""
    scene = read_scene("clean")
    shown = list(scene_frames(scene, FRAMES))
    assert max(abs(frame.cable_rad) for frame in shown) > 0.29
    frames, pivot = [frame.picture for frame in shown], shown[0].pivot_px
    eye = Tracker(*picture_size(scene))
    following = [timed_s(lambda f=f: eye.measure(f, pivot)) for f in frames]

    def cold(frame: Any) -> None:
        eye.forget()
        eye.measure(frame, pivot)

    return statistics.median(following), statistics.median(
        timed_s(lambda f=f: cold(f)) for f in frames
    )


def rendering(name: str) -> float:
    """Median seconds a picture of a scene, without the motion of the load."""
    plant = read_scene(name).plant
    shown = list(swinging_video(plant, 2.0))
    make = PlainImager if is_plain(plant.cameras[0]) else Imager
    imager = make(plant, 0)
    return statistics.median(
        timed_s(lambda f=f: imager.picture(f.exposure.states, f.t_s, f.number)) for f in shown
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
    for name in ("clean", "everything"):
        seconds = rendering(name)
        print(f"renderer, scene {name}: {seconds * 1e6:.0f} us ({1 / seconds:.0f} frames/s)")
    print(interpreter_line())


if __name__ == "__main__":
    main()
