"""Runs that are going on: the file in the folder of a run that names its operator's process."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import NamedTuple

ADDRESS_FILE = "operator.json"  # in the folder of the run, as long as its operator runs


class RunningOperator(NamedTuple):
    """An operator as its address file names it."""

    path: Path
    address: str
    pid: int

    @property
    def name(self) -> str:
        """Name of the run's folder."""
        return self.path.parent.name


def operators(runs: Path) -> list[RunningOperator]:
    """Read the address files of all runs in a folder, in the order of their names."""
    return [_read(path) for path in sorted(runs.glob(f"*/{ADDRESS_FILE}"))]


def is_alive(pid: int) -> bool:
    """Tell whether a process exists."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # a process of another user
        return True
    return True


def started_s(folder: Path) -> float | None:
    """Read the start of the run that goes on in a folder [s since 1970]; None where none does."""
    path = folder / ADDRESS_FILE
    try:
        operator = _read(path)
        written_s = path.stat().st_mtime
    except FileNotFoundError:  # the run has ended
        return None
    return written_s if is_alive(operator.pid) else None


def _read(path: Path) -> RunningOperator:
    fields = json.loads(path.read_bytes())
    return RunningOperator(path, str(fields["address"]), int(fields["pid"]))
