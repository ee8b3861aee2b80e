"""`rig servo`: drive controllers of an elastic joint, in theory and on the simulated bench."""

from __future__ import annotations

import typer

from rig.ui.cli.verbs import ServoGroup

app = typer.Typer(
    cls=ServoGroup,
    no_args_is_help=True,
    help="Compare and tune drive controllers of an elastic joint, in theory and on the bench.",
)


@app.callback()
def _servo() -> None:
    """Compare and tune drive controllers of an elastic joint, in theory and on the bench."""
