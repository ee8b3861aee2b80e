"""`rig study`: an experiment over many settings, in virtual time."""

from __future__ import annotations

import typer

from rig.ui.cli.verbs import StudyGroup

app = typer.Typer(
    cls=StudyGroup, no_args_is_help=True, help="Repeat an experiment over many settings."
)


@app.callback()
def _study() -> None:
    """Repeat an experiment over many settings."""
