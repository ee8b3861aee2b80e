"""`operator.json` in the folder of a run: where its operator is reached. Imports no library."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, NamedTuple

NAME = "operator.json"


class OperatorFile(NamedTuple):
    """Contents of the file: address of the bus, and process of the operator."""

    address: str
    pid: int

    def write(self, folder: Path) -> None:
        """Write the file into the folder of a run; a rename makes it appear complete."""
        draft = folder / f"{NAME}.new"
        draft.write_text(json.dumps(self._asdict()))
        draft.rename(folder / NAME)


def read(path: Path) -> OperatorFile:
    """Read the file; raises OSError, and ValueError for other contents."""
    try:
        fields = json.loads(path.read_bytes())
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    if not isinstance(fields, dict):
        raise ValueError("not a table")
    return OperatorFile(
        address=_field(fields, "address", str),
        pid=_pid(fields),
    )


def find(runs: Path) -> list[Path]:
    """List the files of all runs under a folder."""
    return sorted(runs.glob(f"*/{NAME}"))


def is_alive(pid: int) -> bool:
    """Tell if a process exists."""
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # a process of another user
        return True
    return True


def _field(fields: dict[str, Any], name: str, kind: type) -> Any:
    value = fields.get(name)
    if type(value) is not kind:
        raise ValueError(f"{name} = {value!r}; must be {kind.__name__}")
    return value


def _pid(fields: dict[str, Any]) -> int:
    pid = int(_field(fields, "pid", int))
    if pid <= 0:  # a group of processes, or all of them
        raise ValueError(f"pid = {pid}; must be > 0")
    return pid
