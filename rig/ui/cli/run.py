"""`rig run`: run of an experiment, from the plan to the report."""

from __future__ import annotations

import enum
import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from comms.clock import stopwatch_s
from planners.catalog import PLANNERS
from planners.errors import unknown_name
from planners.problem import Plan
from rig.analysis.analyze import RunAnalysis
from rig.analysis.conclusion import conclude
from rig.analysis.summary import Summary
from rig.errors import FAULT, REFUSED, STOPPED, ConfigError, Stopped
from rig.run import config, experiment
from rig.run.job import Job, plan_move
from rig.run.runs import LOG, RUNS
from rig.run.runtime.execute import ClockMode
from rig.run.tasks.operator import Operator
from rig.run.tasks.pause import BUSY_HINT
from rig.ui.cli import completion, planner_comparison
from rig.ui.cli.common_options import AsJson, Overrides
from rig.ui.cli.output import print_conclusion, print_json, print_summary, working
from rig.ui.cli.page import err, print_paragraph, print_table, print_whole
from rig.ui.cli.planner_comparison import NotRun, Result
from rig.ui.cli.run_announcement import announcement
from rig.ui.cli.run_list import list_experiments


class ClockChoice(enum.Enum):
    """Values of --clock."""

    REAL = "real"
    VIRTUAL = "virtual"
    AUTO = "auto"


