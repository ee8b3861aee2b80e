"""Entries of the object dictionary as the EDS file describes them."""

from __future__ import annotations

import io
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

EDS_NAME = "swayless_drive.eds"
FIRST_OBJECT = 0x1000  # below are data types
VISIBLE_STRING = 0x09

Value = int | bytes


class IntegerType(NamedTuple):
    """Length and sign of an integer data type."""

    length: int  # bytes
    is_signed: bool


INTEGER_TYPES = {
    0x02: IntegerType(1, True),
    0x03: IntegerType(2, True),
    0x04: IntegerType(4, True),
    0x05: IntegerType(1, False),
    0x06: IntegerType(2, False),
    0x07: IntegerType(4, False),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectEntry:
    """Description of one sub-index in the EDS file."""

    index: int
    subindex: int
    name: str
    data_type: int  # key of INTEGER_TYPES, or VISIBLE_STRING
    access: str  # "ro", "wo", "rw" or "const"
    default: Value
    low: int | None  # limit of a written value
    high: int | None
    is_mappable: bool  # into a PDO

    @property
    def length(self) -> int | None:
        """Length [bytes]; None for a string."""
        integer = INTEGER_TYPES.get(self.data_type)
        return integer.length if integer else None

    @property
    def is_readable(self) -> bool:
        """Right to read over the bus."""
        return self.access != "wo"

    @property
    def is_writable(self) -> bool:
        """Right to write over the bus."""
        return "w" in self.access


def eds_text() -> str:
    """Text of the EDS file that ships with the package."""
    return resources.files("rig.drives.cia402").joinpath(EDS_NAME).read_text(encoding="ascii")


@cache
def parse_eds(node_id: int) -> dict[tuple[int, int], ObjectEntry]:
    """Parse the EDS file with the defaults of a node-ID; the keys are (index, subindex)."""
    from canopen.objectdictionary import ODVariable, eds

    parsed = eds.import_eds(io.StringIO(eds_text()), node_id)  # type: ignore[no-untyped-call]
    entries: dict[tuple[int, int], ObjectEntry] = {}
    for index in sorted(parsed.indices):
        item = parsed[index]
        variables = [item] if isinstance(item, ODVariable) else list(item.values())
        for variable in variables:
            if variable.index >= FIRST_OBJECT:
                entries[index, variable.subindex] = _entry(variable)
    return entries


def _entry(variable: Any) -> ObjectEntry:
    """Convert an ODVariable of the canopen library."""
    default = variable.default
    if variable.data_type == VISIBLE_STRING:
        default = (default or "").encode("ascii")
    return ObjectEntry(
        index=variable.index,
        subindex=variable.subindex,
        name=variable.name,
        data_type=variable.data_type,
        access=variable.access_type,
        default=default,
        low=variable.min,
        high=variable.max,
        is_mappable=variable.pdo_mappable,
    )
