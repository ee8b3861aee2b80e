"""Table of a file of any kind that can be read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rig.analysis.readers.errors import UnreadableData, list_names
from rig.analysis.readers.file_kind import FileKind, file_kind, read_head
from rig.analysis.readers.matlab import read_hdf5, read_matlab
from rig.analysis.readers.mcap_table import read_mcap
from rig.analysis.readers.phyphox import read_archive, read_experiment
from rig.analysis.readers.signal_record import ReadOptions
from rig.analysis.readers.table import SignalTable
from rig.analysis.readers.text_file import read_text
from rig.analysis.readers.workbook import read_xls, read_xlsx
from rig.errors import ConfigError

RUN_LOG = "run.mcap"
READERS: dict[FileKind, Callable[[Path, ReadOptions], SignalTable]] = {
    FileKind.MATLAB: read_matlab,
    FileKind.HDF5: read_hdf5,
    FileKind.XLSX: read_xlsx,
    FileKind.XLS: read_xls,
    FileKind.ZIP: read_archive,
    FileKind.PHYPHOX: read_experiment,
    FileKind.MCAP: read_mcap,
}


def read_table(path: Path, options: ReadOptions) -> SignalTable:
    """Read the columns of a file or a run folder; raises UnreadableData and ConfigError."""
    path = _file(path)
    head = read_head(path)
    kind = file_kind(path, head)
    if kind in READERS:
        table = READERS[kind](path, options)
    elif kind is FileKind.TEXT:
        if options.dbc is not None:
            raise ConfigError(
                f"{path}: --dbc is for a CAN trace (ASC, BLF, TRC, candump), and this is text: "
                "leave out --dbc"
            )
        table = read_text(path, head)
    else:
        from rig.analysis.readers.can_table import read_can  # loads python-can and cantools

        table = read_can(path, kind, options)
    if not table.columns or not len(table.columns[0].values):
        raise UnreadableData(f"{path}: {table.kind} without samples; name another file")
    return table


def _file(path: Path) -> Path:
    """Find the log in a run folder; raises UnreadableData for another folder."""
    if not path.is_dir():
        return path
    if (path / RUN_LOG).is_file():
        return path / RUN_LOG
    names = sorted(entry.name for entry in path.iterdir())
    found = list_names(names) if names else "nothing"
    raise UnreadableData(
        f"{path}: a folder without {RUN_LOG}; it holds {found}: name a run folder or one file"
    )
