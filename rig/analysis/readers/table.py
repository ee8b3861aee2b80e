"""Columns of numbers as a file holds them, before one of them is chosen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rig.analysis.readers.errors import list_names
from rig.analysis.readers.signal_record import FloatArray, ReadFinding


class SignalColumn(NamedTuple):
    """Column of numbers; what is no number is NaN."""

    name: str  # as in the file, with its unit; "" without a header
    values: FloatArray  # (N,)
    is_time: bool = False  # known to be time [s], for example the stamps of a log


class BadCell(NamedTuple):
    """Cell that holds no number."""

    row: int  # from 1
    column: int  # from 0
    text: str


class Hint(NamedTuple):
    """Value that a file gives outside its columns, with the place where it stands."""

    value: str
    source: str


@dataclass(frozen=True, kw_only=True)
class SignalTable:
    """Columns of one file."""

    kind: str
    columns: Sequence[SignalColumn]
    layout: str = ""
    rate_hz: float | None = None  # named in the file
    rate_source: str = ""
    unit_hint: Hint | None = None  # of a signal without unit
    origin_s: float = 0.0  # instant of time 0 of the columns that are known to be time
    bad_cells: Sequence[BadCell] = ()
    findings: Sequence[ReadFinding] = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """Numbers and names of the columns."""
        return tuple(self.label(k) for k in range(len(self.columns)))

    def label(self, index: int) -> str:
        """Number and name of a column, for a message."""
        name = self.columns[index].name
        return f"{index + 1} '{name}'" if name else f"{index + 1}"

    @property
    def listing(self) -> str:
        """Columns found, for a message."""
        return f"columns found: {list_names(self.labels)}"
