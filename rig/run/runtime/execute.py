"""One run, in virtual time or on the wall clock, recorded from the first instant; nothing recorded is ever lost."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, NamedTuple

from comms.clock import MonotonicClock, new_run_clock, stopwatch_s, utc_now
from comms.errors import CommsError
from comms.link import LinkCount
from comms.task import Task
from rig.errors import EXIT_STATUS, FAULT, REFUSED, RigError, RunFailed
from rig.run import runs
from rig.run.job import Job
from rig.run.provenance import provenance
from rig.run.recorder import Recorder
from rig.run.runtime import bench
from rig.run.runtime.interrupts import Interrupts
from rig.run.runtime.processes import ProcessRunner
from rig.run.runtime.virtual import VirtualRunner
from rig.run.tasks.controller.task import ControllerTask
from rig.run.tasks.operator import Operator
from rig.run.tasks.streamer import Streamer

ClockMode = Literal["wall", "virtual"]
Progress = Callable[[int, Operator], None]  # run clock [ns]; called often
CODE = Path(__file__).resolve().parents[3]  # folder of the five packages
PACKAGES = ("swayless", "numpy", "scipy", "opencv-python-headless", "pyzmq", "mcap", "msgspec")


class RunOutcome(NamedTuple):
    """How a run ended; loop_s is the wall time from the first task's start to the last one's end."""

    exit_code: int
    reasons: list[str]
    digest: str | None
    loop_s: float


def execute(job: Job, mode: ClockMode, folder: Path, progress: Progress) -> RunOutcome:
    """Run a job and leave run.mcap in folder. Raises what kept it from starting; the log is closed even then."""
    operator = Operator(list(job.settings), round(job.plan.duration_s * 1e9))
    recorder = Recorder(folder / runs.LOG, _start(job, mode, folder), job.attachments())
    stop: dict[str, str] = {}
    rows: dict[str, LinkCount] = {}
    began, end_ns, code, reasons = stopwatch_s(), 0, FAULT, ["the run was cut off"]
    with Interrupts() as interrupts:
        try:
            if mode == "virtual":
                runner = _virtual(job, operator, recorder, progress, interrupts)
                rows, end_ns = runner.run(), runner.t_ns
                stop["digest"] = runner.digest
            else:
                clock = new_run_clock()
                rows, stop = _wall(job, operator, recorder, progress, interrupts, clock, folder)
                end_ns = clock.now_ns()
            code, reasons = operator.exit_code, operator.reasons
        except (RigError, CommsError) as error:
            code, reasons = _exit_code(error), [str(error)]
            raise
        except OSError as error:
            reasons = [f"the run broke off, the robot was stopped: {error}"]
            raise RunFailed(reasons[0]) from error
        finally:
            loop_s = stopwatch_s() - began
            stop |= {
                "exit_status": EXIT_STATUS[code],
                "exit_code": str(code),
                "reasons": "\n".join(reasons),
                "loop_s": f"{loop_s:.4f}",
                "utc": utc_now().isoformat(),
            }
            with suppress(OSError):  # a full disk: what is on it stays readable
                recorder.close(rows, stop, end_ns)
    return RunOutcome(code, reasons, stop.get("digest"), loop_s)


def _exit_code(error: Exception) -> int:
    return error.exit_code if isinstance(error, RigError) else REFUSED


def _virtual(
    job: Job, operator: Operator, recorder: Recorder, progress: Progress, interrupts: Interrupts
) -> VirtualRunner:
    e = job.experiment
    return VirtualRunner(
        tasks=[make_task(name, settings) for name, settings in job.settings.items()],
        operator=operator,
        faults=e.links,
        seed=e.experiment.seed,
        recorder=recorder,
        pictures_hz=e.record.pictures_hz,
        interrupts=interrupts,
        progress=lambda t_ns: progress(t_ns, operator),
    )


def make_task(name: str, settings: Any) -> Task:
    """The task of that name in this process."""
    if name == "bench":
        return bench.task(settings)
    if name == "vision":
        from vision.task import VisionTask

        return VisionTask(settings)
    return ControllerTask(settings) if name == "controller" else Streamer(settings)


def _wall(
    job: Job,
    operator: Operator,
    recorder: Recorder,
    progress: Progress,
    interrupts: Interrupts,
    clock: MonotonicClock,
    folder: Path,
) -> tuple[dict[str, LinkCount], dict[str, str]]:
    """The settled ledger, and what the stop metadata should know."""
    e = job.experiment
    runner = ProcessRunner(
        job.settings, operator, clock, recorder, interrupts, lambda t: progress(t, operator), folder
    )
    rows = runner.run(
        e.network.bind, e.network.base_port, e.experiment.seed, dict(e.links), e.record.pictures_hz
    )
    notes = {
        "cpu_share": " ".join(f"{name}={share:.4f}" for name, share in runner.cpu_share.items()),
        "scheduling": " ".join(f"{name}={policy}" for name, policy in runner.scheduling.items()),
        "uncounted": "\n".join(runner.uncounted),
    }
    return rows, notes


def _start(job: Job, mode: ClockMode, folder: Path) -> dict[str, str]:
    e = job.experiment.experiment
    return {
        "run_id": folder.name,
        "experiment": e.name,
        "kind": e.kind,
        "mode": mode,
        "seed": str(e.seed),
        "purpose": e.purpose,
        "calibration": job.calibration_name,
        "utc": utc_now().isoformat(),
        "clock": "CLOCK_MONOTONIC from the operator's start" if mode == "wall" else "virtual",
        "operator": os.environ.get("USER", "unknown"),
        "host": platform.node(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": " ".join(f"{name}={version(name)}" for name in PACKAGES),
        **provenance(CODE),
    }
