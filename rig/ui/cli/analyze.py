"""`rig analyze`: analysis of the log of a run."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated

import typer

from comms.clock import utc_now
from comms.errors import LogError
from rig.analysis.analyze import RunAnalysis
from rig.analysis.conclusion import conclude
from rig.analysis.seen_swing import FloatArray
from rig.analysis.summary import Summary
from rig.run import operator_file
from rig.run import runs as folders
from rig.ui.budget_rows import BUDGET_HEADS, budget_rows
from rig.ui.cli import completion
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_conclusion, print_json, print_summary
from rig.ui.cli.page import plain_table, print_table, print_whole, print_written


def analyze(
    name: Annotated[
        str,
        typer.Argument(
            metavar="RUN",
            help="Run folder, .mcap file, part of the run id, or `last`.",
            autocompletion=completion.recorded_runs,
        ),
    ],
    csv_file: Annotated[
        Path | None,
        typer.Option(
            "--csv",
            help="CSV file of the swing: t_s, angle_rad, sigma_rad, fit_rad, truth_rad.",
        ),
    ] = None,
    as_json: AsJson = False,
    report: Annotated[
        bool, typer.Option("--report", help="Rewrite report.html beside the log.")
    ] = False,
    runs: Annotated[Path, typer.Option(help="Folder that contains the run folders.")] = Path(
        "runs"
    ),
) -> int:
    """Compute swing, frequency, damping ratio, latencies and ledger from a log.

    A log that was cut short, and that of a run that goes on, are analysed up to their end.
    """
    analysis = _analysis(folders.find_log(name, runs))
    if csv_file is not None:
        _write_csv(analysis, csv_file)
    report_file = None
    if report:
        from rig.ui.report import write

        report_file = analysis.run.folder / folders.REPORT

        twin_log = analysis.run.folder / "twin" / folders.LOG
        twin = RunAnalysis(twin_log) if twin_log.is_file() else None
        write(analysis.run.folder, analysis, twin)
    if as_json:
        print_json(analysis.summary)
    else:
        print_summary(analysis.summary)
        _print_budget(analysis.summary)
        print_conclusion(conclude(analysis.run, analysis.summary))
        print_whole(str(analysis.run.log.path), "bold")
        print_written(csv_file, report_file)
    return analysis.summary.exit_code


def _print_budget(summary: Summary) -> None:
    """Print what makes up the standard deviations."""
    rows = budget_rows(summary)
    if not rows:
        return
    first, *others = BUDGET_HEADS
    view = plain_table("", [first, *(head.replace(" [", "\n[") for head in others)])
    for row in rows:
        view.add_row(*row)
    print_table(view)


def _analysis(log: Path) -> RunAnalysis:
    """Analyse a log; raises LogError."""
    started_s = operator_file.started_s(log.parent)
    if started_s is None:
        return RunAnalysis(log)
    running_s = max(0.0, utc_now().timestamp() - started_s)
    try:
        return RunAnalysis(log, running_s)
    except LogError as error:
        raise LogError(
            f"{log.parent.name}: still running, {running_s:.0f} s so far; "
            "too little is logged yet, analyse it later"
        ) from error


def _write_csv(analysis: RunAnalysis, path: Path) -> None:
    t, angle, sigma = analysis.run.swing
    truth = analysis.run.truth
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t_s", "angle_rad", "sigma_rad", "fit_rad", "truth_rad"])
        fitted = _fitted(analysis, t)
        for k, instant in enumerate(t):
            fit: float | str = ""
            if fitted is not None and instant >= analysis.run.t_settled_s:
                fit = fitted[k]
            true = _true_angle(instant, truth) if truth.size else ""
            rows.writerow([f"{instant:.9f}", angle[k], sigma[k], fit, true])


def _fitted(analysis: RunAnalysis, t_s: FloatArray) -> FloatArray | None:
    """Compute the fitted swing as the moving average of the tracker shows it; None without one."""
    if analysis.fit is None:
        return None
    facts = analysis.run.facts
    return analysis.fit.angle(
        t_s,
        average_frames=facts.average_frames,
        frame_period_s=1.0 / facts.rate_of(analysis.run.main_camera),
    )


def _true_angle(t_s: float, truth: object) -> float | str:
    """Interpolate the true angle at an instant [rad]; empty outside the recorded truth."""
    from rig.analysis.identify.errors import AnalysisError
    from rig.analysis.identify.swing import truth_at

    try:
        return float(truth_at([t_s], *truth.T[:3])[0])  # type: ignore[attr-defined, arg-type]
    except AnalysisError:
        return ""
