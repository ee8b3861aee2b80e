"""`rig doctor`: checks of the machine before a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from rig.errors import REFUSED, ConfigError
from rig.run.config import NetworkSection, read_experiment
from rig.run.doctor import examine
from rig.ui.cli import completion
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import Column, boxed_table, err, print_paragraph, print_table

COLUMNS = ("status", "check", Column("finding, advice", folds=True))
COLOUR = {"ok": "green", "warning": "yellow", "failed": "red"}


def doctor(
    runs: Annotated[Path, typer.Option(help="Folder in which the run folders are created.")] = Path(
        "runs"
    ),
    base_port: Annotated[int, typer.Option(help="First port to check; 0: any free ports.")] = 0,
    experiment: Annotated[
        str | None,
        typer.Option(
            help="Experiment whose CAN interface and node are checked too, where it has a drive.",
            autocompletion=completion.experiments,
        ),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Check ports, disk, versions, timer, imported packages and the field bus of an experiment.

    Exit code 3 when a run would fail.
    """
    network = _network(base_port)
    chosen = None if experiment is None else read_experiment(experiment, [])
    with err.status("checking ports, disk, versions, and the timer for three seconds"):
        examined = examine(runs, network, experiment=chosen)
    checks = examined.findings
    failed = [c for c in checks if c.status == "failed"]
    if as_json:
        grade = examined.machine.grade.name.lower()
        print_json({"ok": not failed, "grade": grade, "checks": [c._asdict() for c in checks]})
        return REFUSED if failed else 0
    table = boxed_table("", COLUMNS, left=len(COLUMNS))
    for check in checks:
        finding = f"{check.found}\n{check.advice}" if check.advice else check.found
        table.add_row(Text(check.status, style=COLOUR[check.status]), check.name, finding)
    print_table(table)
    print_paragraph(examined.verdict, "red" if failed else "green")
    return REFUSED if failed else 0


def _network(base_port: int) -> NetworkSection:
    """Describe the ports to check; raises ConfigError for ports that no run may use."""
    try:
        return NetworkSection(base_port=base_port)
    except ValueError as error:
        raise ConfigError(f"--{error}".replace("_", "-", 1)) from None
