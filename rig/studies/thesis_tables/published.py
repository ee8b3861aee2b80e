"""Published tables: every row as printed, with our verdict on it."""

from __future__ import annotations

from functools import lru_cache
from importlib import resources
from typing import Literal

import msgspec

from planners.errors import unknown_name

RowVerdict = Literal["reproduced", "partly", "false", "no entry"]

METHODS = {  # technique as printed: planner of the same method
    "DF": "finite_differences",
    "bvp5c": "collocation",
    "Shooting": "shooting",
    "Integrale": "convolution",
    "Esponenziale": "matrix_exponential",
    "ZV": "zv",
    "ZVD": "zvd",
}
TABLES = (*(f"3.{k}" for k in range(1, 9)), *(f"4.{k}" for k in range(1, 8)))


class PublishedRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Printed row of a table.

    figures are in the order of columns, which name their SI units; empty where the source has a
    dash.
    """

    technique: str  # as printed
    time_s: float  # of the move
    figures: tuple[float, ...] = ()
    compute_s: float | None = None
    verdict: RowVerdict = "reproduced"
    off: tuple[str, ...] = ()  # columns that do not follow from the source's statements
    why: str = ""
    window: int = 2  # velocity RMS is over [0, window x time_s]
    samples: Literal["fine", "segments"] = "fine"  # of a shaped law
    table: str = ""
    columns: tuple[str, ...] = ()

    @property
    def published(self) -> dict[str, float]:
        """Published figures by column; {} where the source has a dash."""
        return dict(zip(self.columns, self.figures, strict=True)) if self.figures else {}

    @property
    def method(self) -> str:
        """Name of our planner of the same method."""
        return METHODS[self.technique.split()[0]]

    @property
    def input(self) -> Literal["acceleration", "force", "jerk"]:
        """Input that the plan commands."""
        words = self.technique.lower().split()
        if "forza" in words:
            return "force"
        return "jerk" if "jerk" in words else "acceleration"

    @property
    def acceleration(self) -> Literal["nodes", "filtered", "speed"]:
        """Samples from which the source reads the acceleration.

        "nodes" of the input, "filtered" (nodes of the jerk model's output), or the simulated
        "speed".
        """
        if self.input == "force" or (self.input == "jerk" and self.bars):
            return "speed"
        return "filtered" if self.input == "jerk" else "nodes"

    @property
    def robust(self) -> bool:
        """True if the plan is robust against an error of the length."""
        return "Rob" in self.technique.split()

    @property
    def bars(self) -> bool:
        """True for the two bars (section 4), false for the pendulum (section 3)."""
        return self.table.startswith("4")


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`[[tables]]` of the file."""

    table: str
    columns: tuple[str, ...]
    rows: tuple[PublishedRow, ...]


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Whole file."""

    reasons: dict[str, str]
    tables: tuple[_Table, ...]


def rows(table: str) -> tuple[PublishedRow, ...]:
    """Return the rows of a table in the printed order. Raises PlanError for an unknown table."""
    if table not in TABLES:
        raise unknown_name("table", table, TABLES)
    return _tables()[table]


@lru_cache(maxsize=1)
def _tables() -> dict[str, tuple[PublishedRow, ...]]:
    text = resources.files("rig.studies.thesis_tables").joinpath("published.toml").read_bytes()
    file = msgspec.toml.decode(text, type=_File)
    tables = {}
    for section in file.tables:
        rows = []
        for row in section.rows:
            why = file.reasons[row.why] if row.why else ""
            rows.append(
                msgspec.structs.replace(row, table=section.table, columns=section.columns, why=why)
            )
        tables[section.table] = tuple(rows)
    return tables
