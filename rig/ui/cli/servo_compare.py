"""`rig servo compare`: comparison of drive controllers on the simulated elastic joint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer
from rich.progress import Progress

from rig.errors import BAD_DATA, ConfigError
from rig.studies.servo.compare import UNPUBLISHED_NOTE
from rig.studies.servo.pareto import DEFAULT_POINTS, MAX_POINTS
from rig.ui.cli import servo_compare_tables as tables
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import err, print_written

if TYPE_CHECKING:
    from rig.drives.servo.loops import LoopAnalysis
    from rig.run.joint.controllers import Drive
    from rig.studies.servo.compare import ControllerRun
    from rig.studies.servo.spec import ServoSpec

DEFAULT_CONTROLLERS = "pid,pid_ff,lqg"
# sections that make the rig another one than that of source 001
OWN_RIG_SECTIONS = ("model.", "move.", "bench.")


def compare(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="TOML file of a comparison; the three experiments of source 001 by default.",
            metavar="SPEC.toml",
        ),
    ] = None,
    example: Annotated[
        str | None,
        typer.Option(
            help="Shipped comparison instead of a file: source_001, or low_speed_ripple (ripple "
            "inside the band of the Kalman filter)."
        ),
    ] = None,
    controllers: Annotated[
        str | None,
        typer.Option(
            help="Controllers separated by commas, or all: pid, pid_ff, pid_notch, pid_observer, "
            f"pid_shaped, assigned, lqg, lqg_ff; {DEFAULT_CONTROLLERS} by default, all with "
            "--pareto.",
        ),
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(
            help="Plant variants (parameters of the simulated plant) of the file, "
            "separated by commas, or all; all by default, the first with --pareto.",
        ),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="New value of a key of the file, e.g. drive.period_s=0.0005; repeatable.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(help="Seed of the sensor noise, >= 0; the file's by default.", min=0),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Figure file of the first plant variant, or of --pareto: .svg, .png or .pdf."
        ),
    ] = None,
    pareto: Annotated[
        bool,
        typer.Option(
            "--pareto",
            help="Residual vibration over peak sensitivity instead, along one knob a controller.",
        ),
    ] = False,
    points: Annotated[
        int | None,
        typer.Option(
            help=f"Values of each knob with --pareto, 2 to {MAX_POINTS}; "
            f"{DEFAULT_POINTS} by default.",
            min=2,
            max=MAX_POINTS,
        ),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Compare residual vibration, error and torque of controllers of an elastic joint.

    Exit code 6 when no move settles.
    """
    if points is not None and not pareto:
        raise ConfigError(f"--points {points} without --pareto; must go with it: add --pareto")
    from rig.run.joint.controllers import CONTROLLERS
    from rig.studies.servo.compare import analyse_drives, build_drives  # scipy is slow to import

    if plot is not None:
        from rig.ui.plots import picture_file

        picture_file.check(plot)
    spec = _read(file, example, changes or (), seed)
    if controllers is None:
        controllers = "all" if pareto else DEFAULT_CONTROLLERS
    if truth is None:
        truth = next(iter(spec.truth)) if pareto else "all"
    names = _names("--controllers", controllers, CONTROLLERS)
    truths = _names("--truth", truth, spec.truth)
    if pareto:
        from rig.ui.cli.servo_pareto import TradeOffRequest, show_trade_off

        return show_trade_off(
            TradeOffRequest(
                spec=spec,
                variants=truths,
                controllers=names,
                points=points or DEFAULT_POINTS,
                plot=plot,
                as_json=as_json,
            )
        )
    drives = build_drives(spec, names)
    facts = analyse_drives(spec, drives)
    rows = _run_moves(spec, truths, drives, quiet=as_json)
    if plot is not None:
        from rig.ui.plots.servo_compare import draw_comparison

        first_variant = [row for row in rows if row.plant_variant == truths[0]]
        picture_file.save(draw_comparison(first_variant), plot)
    is_own_rig = any(change.startswith(OWN_RIG_SECTIONS) for change in changes or ())
    notes = UNPUBLISHED_NOTE if file is None and not example and not is_own_rig else ()
    verdict, reasons = _verdict(facts, rows)
    if as_json:
        verdict_document = {"verdict": verdict, "reasons": reasons, "source_001": " ".join(notes)}
        print_json(tables.document(spec, facts, rows) | verdict_document)
    else:
        tables.print_designs(spec, facts, drives)
        tables.print_runs(rows, names)
        tables.print_conclusions(rows, names, facts, notes, reasons)
        print_written(plot)
    return BAD_DATA if verdict == "bad" else 0


def _read(
    file: Path | None, example: str | None, changes: Sequence[str], seed: int | None
) -> ServoSpec:
    """Read the specification; raises ConfigError for a file and an example together."""
    from rig.studies.servo.spec import EXAMPLES, read_spec

    if file is not None and example is not None:
        raise ConfigError(f"SPEC.toml and --example {example}; must be one of them: remove one")
    spec = read_spec(file, changes, example or EXAMPLES[0])
    return spec if seed is None else msgspec.structs.replace(spec, seed=seed)


def _names(option: str, text: str, known: Iterable[str]) -> list[str]:
    """Split a comma list, each name once; all known ones for `all`.

    Raises ConfigError for an empty list.
    """
    if text == "all":
        return list(known)
    words = list(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
    if not words:
        raise ConfigError(
            f"{option} {text!r}; must name one or more, separated by commas, or all: see --help"
        )
    return words


def _run_moves(
    spec: ServoSpec, truths: Sequence[str], drives: Mapping[str, Drive], *, quiet: bool
) -> list[ControllerRun]:
    """Run every move on every plant variant with every controller, with a progress bar."""
    from rig.studies.servo.compare import compare as runs

    total = len(truths) * len(spec.move) * len(drives)
    rows = []
    with Progress(console=err, transient=True, disable=quiet or not err.is_terminal) as progress:
        bar = progress.add_task("moves", total=total)
        if not quiet and not err.is_terminal:
            err.print(f"{total} moves on the simulated joint")
        for row in runs(spec, truths, drives):
            rows.append(row)
            description = f"{row.plant_variant}, {row.title}, {row.controller}"
            progress.update(bar, advance=1, description=description)
    return rows


def _verdict(
    facts: Mapping[str, LoopAnalysis], rows: Sequence[ControllerRun]
) -> tuple[str, list[str]]:
    """Judge a comparison; gives verdict and reasons.

    bad: no move settled. doubtful: some move did not, or a loop is unstable on its model.
    """
    reasons = [
        f"{name} is unstable on the joint believed in"
        for name, found in facts.items()
        if not found.stable
    ]
    for row in rows:
        o = row.outcome
        if not o.arrived:
            limited = f", its torque at the limit for {o.at_limit_s:.3g} s" if o.at_limit_s else ""
            reasons.append(
                f"{row.controller} did not arrive: truth {row.plant_variant}, {row.title}, "
                f"{o.final_error_deg:.3g}° off{limited}"
            )
    if not any(row.outcome.arrived for row in rows):
        return "bad", reasons
    return "doubtful" if reasons else "good", reasons
