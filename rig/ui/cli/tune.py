"""`rig tune`: excite, identify, plan, run and verify in one command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from rig.errors import EXIT_STATUS, ConfigError
from rig.run.runtime.execute import ClockMode
from rig.studies import tuning
from rig.studies.tuning import Tuning
from rig.ui.cli import completion
from rig.ui.cli.common_options import AsJson, Overrides
from rig.ui.cli.identify_record import choice_document, identification_document
from rig.ui.cli.identify_tables import with_sigma
from rig.ui.cli.output import COLOUR, print_json
from rig.ui.cli.page import plain_table, print_command, print_paragraph, print_table, print_written
from rig.ui.cli.tuned_file import tuned_text
from rig.ui.cli.tuning_run import run_titled

DEFAULT_OUT = Path("tuned.toml")


def tune(
    name: Annotated[
        str,
        typer.Argument(
            metavar="[EXPERIMENT]",
            help="Shipped experiment or TOML file with a move of a cable.",
            autocompletion=completion.experiments,
        ),
    ] = "move",
    virtual: Annotated[
        bool, typer.Option("--virtual", help="Virtual time: one process, faster than real time.")
    ] = False,
    overrides: Overrides = None,
    out: Annotated[
        Path, typer.Option(help="Experiment file with the tuned model and planner.")
    ] = DEFAULT_OUT,
    runs: Annotated[Path, typer.Option(help="Folder in which the run folders are created.")] = Path(
        "runs"
    ),
    as_json: AsJson = False,
) -> int:
    """Find the load of a move, plan for it, and show the swing before and after.

    Runs the move as it is; where it leaves too little swing, once more with a plain motion law.
    Length and damping come from the log, the planner from their uncertainty. Exit code 6 if the
    load cannot be identified or the tuned move swings more than predicted.
    """
    if out.suffix != ".toml" or not out.parent.is_dir():
        raise ConfigError(f"--out '{out}'; must be a .toml file in a folder that exists: rename it")
    if out.exists() and Path(name).is_file() and out.samefile(name):
        raise ConfigError(
            f"--out '{out}' is the experiment that is read; must be another: rename it"
        )
    mode: ClockMode = "virtual" if virtual else "wall"
    changes = list(overrides or [])
    result = tuning.tune(
        name, changes, lambda title, chosen: run_titled(title, chosen, mode, runs, as_json)
    )
    if result.changes:
        out.write_text(tuned_text(name, [*changes, *result.changes]))
    written = out if result.changes else None
    if as_json:
        print_json(_document(result, written))
        return result.exit_code
    _print(result, written)
    return result.exit_code


def _rows(result: Tuning) -> list[tuple[str, str, str]]:
    """Titles with the values before and after."""
    before = result.before.summary
    after = None if result.after is None else result.after.summary
    rows = [("planner", before.planner, "-" if after is None else after.planner)]
    for title, section, key in (
        ("planned residual swing, mrad", "planned", "residual_swing_rad"),
        ("measured residual swing, mrad", "measured", "residual_swing_rad"),
        ("measured peak swing, mrad", "measured", "peak_swing_rad"),
    ):
        values = []
        for summary in (before, after):
            value = None if summary is None else getattr(getattr(summary, section), key)
            values.append("-" if value is None else f"{1e3 * value:.3f}")
        rows.append((title, values[0], values[1]))
    return rows


def _print(result: Tuning, written: Path | None) -> None:
    found = result.found
    length_m, sigma_m = found.cable_length_m, found.sigma_cable_length_m
    if length_m is not None and sigma_m is not None and found.modes:
        mode = found.modes[0]
        length = with_sigma(length_m, sigma_m)
        damping = with_sigma(mode.damping_ratio, mode.sigma_damping_ratio)
        frequency = with_sigma(mode.frequency_hz, mode.sigma_frequency_hz)
        print_paragraph(
            f"found: cable of {length} m, {frequency} Hz, damping ratio {damping}", "bold"
        )
    if result.choice is not None:
        chosen = result.choice.chosen
        print_paragraph(
            f"planned with {chosen.candidate.words}: two standard deviations of the length add at "
            f"most {1e3 * chosen.worst_rad:.2f} mrad to the residual swing that is planned"
        )
    table = plain_table("", ("", "before", "after"))
    for row in _rows(result):
        table.add_row(*row)
    print_table(table)
    print_paragraph(f"verdict: {result.verdict}", f"{COLOUR.get(result.verdict, 'red')} bold")
    for reason in result.reasons:
        print_paragraph(f"  - {reason}", indent="    ")
    print_written(written)
    if written is not None:
        print_command("next:", f"rig run {written}")


def _document(result: Tuning, written: Path | None) -> dict[str, Any]:
    return {
        "exit_status": EXIT_STATUS[result.exit_code],
        "exit_code": result.exit_code,
        "verdict": result.verdict,
        "reasons": list(result.reasons),
        "identification": identification_document(result.found),
        "plan": None if result.choice is None else choice_document(result.choice),
        "changes": list(result.changes),
        "before": result.before.summary,
        "excited": None if result.excited is None else result.excited.summary,
        "after": None if result.after is None else result.after.summary,
        "written": None if written is None else str(written),
    }
