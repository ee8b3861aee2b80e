"""`rig export`: one table for each channel of a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from comms.mcap_log import read_log
from rig.analysis.tables import write_csv, write_parquet
from rig.errors import BAD_DATA, OK, ConfigError
from rig.run.runs import find_log
from rig.ui.cli import completion
from rig.ui.cli.page import print_paragraph, print_whole


def export(
    name: Annotated[
        str,
        typer.Argument(
            metavar="RUN",
            help="Run folder, .mcap file, part of a run's name, or `last`.",
            autocompletion=completion.recorded_runs,
        ),
    ],
    csv: Annotated[
        Path | None, typer.Option("--csv", metavar="DIR", help="Folder of the CSV files.")
    ] = None,
    parquet: Annotated[
        Path | None, typer.Option("--parquet", metavar="DIR", help="Folder of the Parquet files.")
    ] = None,
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
) -> int:
    """Write one table for each channel of a log: CSV or Parquet, one row for each message."""
    if csv is None and parquet is None:
        raise ConfigError("neither --csv DIR nor --parquet DIR; must be one or both: name a folder")
    log = read_log(find_log(name, runs))
    for folder, write in ((csv, write_csv), (parquet, write_parquet)):
        if folder is None:
            continue
        folder.mkdir(parents=True, exist_ok=True)
        written = write(log, folder)
        print_whole(f"{len(written)} tables written to {folder}")
    if not log.complete:
        print_paragraph(f"the log is incomplete: {log.damage}; the tables hold what is left")
        return BAD_DATA
    return OK
