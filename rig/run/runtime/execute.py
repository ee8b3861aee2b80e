"""Execution of one run, in virtual time or on the wall clock, recorded from its first instant."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple

import msgspec

from comms import bus_folder
from comms.channels import MS, VISION_TASKS
from comms.clock import MonotonicClock, epoch_now_ns, new_run_clock, stopwatch_s, utc_now
from comms.endpoints import choose_ports, endpoints
from comms.errors import CommsError
from comms.link import LinkCount
from comms.task import Task
from rig.errors import EXIT_STATUS, FAULT, REFUSED, RigError, RunFailed
from rig.run import operator_file, runs
from rig.run.job import Job
from rig.run.node_settings import NodeSettings
from rig.run.recorder import Recorder
from rig.run.run_metadata import start_metadata
from rig.run.runtime import bench
from rig.run.runtime.interrupts import Interrupts
from rig.run.runtime.processes import ProcessRunner
from rig.run.runtime.virtual import VirtualRunner
from rig.run.tasks.controller.task import ControllerTask
from rig.run.tasks.drive.task import DriveTask
from rig.run.tasks.operator import Operator
from rig.run.tasks.streamer import Streamer

ClockMode = Literal["wall", "virtual"]
Progress = Callable[[int, Operator], None]  # run clock [ns]; called often


class RunOutcome(NamedTuple):
    """End of a run; loop_s: wall time from the start of the first task to the end of the last."""

    exit_code: int
    reasons: list[str]
    digest: str | None
    loop_s: float


def execute(job: Job, mode: ClockMode, folder: Path, progress: Progress) -> RunOutcome:
    """Run a job and leave run.mcap in folder; the log is closed whatever happens.

    Raises what kept the run from starting, and RunFailed for an error of the system during the run.
    """
    duration_ns = round(job.plan.duration_s * 1e9)
    operator = Operator(list(job.settings), duration_ns, job.stop_ns)
    clock = new_run_clock()
    recorder = Recorder(
        folder / runs.LOG,
        start_metadata(job, mode, folder.name),
        job.attachments(),
        epoch_now_ns(),
    )
    ended = _Ended()
    began_s = stopwatch_s()
    try:
        with Interrupts() as interrupts:
            if mode == "virtual":
                _run_virtual(job, operator, recorder, progress, interrupts, ended)
            else:
                _run_wall(job, operator, recorder, progress, interrupts, clock, folder, ended)
            ended.code, ended.reasons = operator.exit_code, operator.reasons
    except (RigError, CommsError) as error:
        ended.code, ended.reasons = _exit_code(error), [str(error)]
        raise
    except OSError as error:
        ended.reasons = [f"the run broke off, the robot was stopped: {error}"]
        raise RunFailed(ended.reasons[0]) from error
    finally:
        ended.loop_s = stopwatch_s() - began_s
        _close(recorder, ended)
    return RunOutcome(ended.code, ended.reasons, ended.notes.get("digest"), ended.loop_s)


class _Ended:
    """State of a run at the close of its log."""

    def __init__(self) -> None:
        self.code = FAULT
        self.reasons = ["the run was cut off"]
        self.counts: dict[str, LinkCount] = {}
        self.notes: dict[str, str] = {}
        self.end_ns = 0
        self.loop_s = 0.0


def _close(recorder: Recorder, ended: _Ended) -> None:
    """Write ledger and stop metadata; where the disk is full, what is on it stays readable."""
    stop = ended.notes | {
        "exit_status": EXIT_STATUS[ended.code],
        "exit_code": str(ended.code),
        "reasons": "\n".join(ended.reasons),
        "loop_s": f"{ended.loop_s:.4f}",
        "utc": utc_now().isoformat(),
    }
    try:
        recorder.close(ended.counts, stop, ended.end_ns)
    except OSError as error:
        ended.reasons.append(
            f"the end of the log could not be written: {error}; make room on the disk"
        )
        ended.code = ended.code or FAULT


def _exit_code(error: Exception) -> int:
    return error.exit_code if isinstance(error, RigError) else REFUSED


def _run_virtual(
    job: Job,
    operator: Operator,
    recorder: Recorder,
    progress: Progress,
    interrupts: Interrupts,
    ended: _Ended,
) -> None:
    e = job.experiment
    runner = VirtualRunner(
        tasks=[make_task(name, settings) for name, settings in job.settings.items()],
        operator=operator,
        faults=e.links,
        seed=e.experiment.seed,
        recorder=recorder,
        pictures_hz=e.record.pictures_hz,
        interrupts=interrupts,
        progress=lambda t_ns: progress(t_ns, operator),
    )
    ended.counts = runner.run()
    ended.end_ns = runner.t_ns
    ended.notes = {"digest": runner.digest}


def make_task(name: str, settings: Any) -> Task:
    """Build the task of that name in this process."""
    if name == "bench":
        return _make_bench(settings)
    if name == "drive":
        return DriveTask(settings)
    if name in VISION_TASKS:
        from vision.task import VisionTask

        return VisionTask(settings)
    return ControllerTask(settings) if name == "controller" else Streamer(settings)


def _make_bench(settings: Any) -> Task:
    if isinstance(settings, NodeSettings):
        from rig.run.runtime import drive_node

        return drive_node.task(settings)
    return bench.task(settings)


def _can(job: Job) -> dict[str, Any]:
    """Choose the field bus of a run with a drive; {} without one."""
    if "drive" not in job.settings:
        return {}
    from comms.can_bus import CanSettings, chosen

    can = job.experiment.can
    settings = CanSettings(interface=can.interface, channel=can.channel, bitrate=can.bitrate)
    return dict(msgspec.to_builtins(chosen(settings)))


def _run_wall(
    job: Job,
    operator: Operator,
    recorder: Recorder,
    progress: Progress,
    interrupts: Interrupts,
    clock: MonotonicClock,
    folder: Path,
    ended: _Ended,
) -> None:
    e = job.experiment
    runner = ProcessRunner(
        job.settings, operator, clock, recorder, interrupts, lambda t: progress(t, operator), folder
    )
    host = e.network.bind
    operator_file.remove_stale(folder.parent)
    try:
        with bus_folder.opened(e.network.bus == "ipc") as sockets:
            ended.counts = runner.run(
                host,
                endpoints(host, choose_ports(host, e.network.base_port), sockets, _can(job)),
                e.experiment.seed,
                dict(e.links),
                e.record.pictures_hz,
                round(e.safety.operator_silent_ms * MS),
                job.stop_ns,
            )
    finally:
        ended.end_ns = clock.now_ns()
    cpu = runner.cpu_share.items()
    ended.notes = {
        "cpu_share": " ".join(f"{name}={share:.4f}" for name, share in cpu),
        "scheduling": " ".join(f"{name}={policy}" for name, policy in runner.scheduling.items()),
        "uncounted": "\n".join(runner.uncounted),
    }
