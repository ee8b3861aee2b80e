"""Frames in words: name and signals by a DBC file, or by the table of the run."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import can
import cantools
from cantools.database import Database
from cantools.database.namedsignalvalue import NamedSignalValue

from rig.errors import ConfigError
from rig.run.drive_section import DriveSection
from rig.run.field_bus.names import database, function_name

SIGNIFICANT_DIGITS = 6


class DecodedFrame(NamedTuple):
    """Frame in words; signals: name, value and unit."""

    name: str
    signals: list[tuple[str, Any, str]] = []
    problem: str = ""  # why the signals are missing

    @property
    def text(self) -> str:
        """Signals in one line."""
        if self.problem:
            return self.problem
        parts = []
        for name, value, unit in self.signals:
            shown = f"{value:.{SIGNIFICANT_DIGITS}g}" if isinstance(value, float) else f"{value}"
            parts.append(f"{name} {shown} {unit}".rstrip())
        return ", ".join(parts)


class Decoder:
    """Decoder by a database; without one, by the function of the identifier alone."""

    def __init__(self, names: Database | None = None) -> None:
        self._names = names

    @classmethod
    def of_drive(cls, drive: DriveSection) -> Decoder:
        """Make the decoder of a run with a drive."""
        return cls(database(drive))

    @classmethod
    def of_file(cls, path: Path) -> Decoder:
        """Read a DBC file, or another kind that cantools reads; raises ConfigError."""
        if not path.is_file():
            raise ConfigError(f"--dbc {path}: no such file; name a DBC file, or `run`")
        try:
            names = cantools.database.load_file(str(path), strict=True)
        except (cantools.Error, ValueError, LookupError) as error:
            reason = str(error).splitlines()[0]
            raise ConfigError(f"--dbc {path}: {reason}; must be a DBC file") from error
        if not isinstance(names, Database):
            raise ConfigError(f"--dbc {path}: describes no frames; must be a DBC file")
        return cls(names)

    def decode(self, frame: can.Message) -> DecodedFrame:
        """Decode a frame; an unknown one has the name of its function, or none."""
        if frame.is_error_frame:
            return DecodedFrame("error frame")
        function = function_name(frame.arbitration_id, frame.is_extended_id)
        message = self._find(frame)
        if message is None:
            return DecodedFrame(function)
        if frame.is_remote_frame:
            return DecodedFrame(message.name, problem="remote frame")
        try:
            values = message.decode(bytes(frame.data), scaling=True, decode_choices=True)
        except (cantools.Error, ValueError, LookupError) as error:
            return DecodedFrame(message.name, problem=f"not decoded: {error}")
        units = {signal.name: signal.unit or "" for signal in message.signals}
        signals = [
            (signal.name, _plain(values[signal.name]), units[signal.name])
            for signal in message.signals
            if signal.name in values
        ]
        return DecodedFrame(message.name, signals)

    def _find(self, frame: can.Message) -> Any:
        if self._names is None:
            return None
        try:
            return self._names.get_message_by_frame_id(
                frame.arbitration_id, force_extended_id=frame.is_extended_id
            )
        except KeyError:
            return None


def _plain(value: Any) -> Any:
    return str(value) if isinstance(value, NamedSignalValue) else value
