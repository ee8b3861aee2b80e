"""Units in the headers of columns, and their factors to SI."""

from __future__ import annotations

import re
from typing import NamedTuple

G_M_S2 = 9.80665  # standard gravity
DEG_RAD = 0.017453292519943295


class UnitFactor(NamedTuple):
    """SI unit, and the factor to it."""

    si: str
    factor: float


class ColumnHeader(NamedTuple):
    """Name of a column and its unit as written; "" for none."""

    name: str
    unit: str


OPTION_UNITS = {
    "rad": UnitFactor("rad", 1.0),
    "deg": UnitFactor("rad", DEG_RAD),
    "m": UnitFactor("m", 1.0),
    "mm": UnitFactor("m", 1e-3),
    "m/s2": UnitFactor("m/s2", 1.0),
    "g": UnitFactor("m/s2", G_M_S2),
    "V": UnitFactor("V", 1.0),
    "rad/s": UnitFactor("rad/s", 1.0),
    "none": UnitFactor("none", 1.0),
}
SPELLINGS = {
    "rad": (UnitFactor("rad", 1.0), "rad rads radian radians radiant"),
    "mrad": (UnitFactor("rad", 1e-3), "mrad"),
    "deg": (OPTION_UNITS["deg"], "deg degs degree degrees ° º"),
    "m": (OPTION_UNITS["m"], "m metre metres meter meters"),
    "cm": (UnitFactor("m", 1e-2), "cm"),
    "mm": (OPTION_UNITS["mm"], "mm millimetre millimetres millimeter millimeters"),
    "um": (UnitFactor("m", 1e-6), "um µm μm micron microns"),
    "m/s": (UnitFactor("m/s", 1.0), "m/s m_s"),
    "mm/s": (UnitFactor("m/s", 1e-3), "mm/s mm_s"),
    "m/s2": (OPTION_UNITS["m/s2"], "m/s2 m_s2 m/s/s ms-2 m/ss mps2"),
    "mm/s2": (UnitFactor("m/s2", 1e-3), "mm/s2 mm_s2 mm/s/s"),
    "cm/s2": (UnitFactor("m/s2", 1e-2), "cm/s2 cm_s2 gal"),
    "g": (OPTION_UNITS["g"], "g g0 gs g-force"),
    "mg": (UnitFactor("m/s2", 1e-3 * G_M_S2), "mg"),
    "V": (OPTION_UNITS["V"], "V volt volts"),
    "mV": (UnitFactor("V", 1e-3), "mv millivolt millivolts"),
    "rad/s": (OPTION_UNITS["rad/s"], "rad/s rad_s rad/sec rads/s radps"),
    "deg/s": (UnitFactor("rad/s", DEG_RAD), "deg/s deg_s °/s º/s deg/sec dps degrees/s"),
    "mrad/s": (UnitFactor("rad/s", 1e-3), "mrad/s mrad_s"),
    "N": (UnitFactor("N", 1.0), "N newton newtons"),
}
TIME_SPELLINGS = {
    1.0: "s sec secs second seconds sekunde sekunden",
    1e-3: "ms msec msecs millis millisecond milliseconds",
    1e-6: "us µs μs usec usecs micros microsecond microseconds",
    1e-9: "ns nsec nsecs nanos nanosecond nanoseconds",
    60.0: "min mins minute minutes",
}
TIME_NAMES = {1.0: "seconds", 1e-3: "milliseconds", 1e-6: "microseconds", 1e-9: "nanoseconds"}
BRACKETS = re.compile(r"^(.*?)[\s_]*[(\[{<]\s*([^()\[\]{}<>]+?)\s*[)\]}>]\s*$")
SLASH = re.compile(r"^(.*\S)\s*/\s*(\S+)$")
SPOKEN = re.compile(r"^(.*\S)\s+in\s+(\S+)$")
FREE = re.compile(r"^(\S.*?)[\s,]+(\S\S+)$")  # a unit of one letter needs brackets or `_`


def _by_spelling() -> dict[str, UnitFactor]:
    table = {}
    for unit, spellings in SPELLINGS.values():
        for spelling in spellings.split():
            table[spelling] = unit
    return table


def _time_by_spelling() -> dict[str, float]:
    table = {}
    for factor, spellings in TIME_SPELLINGS.items():
        for spelling in spellings.split():
            table[spelling] = factor
    return table


UNITS = _by_spelling()
TIME_UNITS = _time_by_spelling()


def _spelled(text: str) -> str:
    """Reduce the ways to write a unit to one; a single letter keeps its case."""
    text = text.strip().replace("²", "2").replace("^", "").replace("**", "")
    text = text.replace("·", "").replace("⁻", "-")
    squeezed = text.replace(" ", "")
    return squeezed if len(squeezed) == 1 else squeezed.lower()


def unit_factor(text: str) -> UnitFactor | None:
    """Find the unit of a signal by its spelling; None for an unknown one."""
    return UNITS.get(_spelled(text))


def time_factor(text: str) -> float | None:
    """Find the factor from a unit of time to seconds; None for an unknown one."""
    return TIME_UNITS.get(_spelled(text).lower())


def is_unit(text: str) -> bool:
    """Tell if a text is a known unit of a signal or of time."""
    return unit_factor(text) is not None or time_factor(text) is not None


def split_header(text: str) -> ColumnHeader:
    """Split the header of a column: "Angle (deg)", "t/s", "accel_x_m_s2", "U in V"."""
    text = text.strip().lstrip("#%").strip()
    for pattern in (BRACKETS, SPOKEN):
        match = pattern.match(text)
        if match and is_unit(match[2]):
            return ColumnHeader(match[1].strip(), match[2].strip())
    if is_unit(text):
        return ColumnHeader(text, text)
    for split in (_split_slash, _split_underscore, _split_space):
        header = split(text)
        if header is not None:
            return header
    return ColumnHeader(text, "")


def _split_slash(text: str) -> ColumnHeader | None:
    match = SLASH.match(text)
    if match and is_unit(match[2]) and not is_unit(match[1]):
        return ColumnHeader(match[1], match[2])
    return None


def _split_underscore(text: str) -> ColumnHeader | None:
    parts = text.split("_")
    for count in (2, 1):
        unit = "_".join(parts[-count:])
        if len(parts) > count and is_unit(unit):
            return ColumnHeader("_".join(parts[:-count]), unit)
    return None


def _split_space(text: str) -> ColumnHeader | None:
    match = FREE.match(text)
    if match and is_unit(match[2]):
        return ColumnHeader(match[1], match[2])
    return None
