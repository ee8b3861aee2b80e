"""Options that several verbs have, with one name and one help text each."""

from __future__ import annotations

from typing import Annotated

import typer

AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", help="New value of a key, section.key=value; repeatable."),
]
ImageSeed = Annotated[
    int | None, typer.Option(help="Seed of the image noise; the experiment's by default.")
]
