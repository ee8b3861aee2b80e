"""`operator.json` in the folder of a run: where its operator is reached. Imports no library."""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from comms import bus_folder
from rig.errors import Refused

NAME = "operator.json"
MODE = 0o600  # the key stops the robot


class OperatorFile(NamedTuple):
    """Contents of the file: bus and process of the operator; key and ports for stop datagrams."""

    address: str
    pid: int
    stop_key: str = ""  # hexadecimal; empty where there is none
    stop_ports: Mapping[str, int] = {}  # by task
    can: Mapping[str, Any] = {}  # settings of the field bus (comms/can_bus.py); {} without one

    def write(self, folder: Path) -> None:
        """Write the file into the folder of a run; a rename makes it appear complete.

        Raises Refused where others could read the key.
        """
        draft = folder / f"{NAME}.new"
        with open(os.open(draft, os.O_CREAT | os.O_EXCL | os.O_WRONLY, MODE), "w") as file:
            file.write(json.dumps(self._asdict()))
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
        if mode != MODE:
            draft.unlink()
            raise Refused(
                f"{draft.parent}: a file for this user alone has mode {mode:o} there; "
                f"must be {MODE:o}: name a folder of another file system with --runs"
            )
        draft.rename(folder / NAME)

    @property
    def key(self) -> bytes:
        """Key of the stop datagrams; empty where there is none that can be used."""
        try:
            return bytes.fromhex(self.stop_key)
        except ValueError:
            return b""


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
        stop_key=str(fields.get("stop_key", "")),
        stop_ports=_ports(fields.get("stop_ports")),
        can=_table(fields.get("can")),
    )


def find(runs: Path) -> list[Path]:
    """List the files of all runs under a folder."""
    return sorted(runs.glob(f"*/{NAME}"))


def remove(path: Path, address: str) -> None:
    """Remove the file of a run that has ended, and the folder of its sockets."""
    path.unlink(missing_ok=True)
    folder = bus_folder.folder_of(address)
    if folder is not None:
        bus_folder.remove(folder)


def remove_stale(runs: Path) -> None:
    """Remove what operators that were killed left behind under a folder."""
    for path in find(runs):
        try:
            operator = read(path)
        except (OSError, ValueError):  # of another version, or unreadable: `rig stop` names it
            continue
        if not is_alive(operator.pid):
            remove(path, operator.address)


def started_s(folder: Path) -> float | None:
    """Read the start of the run that goes on in a folder [s since 1970]; None where none does."""
    path = folder / NAME
    try:
        operator = read(path)
        written_s = path.stat().st_mtime
    except (OSError, ValueError):  # the run has ended, or its file cannot be read
        return None
    return written_s if is_alive(operator.pid) else None


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


def _ports(value: Any) -> dict[str, int]:
    """Read the stop ports; unusable ones are left out, so that the operator is asked anyway."""
    if not isinstance(value, dict):
        return {}
    return {task: port for task, port in value.items() if _is_port(port)}


def _table(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _is_port(value: Any) -> bool:
    return type(value) is int and 0 < value < 65_536


def _pid(fields: dict[str, Any]) -> int:
    pid = int(_field(fields, "pid", int))
    if pid <= 0:  # a group of processes, or all of them
        raise ValueError(f"pid = {pid}; must be > 0")
    return pid
