"""`rig run`: plan, run, watch, log, analyse, report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from comms.clock import stopwatch_s
from comms.link import LinkFaults
from planners.problem import Plan
from rig.analysis.analyze import RunAnalysis
from rig.analysis.summary import Summary
from rig.errors import STOPPED, ConfigError, Stopped
from rig.run import config, experiment
from rig.run.job import Job, plan_move
from rig.run.runs import LOG
from rig.run.tasks.operator import Operator
from rig.ui.cli.output import err, out, print_json, print_summary

RUNS = Path("runs")


def run(
    name: Annotated[
        str, typer.Argument(metavar="[EXPERIMENT]", help="Shipped experiment or TOML file.")
    ] = "move",
    virtual: Annotated[
        bool, typer.Option("--virtual", help="In virtual time: one process, as fast as it goes.")
    ] = False,
    seed: Annotated[int | None, typer.Option(help="Seed of noise, loss and jitter.")] = None,
    planner: Annotated[
        str | None, typer.Option(help="Planner, or several with commas: one run each.")
    ] = None,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", help="section.key=value, again and again.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
    runs: Annotated[Path, typer.Option(help="Where run folders go.")] = RUNS,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html.")] = True,
) -> int:
    """Run an experiment: plan, show, move, watch, log, analyse, report."""
    changes = [*(overrides or []), *([f"experiment.seed={seed}"] if seed is not None else [])]
    planners = [one.strip() for one in planner.split(",") if one.strip()] if planner else [None]
    chosen = [
        config.read_experiment(name, [*changes, *([f"experiment.planner={one}"] if one else [])])
        for one in planners
    ]
    if planner and chosen[0].move.waypoints:
        raise ConfigError(
            f"--planner {planner} with [move] waypoints; the points are passed by [move] spline: leave it out"
        )
    for experiment_file in chosen:  # all must be plannable before the first one moves
        plan_move(experiment_file)
    summaries: list[Summary] = []
    for experiment_file in chosen:
        summaries.append(
            _run_one(experiment_file, "virtual" if virtual else "wall", runs, as_json, report)
        )
        if summaries[-1].exit_code in (3, 4, 5):
            break
    if as_json:
        print_json(summaries[0] if len(planners) == 1 else {"runs": summaries})
    elif len(summaries) > 1:
        out.print(_comparison(summaries))
    return max((s.exit_code for s in summaries), default=0)


def _run_one(
    chosen: config.Experiment, mode: str, runs: Path, quiet: bool, report: bool
) -> Summary:
    began = stopwatch_s()
    bar = Progress(
        TextColumn("{task.description:12}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"), TimeRemainingColumn(),
        console=err, disable=quiet, transient=True, refresh_per_second=2,
    )  # fmt: skip
    with bar:
        line = bar.add_task("connecting", total=None)

        def progress(t_ns: int, operator: Operator) -> None:
            if operator.t_start_ns is not None and operator.t_end_ns is not None:
                total = (operator.t_end_ns - operator.t_start_ns) * 1e-9
                done = min(total, max(0.0, (t_ns - operator.t_start_ns) * 1e-9))
                bar.update(line, description=_stage(done, chosen), completed=done, total=total)

        def before(job: Job, plan: Plan | None) -> None:
            if not quiet:
                err.print(_announcement(job, plan, mode, stopwatch_s() - began))

        ran = experiment.run(
            chosen, "virtual" if mode == "virtual" else "wall", runs, progress, before
        )
    try:
        return _tell(ran, quiet, report, stopwatch_s() - began)
    except KeyboardInterrupt:
        raise Stopped(
            f"stopped while analysing; the log is kept: rig analyze {ran.folder}", STOPPED
        ) from None


def _tell(ran: experiment.FinishedRun, quiet: bool, report: bool, run_s: float) -> Summary:
    """Analyse, report and print what was run."""
    ended = stopwatch_s()
    analysis = RunAnalysis(ran.folder / LOG)
    analysed = stopwatch_s()
    if report:
        from rig.ui.report import write

        write(ran.folder, analysis, RunAnalysis(ran.twin / LOG) if ran.twin else None)
    if not quiet:
        print_summary(analysis.summary)
        simulated = analysis.run.plan.duration_s
        out.print(
            f"run {run_s:.2f} s (loop {ran.outcome.loop_s:.2f} s for {simulated:.1f} s of rig: "
            f"{simulated / ran.outcome.loop_s:.1f} x real time), analysis {analysed - ended:.2f} s, "
            f"report {stopwatch_s() - analysed:.2f} s"
        )
        out.print(f"{ran.folder}  run.mcap" + ("  report.html" if report else ""), style="bold")
    return analysis.summary


def _stage(done_s: float, e: config.Experiment) -> str:
    if not e.has_move:
        return "watching"
    if done_s < e.experiment.quiet_s:
        return "quiet"
    return "moving" if done_s < e.experiment.quiet_s + e.move.time_s else "watching"


def _announcement(job: Job, plan: Plan | None, mode: str, plan_s: float) -> Table:
    """One screen before anything moves."""
    e, table = (
        job.experiment,
        Table(
            show_header=False,
            title=f"about to run: {job.experiment.experiment.name}",
            title_justify="left",
        ),
    )
    clock = (
        "real time, five processes, UDP and ZeroMQ"
        if mode == "wall"
        else "virtual time, one process"
    )
    table.add_row("mode", f"{clock}; seed {e.experiment.seed}")
    if plan is not None:
        m = plan.metrics
        table.add_row("plan", _said(plan))
        table.add_row(
            "believes", f"cable {e.model.cable_m:g} m, damping ratio {e.model.damping_ratio:g}"
        )
        table.add_row(
            "asks for",
            f"{m.peak_speed_m_s:.3f} m/s (limit {e.limits.speed_m_s:g}), "
            f"{m.peak_acceleration_m_s2:.2f} m/s² (limit {e.limits.acceleration_m_s2:g})",
        )
        table.add_row(
            "promises",
            f"peak swing {m.peak_swing_rad * 1e3:.1f} mrad, residual {m.residual_swing_nonlinear_rad * 1e3:.2f} mrad",
        )
    else:
        table.add_row("plan", "nothing moves" if job.plan.time_s == 0 else "from point to point")
    table.add_row(
        "time",
        f"{job.plan.quiet_s:g} s quiet, {job.plan.time_s:g} s move, {job.plan.watch_s:g} s watching",
    )
    links = [f"{name} ({_faults(f)})" for name, f in e.links.items()]
    table.add_row("links", ", ".join(links) or "as they are")
    table.add_row("calibration", job.calibration_name if e.camera.rate_hz else "no camera")
    return table


def _faults(f: LinkFaults) -> str:
    words = [f"{f.delay_ms:g} ms"] if f.delay_ms else []
    words += [f"+ up to {f.jitter_ms:g} ms"] if f.jitter_ms else []
    words += [f"{f.loss:.0%} lost in bursts of {f.burst}"] if f.loss else []
    return ", ".join(words) or "whole"


def _comparison(summaries: list[Summary]) -> Table:
    table = Table(title="planners compared: residual swing, mrad", title_justify="left")
    for name in ("planner", "planned", "measured", "true", "verdict"):
        table.add_column(name, justify="left" if name == "planner" else "right")
    for s in summaries:
        values = (
            s.planned.residual_swing_rad,
            s.measured.residual_swing_rad,
            s.truth.residual_swing_rad if s.truth else None,
        )
        table.add_row(
            s.planner, *("-" if v is None else f"{v * 1e3:.3f}" for v in values), s.verdict
        )
    return table


def _said(plan: Plan) -> str:
    """What was asked of the planner, in a line."""
    p = plan.problem
    words = [
        f"{plan.planner}: {p.distance_m:g} m along {p.axis} in {p.time_s:g} s",
        f"{p.input} input",
    ]
    words += [f"robust to {', '.join(p.robust)}"] if p.robust else []
    words += ["nonlinear"] if p.nonlinear else []
    return ", ".join(words)
