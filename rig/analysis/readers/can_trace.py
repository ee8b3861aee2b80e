"""Frames of a trace file of another program: ASC, BLF, PCAN TRC, candump."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

import can
from can.io.blf import BLFParseError
from can.io.generic import MessageReader

from comms.errors import LogError
from rig.errors import ConfigError

BINARY = ".blf"
TRACES: dict[str, Callable[[Any], MessageReader]] = {
    ".asc": can.ASCReader,
    ".blf": can.BLFReader,
    ".trc": can.TRCReader,
    ".log": can.CanutilsLogReader,
}
KINDS = "ASC (.asc), BLF (.blf), PCAN (.trc), candump (.log)"
READ_ERRORS = (
    ValueError,
    LookupError,
    TypeError,
    ArithmeticError,
    AttributeError,
    AssertionError,
    NotImplementedError,
    EOFError,
    zlib.error,
    struct.error,
    BLFParseError,
    can.CanError,
)


class DamagedTrace(LogError):
    """Trace file that cannot be read."""


def is_trace(name: str) -> bool:
    """Tell if a name is that of a trace file of another program."""
    return Path(name).suffix.lower() in TRACES


def read_trace(path: Path, kind: str = "") -> Iterator[can.Message]:
    """Read the frames of a trace file; raises ConfigError, and DamagedTrace at the damage.

    kind: ending of the kind of trace, where the name has another one.
    """
    kind = kind or path.suffix.lower()
    reader = TRACES.get(kind)
    if reader is None:
        raise ConfigError(f"{path}: unknown kind of trace; must be {KINDS}, or a run of this rig")
    if not path.is_file():
        raise ConfigError(f"{path}: no such file; must be a trace: {KINDS}, or a run of this rig")
    count = 0
    try:
        with _open(path, kind) as stream, reader(stream) as frames:
            for message in frames:
                yield message
                count += 1
    except READ_ERRORS as error:
        name = kind.removeprefix(".").upper()
        raise DamagedTrace(
            f"{path}: no {name} trace after {count} frames ({_reason(error)}): cut short, "
            "or of another kind"
        ) from error


def _open(path: Path, kind: str) -> IO[Any]:
    """Open a trace; the readers of python-can leave a file open that they do not understand."""
    if kind == BINARY:
        return path.open("rb")
    return path.open(encoding="utf-8", errors="replace")


def _reason(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
