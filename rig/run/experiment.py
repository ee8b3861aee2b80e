"""The path of a run, from the experiment to the log: plan, check, show, run and record."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec

from comms.clock import stopwatch_s, utc_now
from comms.link import LinkFaults
from planners.errors import PlanError
from planners.problem import Plan
from planners.trajectories.motion import Motion
from rig.errors import ConfigError, Refused
from rig.run import runs
from rig.run.config import Experiment
from rig.run.job import Job, plan_move, prepare
from rig.run.joint_job import prepare_joint
from rig.run.load_model import planner_model
from rig.run.runtime import bench
from rig.run.runtime.execute import ClockMode, Progress, RunOutcome, execute


class FinishedRun(NamedTuple):
    """Folder and outcome of a run.

    twin: folder of the same run without losses, None where no link had any.
    """

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
    command: str = "",
) -> FinishedRun:
    """Plan, check, show, run and record; `before` is called with the job before anything moves.

    motion replaces the plan's. command is the command line that repeats the run, for the log.

    Raises ConfigError or Refused when the run must not start; the folder exists only once it may.
    """
    plan = None
    if experiment.experiment.kind == "joint":
        job = prepare_joint(experiment, bench.plant(experiment))
    else:
        plan = plan_move(experiment, stopwatch_s)  # model of the load -> motion
        # checks of limits, workspace and envelope; settings of each task
        job = prepare(experiment, plan, bench.plant(experiment), motion)
    job = msgspec.structs.replace(job, command=command)
    before(job, plan)
    folder = runs.new_folder(runs_folder, experiment.experiment.name, mode, utc_now())
    outcome = execute(job, mode, folder, progress)  # streamer, controller, bench, vision, recorder
    twin = _run_twin(job, folder, progress) if outcome.exit_code == 0 else None
    return FinishedRun(folder, outcome, twin)


def refusal(experiment: Experiment) -> str:
    """Say why the planner of an experiment cannot run it; empty when it can.

    Raises ConfigError for what no planner could mend: a model, a key.
    """
    planner_model(experiment)
    try:
        prepare(experiment, plan_move(experiment), bench.plant(experiment))
    except Refused as error:
        return str(error)
    except ConfigError as error:
        if isinstance(error.__cause__, PlanError):
            return str(error)
        raise
    return ""


def _run_twin(job: Job, folder: Path, progress: Progress) -> Path | None:
    """Repeat the run in virtual time without losses, for comparison; None where no link has any."""
    links = job.experiment.links
    if not any(faults.loss for faults in links.values()):
        return None
    lossless: dict[str, LinkFaults] = {
        name: msgspec.structs.replace(faults, loss=0.0) for name, faults in links.items()
    }
    experiment = msgspec.structs.replace(job.experiment, links=lossless)
    twin = folder / "twin"
    twin.mkdir()
    execute(msgspec.structs.replace(job, experiment=experiment), "virtual", twin, progress)
    return twin
