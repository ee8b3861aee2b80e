"""`rig doctor`: checks of the machine before a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from rig.errors import REFUSED
from rig.run.config import NetworkSection
from rig.run.doctor import examine
from rig.ui.cli.output import err, out, print_json

COLOUR = {"ok": "green", "warning": "yellow", "failed": "red"}


def doctor(
    runs: Annotated[Path, typer.Option(help="Folder in which the run folders are created.")] = Path(
        "runs"
    ),
    base_port: Annotated[int, typer.Option(help="First port to check; 0: any free ports.")] = 0,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
) -> int:
    """Check ports, disk, versions, timer and imported packages.

    Exit code 3 when a run would fail.
    """
    with err.status("checking ports, disk, versions, and the timer for three seconds"):
        examined = examine(runs, NetworkSection(base_port=base_port))
    checks = examined.findings
    failed = [c for c in checks if c.status == "failed"]
    if as_json:
        grade = examined.machine.grade.name.lower()
        print_json({"ok": not failed, "grade": grade, "checks": [c._asdict() for c in checks]})
        return REFUSED if failed else 0
    table = Table(show_header=False)
    for check in checks:
        table.add_row(
            Text(check.status, style=COLOUR[check.status]), check.name, check.found, check.advice
        )
    out.print(table)
    out.print(examined.verdict, style="red" if failed else "green")
    return REFUSED if failed else 0
