"""Trace files of a run for other programs: ASC and BLF by the writers of python-can."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import can

from rig.errors import ConfigError
from rig.run.field_bus.traffic import Traffic

WRITERS: Mapping[str, type[can.ASCWriter] | type[can.BLFWriter]] = {
    ".asc": can.ASCWriter,
    ".blf": can.BLFWriter,
}


def check_path(path: Path, suffix: str) -> None:
    """Check that a file has the suffix of its kind; raises ConfigError."""
    if path.suffix.lower() != suffix:
        raise ConfigError(
            f"--{suffix[1:]} {path}; must end in {suffix}: other programs tell the kind by it"
        )


def write_trace(traffic: Traffic, path: Path) -> int:
    """Write the frames of a run with wall-clock stamps; return their number."""
    writer = WRITERS[path.suffix.lower()](str(path), channel=1)
    with writer:
        for frame in traffic.frames:
            stamped = frame.__copy__()
            stamped.timestamp += traffic.epoch_s
            writer.on_message_received(stamped)
    return len(traffic.frames)
