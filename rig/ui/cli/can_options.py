"""Options that the verbs of `rig can` share: they name the bus."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.ui.cli import completion

Interface = Annotated[
    str | None,
    typer.Option(
        help="Interface of python-can, e.g. socketcan; that of the running experiment by default."
    ),
]
Channel = Annotated[
    str | None,
    typer.Option(help="Channel of the interface, e.g. can0; GROUP:PORT of udp_multicast."),
]
Bitrate = Annotated[
    int | None,
    typer.Option(
        min=10_000,
        max=1_000_000,
        help="Bit rate \\[bit/s]; that of \\[can], else 1000000, by default.",
    ),
]
ExperimentFile = Annotated[
    str | None,
    typer.Option(
        "--experiment",
        metavar="FILE",
        help="Experiment whose \\[can] names the bus, and whose \\[drive] the node.",
        autocompletion=completion.experiments,
    ),
]
Runs = Annotated[Path, typer.Option(help="Folder of the run folders.")]
