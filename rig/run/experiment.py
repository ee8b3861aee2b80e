"""The path of a run, from the experiment file to the report; everything else is a detail of one of its lines."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec

from comms.clock import stopwatch_s, utc_now
from comms.link import LinkFaults
from planners.problem import Plan
from planners.trajectories.motion import Motion
from rig.run import runs
from rig.run.config import Experiment
from rig.run.job import Job, plan_move, prepare
from rig.run.runtime import bench
from rig.run.runtime.execute import ClockMode, Progress, RunOutcome, execute


class Ran(NamedTuple):
    """What is left of a run: its folder, how it ended, and its loss-free twin's folder when links lost packets."""

    folder: Path
    outcome: RunOutcome
    twin: Path | None


def run(
    experiment: Experiment,
    mode: ClockMode,
    runs_folder: Path,
    progress: Progress,
    before: Callable[[Job, Plan | None], None],
    motion: Motion | None = None,
) -> Ran:
    """Plan, check, show, run and record. before sees the job when nothing has moved yet.

    Raises ConfigError or Refused when the run must not start; the folder exists only once it may.
    """
    plan = plan_move(experiment, stopwatch_s)  # belief -> motion
    job = prepare(
        experiment, plan, bench.plant(experiment), motion
    )  # limits, workspace, envelope; what each task is told
    before(job, plan)
    folder = runs.new_folder(runs_folder, experiment.experiment.name, mode, utc_now())
    outcome = execute(job, mode, folder, progress)  # streamer, controller, bench, vision, recorder
    return Ran(folder, outcome, _twin(job, folder, progress) if outcome.exit_code == 0 else None)


def _twin(job: Job, folder: Path, progress: Progress) -> Path | None:
    """The same run in virtual time with every link whole, for comparison; None when no link loses anything."""
    links = job.experiment.links
    if not any(faults.loss for faults in links.values()):
        return None
    whole: dict[str, LinkFaults] = {
        name: msgspec.structs.replace(faults, loss=0.0) for name, faults in links.items()
    }
    twin = folder / "twin"
    twin.mkdir()
    execute(
        msgspec.structs.replace(
            job, experiment=msgspec.structs.replace(job.experiment, links=whole)
        ),
        "virtual",
        twin,
        progress,
    )
    return twin
