"""The published tables: every row as printed, and what is known about it."""

from __future__ import annotations

from functools import lru_cache
from importlib import resources
from typing import Literal

import msgspec

from planners.errors import unknown_name

Verdict = Literal["reproduced", "partly", "false", "no entry"]

METHODS = {  # technique as printed: our planner of that kind
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
    """One printed row. figures follow columns (SI units in their names); both are empty where the source has a dash."""

    technique: str  # as printed
    time_s: float  # of the move
    figures: tuple[float, ...] = ()
    compute_s: float | None = None
    verdict: Verdict = "reproduced"
    off: tuple[str, ...] = ()  # columns that do not follow from what the source states
    why: str = ""
    window: int = 2  # velocity RMS is over [0, window x time_s]
    samples: Literal["fine", "segments"] = "fine"  # of a shaped law
    table: str = ""
    columns: tuple[str, ...] = ()

    @property
    def published(self) -> dict[str, float]:
        """Figures by column; {} where the source has a dash."""
        return dict(zip(self.columns, self.figures, strict=True)) if self.figures else {}

    @property
    def method(self) -> str:
        """Name of our planner that works the same way."""
        return METHODS[self.technique.split()[0]]

    @property
    def input(self) -> Literal["acceleration", "force", "jerk"]:
        """What the plan commands."""
        words = self.technique.lower().split()
        return "force" if "forza" in words else "jerk" if "jerk" in words else "acceleration"

    @property
    def acceleration(self) -> Literal["nodes", "filtered", "speed"]:
        """Where the source reads it: at the input's nodes, at those of the jerk model's output, or from the simulated speed."""
        if self.input == "force" or (self.input == "jerk" and self.bars):
            return "speed"
        return "filtered" if self.input == "jerk" else "nodes"

    @property
    def robust(self) -> bool:
        """Whether the plan forgives a wrong length."""
        return "Rob" in self.technique.split()

    @property
    def bars(self) -> bool:
        """Two bars (section 4); else the pendulum (section 3)."""
        return self.table.startswith("4")


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    table: str
    columns: tuple[str, ...]
    rows: tuple[PublishedRow, ...]


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    reasons: dict[str, str]
    tables: tuple[_Table, ...]


def rows(table: str) -> tuple[PublishedRow, ...]:
    """Rows of one table in the printed order. Raises PlanError for a table that is not one of TABLES."""
    if table not in TABLES:
        raise unknown_name("table", table, TABLES)
    return _tables()[table]


@lru_cache(maxsize=1)
def _tables() -> dict[str, tuple[PublishedRow, ...]]:
    text = resources.files("rig.studies.thesis_tables").joinpath("published.toml").read_bytes()
    file = msgspec.toml.decode(text, type=_File)
    return {
        section.table: tuple(
            msgspec.structs.replace(
                row,
                table=section.table,
                columns=section.columns,
                why=file.reasons[row.why] if row.why else "",
            )
            for row in section.rows
        )
        for section in file.tables
    }
