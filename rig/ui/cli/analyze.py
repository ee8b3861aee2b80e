"""`rig analyze`: what a recorded run amounts to."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated

import typer

from rig.analysis.analyze import RunAnalysis
from rig.run import runs as folders
from rig.ui.cli.output import out, print_json, print_summary


def analyze(
    name: Annotated[
        str,
        typer.Argument(
            metavar="RUN", help="Run folder, .mcap file, part of a run's id, or `last`."
        ),
    ],
    csv_file: Annotated[
        Path | None,
        typer.Option(
            "--csv", help="Write the swing: t_s, angle_rad, sigma_rad, fit_rad, truth_rad."
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
    report: Annotated[
        bool, typer.Option("--report", help="Write report.html beside the log again.")
    ] = False,
    runs: Annotated[Path, typer.Option(help="Where run folders are.")] = Path("runs"),
) -> int:
    """Take swing, frequency, damping, latency and the ledger from a log, complete or cut short."""
    analysis = RunAnalysis(folders.find_log(name, runs))
    if csv_file is not None:
        _write_csv(analysis, csv_file)
    if report:
        from rig.ui.report import write

        twin = analysis.run.folder / "twin" / folders.LOG
        write(analysis.run.folder, analysis, RunAnalysis(twin) if twin.is_file() else None)
    if as_json:
        print_json(analysis.summary)
    else:
        print_summary(analysis.summary)
        out.print(str(analysis.run.log.path), style="bold")
    return analysis.summary.exit_code


def _write_csv(analysis: RunAnalysis, path: Path) -> None:
    t, angle, sigma = analysis.run.swing
    truth = analysis.run.truth
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t_s", "angle_rad", "sigma_rad", "fit_rad", "truth_rad"])
        fitted = analysis.fit.angle(t) if analysis.fit else None
        for k, instant in enumerate(t):
            in_fit = fitted is not None and instant >= analysis.run.t_settled_s
            true = _true_angle(instant, truth) if truth.size else ""
            rows.writerow(
                [
                    f"{instant:.9f}",
                    angle[k],
                    sigma[k],
                    fitted[k] if fitted is not None and in_fit else "",
                    true,
                ]
            )


def _true_angle(t_s: float, truth: object) -> float | str:
    from rig.analysis.identify.errors import AnalysisError
    from rig.analysis.identify.swing import truth_at

    try:
        return float(truth_at([t_s], *truth.T[:3])[0])  # type: ignore[attr-defined, arg-type]
    except AnalysisError:
        return ""
