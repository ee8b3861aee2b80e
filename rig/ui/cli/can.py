"""`rig can`: nodes, frames and objects of a CANopen field bus."""

from __future__ import annotations

import typer

from rig.ui.cli.verbs import CanGroup

app = typer.Typer(
    cls=CanGroup, no_args_is_help=True, help="Look at a CANopen field bus and its nodes."
)


@app.callback()
def _can() -> None:
    """Look at a CANopen field bus and its nodes."""
