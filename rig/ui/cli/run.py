"""`rig run`: run of an experiment, from the plan to the report."""

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
from rig.errors import FAULT, REFUSED, STOPPED, ConfigError, Stopped
from rig.run import config, experiment
from rig.run.job import Job, plan_move
from rig.run.runs import LOG
from rig.run.tasks.operator import Operator
from rig.ui.cli.output import err, out, print_json, print_summary

RUNS = Path("runs")


def run(
    name: Annotated[
        str,
        typer.Argument(
            metavar="[EXPERIMENT]", help="Name of a shipped experiment, or a TOML file."
        ),
    ] = "move",
    virtual: Annotated[
        bool, typer.Option("--virtual", help="Virtual time: one process, faster than real time.")
    ] = False,
    seed: Annotated[
        int | None,
        typer.Option(help="Seed of noise, loss and jitter; the experiment's by default."),
    ] = None,
    planner: Annotated[
        str | None,
        typer.Option(
            help="Planner, or several separated by commas, one run each; "
            "the experiment's by default."
        ),
    ] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", help="New value of a key, section.key=value; repeatable."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
    runs: Annotated[Path, typer.Option(help="Folder in which the run folders are created.")] = RUNS,
    report: Annotated[
        bool, typer.Option("--report/--no-report", help="HTML report beside the log.")
    ] = True,
) -> int:
    """Plan a move, run it, log it, analyse it and write a report."""
    changes = list(overrides or [])
    if seed is not None:
        changes.append(f"experiment.seed={seed}")
    planners = _names(planner)
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
    if planner and chosen[0].move.waypoints:
        raise ConfigError(
            f"--planner {planner} with [move] waypoints; "
            "must be without: [move] spline plans a move through waypoints, omit --planner"
        )
    for experiment_file in chosen:  # a planner that fails is reported before anything moves
        plan_move(experiment_file)
    summaries: list[Summary] = []
    for experiment_file in chosen:
        mode = "virtual" if virtual else "wall"
        summaries.append(_run_one(experiment_file, mode, runs, as_json, report))
        if summaries[-1].exit_code in (REFUSED, STOPPED, FAULT):
            break
    if as_json:
        print_json(summaries[0] if len(chosen) == 1 else {"runs": summaries})
    elif len(summaries) > 1:
        out.print(_comparison(summaries))
    return max((s.exit_code for s in summaries), default=0)


def _names(text: str | None) -> list[str]:
    words = (word.strip() for word in (text or "").split(","))
    return [word for word in words if word]


def _run_one(
    chosen: config.Experiment, mode: str, runs: Path, quiet: bool, report: bool
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
                err.print(_announcement(job, plan, mode, stopwatch_s() - began))

        ran = experiment.run(
            chosen, "virtual" if mode == "virtual" else "wall", runs, progress, before
        )
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
        loop_s = ran.outcome.loop_s
        run_time_s = analysis.run.plan.duration_s
        out.print(
            f"computing time: run {run_s:.2f} s (loop {loop_s:.2f} s for {run_time_s:.1f} s of "
            f"run time: {run_time_s / loop_s:.1f} x real time), "
            f"analysis {analysed - ended:.2f} s, report {stopwatch_s() - analysed:.2f} s"
        )
        out.print(f"{ran.folder}  run.mcap" + ("  report.html" if report else ""), style="bold")
    return analysis.summary


def _phase_name(done_s: float, e: config.Experiment) -> str:
    """Name the phase of a run, done_s after its start [s]."""
    if not e.has_move:
        return "watching"
    if done_s < e.experiment.quiet_s:
        return "quiet"
    return "moving" if done_s < e.experiment.quiet_s + e.move.time_s else "watching"


def _announcement(job: Job, plan: Plan | None, mode: str, plan_s: float) -> Table:
    """Create the table that is shown before anything moves."""
    e = job.experiment
    title = f"about to run: {e.experiment.name}"
    table = Table(show_header=False, title=title, title_justify="left")
    clock = "virtual time, one process"
    if mode == "wall":
        clock = "real time, five processes, UDP and ZeroMQ"
    table.add_row("mode", f"{clock}; seed {e.experiment.seed}")
    if plan is not None:
        m = plan.metrics
        table.add_row("plan", _plan_description(plan))
        table.add_row(
            "model", f"cable {e.model.cable_m:g} m, damping ratio {e.model.damping_ratio:g}"
        )
        table.add_row(
            "peak demand",
            f"{m.peak_speed_m_s:.3f} m/s (limit {e.limits.speed_m_s:g}), "
            f"{m.peak_acceleration_m_s2:.2f} m/s² (limit {e.limits.acceleration_m_s2:g})",
        )
        table.add_row(
            "predicted swing",
            f"peak {m.peak_swing_rad * 1e3:.1f} mrad, "
            f"residual {m.residual_swing_nonlinear_rad * 1e3:.2f} mrad",
        )
    else:
        table.add_row("plan", "no move" if job.plan.time_s == 0 else "from point to point")
    table.add_row(
        "time",
        f"{job.plan.quiet_s:g} s quiet, {job.plan.time_s:g} s move, "
        f"{job.plan.watch_s:g} s watching",
    )
    links = [f"{name} ({_faults(f)})" for name, f in e.links.items()]
    table.add_row("links", ", ".join(links) or "no faults")
    table.add_row("calibration", job.calibration_name if e.camera.rate_hz else "no camera")
    return table


def _faults(f: LinkFaults) -> str:
    words = []
    if f.delay_ms:
        words.append(f"{f.delay_ms:g} ms")
    if f.jitter_ms:
        words.append(f"+ up to {f.jitter_ms:g} ms")
    if f.loss:
        words.append(f"{f.loss:.0%} lost in bursts of {f.burst}")
    return ", ".join(words) or "no faults"


def _comparison(summaries: list[Summary]) -> Table:
    table = Table(title="residual swing [mrad] by planner", title_justify="left")
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


def _plan_description(plan: Plan) -> str:
    """Describe planner, move and options of a plan in one line."""
    p = plan.problem
    words = [
        f"{plan.planner}: {p.distance_m:g} m along {p.axis} in {p.time_s:g} s",
        f"{p.input} input",
    ]
    if p.robust:
        words.append(f"robust to {', '.join(p.robust)}")
    if p.nonlinear:
        words.append("nonlinear")
    return ", ".join(words)
