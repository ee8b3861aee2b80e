"""`rig calibrate offsets`: the camera's angle offset over platform position."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress
from rich.table import Table

from rig.analysis.run_log import RunLog
from rig.errors import Stopped
from rig.run import config, experiment
from rig.run.calibration import file as calibration_file
from rig.run.calibration import tour as calibration_run
from rig.run.runs import LOG
from rig.run.tasks.operator import Operator
from rig.ui.cli.output import err, out, print_json

app = typer.Typer(no_args_is_help=True, help="Make the tables the tracker needs.")


@app.callback()
def _calibrate() -> None:
    """Make the tables the tracker needs."""


@app.command()
def offsets(
    virtual: Annotated[bool, typer.Option("--virtual", help="In virtual time.")] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--out", help="File to write; calibration_<date>_<camera>.toml here otherwise."
        ),
    ] = None,
    name: Annotated[
        str, typer.Option("--experiment", help="Rig, links and belief to calibrate with.")
    ] = "move",
    seed: Annotated[int | None, typer.Option(help="Seed of the picture noise.")] = None,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", help="section.key=value, again and again.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
    runs: Annotated[Path, typer.Option(help="Where run folders go.")] = Path("runs"),
) -> int:
    """Drive to five points, watch two periods at each, fit offset, pivot and scale, write the table."""
    changes = [*(overrides or []), *([f"experiment.seed={seed}"] if seed is not None else [])]
    chosen = calibration_run.experiment_for(config.read_experiment(name, changes))
    tour = calibration_run.tour(chosen)
    with Progress(console=err, disable=as_json, transient=True) as bar:
        line = bar.add_task("calibrating", total=None)

        def progress(t_ns: int, operator: Operator) -> None:
            if operator.t_start_ns is not None and operator.t_end_ns is not None:
                done_s = max(0, t_ns - operator.t_start_ns) * 1e-9
                bar.update(
                    line, completed=done_s, total=(operator.t_end_ns - operator.t_start_ns) * 1e-9
                )

        ran = experiment.run(
            chosen,
            "virtual" if virtual else "wall",
            runs,
            progress,
            lambda job, plan: None,
            tour.motion,
        )
    if ran.outcome.exit_code:
        raise Stopped("; ".join(ran.outcome.reasons), ran.outcome.exit_code)
    found, calibration = calibration_run.fit(RunLog.open(ran.folder / LOG), chosen, tour.dwells_s)
    path = output or calibration_run.default_path(Path(), calibration)
    calibration_file.save(calibration, path)
    if as_json:
        print_json({"file": str(path), "run_dir": str(ran.folder), "calibration": calibration})
        return 0
    table = Table(title=f"offset over position, {calibration.camera}", title_justify="left")
    for heading in ("x, m", "offset, mrad", "sigma, mrad", "swing then, mrad"):
        table.add_column(heading, justify="right")
    for x, offset, sigma, swing in zip(
        found.x_m, found.offset_rad, found.sigma_offset_rad, found.amplitude_rad, strict=True
    ):
        table.add_row(f"{x:.4f}", f"{offset * 1e3:.4f}", f"{sigma * 1e3:.4f}", f"{swing * 1e3:.2f}")
    out.print(table)
    row = "" if found.row_observed else " (row not observable with so little swing: kept as given)"
    out.print(
        f"pivot at home ({found.pivot_home_px[0]:.2f}, {found.pivot_home_px[1]:.2f}) px{row}, {found.pixels_per_m:.2f} px/m"
    )
    out.print(
        f"{path}  use it with --set vision.calibration={shlex.quote(str(path))}", style="bold"
    )
    return 0
