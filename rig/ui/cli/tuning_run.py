"""One run of a tuning: progress under a title, and the analysis of its log."""

from __future__ import annotations

from pathlib import Path

from rig.analysis.analyze import RunAnalysis
from rig.run import experiment
from rig.run.config import Experiment
from rig.run.runs import LOG
from rig.run.runtime.execute import ClockMode
from rig.run.tasks.operator import Operator
from rig.ui.cli.output import counting


def run_titled(
    title: str, chosen: Experiment, mode: ClockMode, runs: Path, quiet: bool
) -> RunAnalysis:
    """Run an experiment and analyse its log; raises the errors of a run."""
    what = f"{title}: {chosen.experiment.planner}"
    with counting(what, 100, quiet=quiet) as tell:

        def progress(t_ns: int, operator: Operator) -> None:
            start_ns, end_ns = operator.t_start_ns, operator.t_end_ns
            if start_ns is not None and end_ns is not None:
                share = (t_ns - start_ns) / max(end_ns - start_ns, 1)
                tell(round(100.0 * min(max(share, 0.0), 1.0)))

        command = f"rig tune ({title})"
        ran = experiment.run(chosen, mode, runs, progress, lambda job, plan: None, command=command)
    return RunAnalysis(ran.folder / LOG)
