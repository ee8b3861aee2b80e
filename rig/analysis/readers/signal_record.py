"""Signal over time as read from a file, and the options of reading it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """Choices of the user; an empty one is left to the reader."""

    time: str = ""  # name of the time column, or its number from 1
    signal: str = ""  # name of the signal column, or its number from 1
    unit: str = ""  # of the signal, a key of units.OPTION_UNITS
    rate_hz: float | None = None  # sampling rate, in place of a time column
    topic: str = ""  # MCAP topic, sheet of a workbook, or file in an archive
    field: str = ""  # field of an MCAP message, or signal of a CAN message
    dbc: Path | None = None  # names of the CAN signals


class ReadFinding(NamedTuple):
    """Peculiarity of a record: a fixed code, and the evidence in words."""

    code: str
    text: str
    samples: int = 1  # or places concerned
    rows: tuple[int, ...] = ()  # first rows concerned, from 1


@dataclass(frozen=True, kw_only=True)
class SignalRecord:
    """One signal over time, in SI units, with the account of how it was read."""

    path: Path
    kind: str  # of the file, in words
    layout: str  # delimiter, decimal mark and first line of a text, or "" where there is none
    t_s: FloatArray  # (N,) strictly increasing, minus origin_s
    values: FloatArray  # (N,) finite, in `unit`
    unit: str  # "rad", "m", "m/s2", "V", "rad/s", another SI unit, or "none"
    unit_source: str  # for example "header 'angle [deg]'"
    time_source: str  # for example "column 1 't_ms', milliseconds"
    signal_source: str  # for example "column 2 'angle [deg]'"
    origin_s: float  # instant of t_s = 0 on the clock of the file; not 0 for dates alone
    rate_hz: float  # from the usual step
    columns: tuple[str, ...]  # columns, fields or signals found
    rows: int  # as recorded
    dropped_rows: int
    quantum: float  # smallest usual step between different values, in `unit`
    noise_floor: float  # standard deviation of the noise, in `unit`
    findings: tuple[ReadFinding, ...]

    def count(self, code: str) -> int:
        """Sum the counts of the findings with a code; 0 without any."""
        return sum(finding.samples for finding in self.findings if finding.code == code)
