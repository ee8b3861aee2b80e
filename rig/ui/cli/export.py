"""`rig export`: one table for each channel of a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from comms.mcap_log import Log, read_log
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
    asc: Annotated[
        Path | None,
        typer.Option("--asc", metavar="FILE", help="Traffic of the field bus as ASC file."),
    ] = None,
    blf: Annotated[
        Path | None,
        typer.Option("--blf", metavar="FILE", help="Traffic of the field bus as BLF file."),
    ] = None,
    dbc: Annotated[
        Path | None,
        typer.Option("--dbc", metavar="FILE", help="Names of the frames of the run as DBC file."),
    ] = None,
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
) -> int:
    """Write one table for each channel of a log: CSV or Parquet, one row for each message.

    The traffic of its field bus becomes a trace file for other programs.
    """
    if not any((csv, parquet, asc, blf, dbc)):
        raise ConfigError(
            "neither --csv DIR nor --parquet DIR, --asc FILE, --blf FILE or --dbc FILE; must be at "
            "least one: name a folder or a file"
        )
    log = read_log(find_log(name, runs))
    if asc or blf or dbc:
        _export_field_bus(log, asc, blf, dbc)
    for folder, write in ((csv, write_csv), (parquet, write_parquet)):
        if folder is None:
            continue
        folder.mkdir(parents=True, exist_ok=True)
        written = write(log, folder)
        print_whole(f"{len(written)} tables written to {folder}")
    if not log.complete:
        print_paragraph(f"the log is incomplete: {log.damage}; the files hold what is left")
        return BAD_DATA
    return OK


def _export_field_bus(log: Log, asc: Path | None, blf: Path | None, dbc: Path | None) -> None:
    """Write the trace files and the names; python-can is imported where they are asked for."""
    from rig.run.field_bus.names import dbc_text
    from rig.run.field_bus.trace_files import check_path, write_trace
    from rig.run.field_bus.traffic import traffic_of

    traces = [(path, suffix) for path, suffix in ((asc, ".asc"), (blf, ".blf")) if path]
    for path, suffix in traces:
        check_path(path, suffix)
    traffic = traffic_of(log)
    for path, _ in traces:
        frames = write_trace(traffic, path)
        print_whole(f"{frames} frames written to {path}")
    if dbc is not None:
        dbc.write_text(dbc_text(traffic.bus.node), encoding="ascii")
        print_whole(f"names of the frames written to {dbc}")