def run(
    name: Annotated[
        str,
        typer.Argument(
            metavar="[EXPERIMENT]",
            help="Shipped experiment, e.g. move, dropouts or free_decay, or a TOML file.",
            autocompletion=completion.experiments,
        ),
    ] = "move",
    virtual: Annotated[
        bool,
        typer.Option(
            "--virtual", help="Virtual time: one process, faster than real time; --clock virtual."
        ),
    ] = False,
    clock: Annotated[
        ClockChoice | None,
        typer.Option(
            help="Clock of the run: real time, virtual time, or auto: real time where this machine "
            "keeps it (measured in 3 s), else virtual; real by default."
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(help="Seed of noise, loss and jitter; the experiment's by default."),
    ] = None,
    planner: Annotated[
        str | None,
        typer.Option(
            help="Planner, or several separated by commas, one run each; "
            "the experiment's by default.",
            autocompletion=completion.planners,
        ),
    ] = None,
    overrides: Overrides = None,
    as_json: AsJson = False,
    runs: Annotated[Path, typer.Option(help="Folder in which the run folders are created.")] = RUNS,
    report: Annotated[
        bool, typer.Option("--report/--no-report", help="HTML report beside the log.")
    ] = True,
    listing: Annotated[
        bool,
        typer.Option("--list", help="List the shipped experiments with their purpose; run none."),
    ] = False,
) -> int:
    """Plan a move, run it, log it, analyse it and write a report.

    Of several planners, one that cannot run is listed with its reason and the others run. The
    exit code is the highest one of the runs, or 3 when no planner could run.
    """
    if listing:
        return list_experiments(as_json)
    changes = list(overrides or [])
    if seed is not None:
        changes.append(f"experiment.seed={seed}")
    chosen = _experiments(name, changes, planner)
    refusals = _refusals(chosen)
    mode, may_fall_back = _mode(ClockChoice.VIRTUAL if virtual else clock or ClockChoice.REAL)
    results: list[Result] = []
    for experiment_file, refusal in zip(chosen, refusals, strict=True):
        if refusal:
            results.append(NotRun(experiment_file.experiment.planner, refusal))
            continue
        summary = _run_one(experiment_file, mode, runs, as_json, report)
        if may_fall_back and _was_starved(summary):
            err.print("this machine did not keep real time: the run is repeated in virtual time")
            summary = _run_one(experiment_file, "virtual", runs, as_json, report)
        results.append(summary)
        if summary.exit_code in (REFUSED, STOPPED, FAULT):
            break
    if as_json:
        print_json(results[0] if len(chosen) == 1 else planner_comparison.document(results))
    elif len(chosen) > 1:
        print_table(planner_comparison.comparison(results))
    return planner_comparison.exit_code(results)


def _experiments(name: str, changes: list[str], planner: str | None) -> list[config.Experiment]:
    """Read the experiment, once for each planner; raises ConfigError before anything moves."""
    planners = _names(planner)
    for one in planners:
        if one not in PLANNERS:
            raise unknown_name("planner", one, PLANNERS)
    if planner is not None and not planners:
        raise ConfigError(
            f"--planner {planner!r}; must name one or more, separated by commas: "
            "see rig plan --help"
        )
    if planners:
        chosen = [
            config.read_experiment(name, [*changes, f"experiment.planner={one}"])
            for one in planners
        ]
    else:
        chosen = [config.read_experiment(name, changes)]
    if planner and chosen[0].joint is not None:
        raise ConfigError(
            f"--planner {planner} with an experiment of the kind joint, which moves by a trapezoid "
            "of its own; must be without: omit it"
        )
    if planner and chosen[0].move.waypoints:
        raise ConfigError(
            f"--planner {planner} with [move] waypoints; "
            "must be without: [move] spline plans a move through waypoints, omit --planner"
        )
    return chosen


def _refusals(chosen: list[config.Experiment]) -> list[str]:
    """List why each of several planners cannot run, before anything moves; empty when it can.

    A single planner raises ConfigError or Refused by itself when it runs.
    """
    if len(chosen) == 1:
        plan_move(chosen[0])
        return [""]
    return [experiment.refusal(one) for one in chosen]


def _names(text: str | None) -> list[str]:
    words = (word.strip() for word in (text or "").split(","))
    return [word for word in words if word]


def _mode(clock: ClockChoice) -> tuple[ClockMode, bool]:
    """Choose the mode of a run, and whether a starved run is repeated in virtual time."""
    if clock is ClockChoice.VIRTUAL:
        return "virtual", False
    if clock is ClockChoice.REAL:
        return "wall", False
    from rig.run.machine import measure_machine

    with working("measuring the timer of this machine for 3 s"):
        found = measure_machine()
    if found.can_run_in_real_time:
        return "wall", True
    err.print(f"virtual time: {found.reason}")
    return "virtual", False


def _was_starved(summary: Summary) -> bool:
    """Tell whether a run ended in a fault because the machine did not run its processes."""
    return summary.exit_code == FAULT and any(BUSY_HINT in reason for reason in summary.reasons)


def _command() -> str:
    """Command line of this run, as one would type it again."""
    return shlex.join(["rig", *sys.argv[1:]])


def _run_one(
    chosen: config.Experiment, mode: ClockMode, runs: Path, quiet: bool, report: bool
) -> Summary:
    began = stopwatch_s()
    bar = Progress(
        TextColumn("{task.description:12}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
        console=err,
        disable=quiet,
        transient=True,
        refresh_per_second=2,
    )
    with bar:
        line = bar.add_task("connecting", total=None)

        def progress(t_ns: int, operator: Operator) -> None:
            if operator.t_start_ns is not None and operator.t_end_ns is not None:
                total = (operator.t_end_ns - operator.t_start_ns) * 1e-9
                done = min(total, max(0.0, (t_ns - operator.t_start_ns) * 1e-9))
                bar.update(line, description=_phase_name(done, chosen), completed=done, total=total)

        def before(job: Job, plan: Plan | None) -> None:
            if not quiet:
                err.print(announcement(job, plan, mode))

        ran = experiment.run(chosen, mode, runs, progress, before, command=_command())
    try:
        return _show_results(ran, quiet, report, stopwatch_s() - began)
    except KeyboardInterrupt:
        raise Stopped(
            f"stopped during the analysis; the log is complete: rig analyze {ran.folder}", STOPPED
        ) from None


def _show_results(ran: experiment.FinishedRun, quiet: bool, report: bool, run_s: float) -> Summary:
    """Analyse a run, write its report and print its summary."""
    ended = stopwatch_s()
    analysis = RunAnalysis(ran.folder / LOG)
    analysed = stopwatch_s()
    if report:
        from rig.ui.report import write

        write(ran.folder, analysis, RunAnalysis(ran.twin / LOG) if ran.twin else None)
    if not quiet:
        print_summary(analysis.summary)
        print_conclusion(conclude(analysis.run, analysis.summary))
        loop_s = ran.outcome.loop_s
        run_time_s = analysis.run.plan.duration_s
        print_paragraph(
            f"computing time: run {run_s:.2f} s (loop {loop_s:.2f} s for {run_time_s:.1f} s of "
            f"run time: {run_time_s / loop_s:.1f} x real time), "
            f"analysis {analysed - ended:.2f} s, report {stopwatch_s() - analysed:.2f} s",
            indent="  ",
        )
        if ran.outcome.digest:
            print_whole(f"digest {ran.outcome.digest}")
        print_whole(f"{ran.folder}  run.mcap" + ("  report.html" if report else ""), "bold")
    return analysis.summary


def _phase_name(done_s: float, e: config.Experiment) -> str:
    """Name the phase of a run, done_s after its start [s]."""
    move_s = e.joint.move.time_s if e.joint is not None else e.move.time_s
    if not e.has_move:
        return "watching"
    if done_s < e.experiment.quiet_s:
        return "quiet"
    return "moving" if done_s < e.experiment.quiet_s + move_s else "watching"
