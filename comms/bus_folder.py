"""Folder of the sockets of a run, for this user alone. Imports no library.

The address of a local socket may have 107 bytes, so the folder is not that of the run.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PREFIX = "rig-"
SCHEME = "ipc://"
MAX_PATH_BYTES = 107  # of a local socket
LONGEST_NAME = "telemetry"


@contextmanager
def opened(is_local: bool) -> Iterator[Path | None]:
    """Make the folder, and remove it at the end; None where the sockets are not local ones."""
    folder = make() if is_local else None
    try:
        yield folder
    finally:
        if folder is not None:
            remove(folder)


def make() -> Path:
    """Make a folder of mode 0700 with a short path, in the folder of temporary files or in /tmp."""
    for parent in (tempfile.gettempdir(), "/tmp"):
        folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=parent))
        if len(os.fsencode(folder / LONGEST_NAME)) <= MAX_PATH_BYTES:
            return folder
        folder.rmdir()
    raise OSError(f"no folder whose path leaves room for a socket: {tempfile.gettempdir()}, /tmp")


def address(folder: Path, name: str) -> str:
    """Return the address of a socket in the folder."""
    return f"{SCHEME}{folder / name}"


def remove(folder: Path) -> None:
    """Remove the folder with its sockets; one that is gone or not of a run is left as it is."""
    if not folder.name.startswith(PREFIX):
        return
    with suppress(OSError):
        for path in folder.iterdir():
            if path.is_socket():
                path.unlink()
        folder.rmdir()


def folder_of(address: str) -> Path | None:
    """Return the folder of a socket by its address; None for an address of another kind."""
    if not address.startswith(SCHEME):
        return None
    return Path(address.removeprefix(SCHEME)).parent
