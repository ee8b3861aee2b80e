"""`rig calibrate offsets`: calibration of the camera's angle offset over platform position.

`rig calibrate camera` is in calibrate_camera.py.
"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.progress import Progress

from rig.analysis.identify.offsets import OffsetCalibration
from rig.analysis.run_log import RunLog
from rig.errors import ConfigError, Stopped
from rig.run import config, experiment
from rig.run.calibration import file as calibration_file
from rig.run.calibration import static_scene
from rig.run.calibration import tour as calibration_run
from rig.run.runs import LOG
from rig.run.tasks.operator import Operator
from rig.ui.cli import completion
from rig.ui.cli.calibrate_camera import camera
from rig.ui.cli.common_options import AsJson, ImageSeed, Overrides
from rig.ui.cli.output import print_json
from rig.ui.cli.page import boxed_table, err, print_paragraph, print_table, print_whole

OFFSET_COLUMNS = ("x [m]", "offset [mrad]", "sigma [mrad]", "swing [mrad]")

app = typer.Typer(no_args_is_help=True, help="Measure the calibration tables of the tracker.")
app.command()(camera)


@app.callback()
def _calibrate() -> None:
    """Measure the calibration tables of the tracker."""


@app.command()
def offsets(
    virtual: Annotated[bool, typer.Option("--virtual", help="Virtual time.")] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Calibration file; calibration_<date>_<camera>.toml by default.",
        ),
    ] = None,
    add: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Calibration file to which the offsets in the present light are added, in place "
            "of a new file.",
        ),
    ] = None,
    name: Annotated[
        str,
        typer.Option(
            "--experiment",
            help="Experiment that gives rig, links and model.",
            autocompletion=completion.experiments,
        ),
    ] = "move",
    seed: ImageSeed = None,
    overrides: Overrides = None,
    as_json: AsJson = False,
    runs: Annotated[Path, typer.Option(help="Folder in which the run folders are created.")] = Path(
        "runs"
    ),
) -> int:
    """Drive to five positions and fit offset table, pivot and scale of the camera.

    The camera measures two swing periods at each position. The offset changes with the light:
    change it, and calibrate again with --add.
    """
    if add is not None and output is not None:
        raise ConfigError("--add with --out; must be one of the two: remove one")
    before = None if add is None else calibration_file.read(add)
    changes = list(overrides or [])
    if seed is not None:
        changes.append(f"experiment.seed={seed}")
    chosen = calibration_run.experiment_for(config.read_experiment(name, changes))
    tour = calibration_run.tour(chosen)
    with Progress(console=err, disable=as_json, transient=True) as bar:
        line = bar.add_task("calibrating", total=None)

        def progress(t_ns: int, operator: Operator) -> None:
            if operator.t_start_ns is not None and operator.t_end_ns is not None:
                done_s = max(0, t_ns - operator.t_start_ns) * 1e-9
                total_s = (operator.t_end_ns - operator.t_start_ns) * 1e-9
                bar.update(line, completed=done_s, total=total_s)

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
    scene = static_scene.scene_of_tour(ran.folder / LOG)
    run = RunLog.open(ran.folder / LOG)
    found, calibration = calibration_run.fit(run, chosen, tour.dwells_s, scene)
    if before is not None:
        calibration = calibration_file.with_light(before, calibration, str(add))
    path = add or output or calibration_run.default_path(Path(), calibration)
    if scene is not None and before is None:
        picture = static_scene.save(scene, path)
        calibration = msgspec.structs.replace(calibration, static_scene=picture)
    calibration_file.save(calibration, path)
    if as_json:
        print_json({"file": str(path), "run_dir": str(ran.folder), "calibration": calibration})
        return 0
    _print_calibration(found, calibration, path)
    left_out = len(tour.dwells_s) - len(found.x_m)
    if left_out:
        print_paragraph(
            f"{left_out} of {len(tour.dwells_s)} positions left out: the cable hangs before a "
            "static line there. Move the line, or the camera, to calibrate them"
        )
    return 0


def _print_calibration(
    found: OffsetCalibration, calibration: calibration_file.Calibration, path: Path
) -> None:
    level = calibration.lights[-1].background if calibration.lights else calibration.background
    title = f"angle offset over position, {calibration.camera}, light {level:.0f} of 255"
    table = boxed_table(title, OFFSET_COLUMNS, left=0)
    for x, offset, sigma, swing in zip(
        found.x_m, found.offset_rad, found.sigma_offset_rad, found.amplitude_rad, strict=True
    ):
        table.add_row(f"{x:.4f}", f"{offset * 1e3:.4f}", f"{sigma * 1e3:.4f}", f"{swing * 1e3:.2f}")
    print_table(table)
    u, v = found.pivot_home_px
    row = "" if found.row_observed else " (row not observable at this swing: unchanged)"
    print_paragraph(f"pivot at home ({u:.2f}, {v:.2f}) px{row}, {found.pixels_per_m:.2f} px/m")
    print_whole(f"written: {path}", "bold")
    if calibration.static_scene is not None:
        print_whole(f"picture without the cable: {path.with_name(calibration.static_scene)}")
    print_whole(f"use it with --set vision.calibration={shlex.quote(str(path))}")
