"""Choice of a column by the user, and marks of columns that tell what they hold."""

from __future__ import annotations

import re

import numpy as np

from rig.analysis.readers.signal_record import FloatArray
from rig.analysis.readers.table import SignalTable
from rig.analysis.readers.units import split_header, time_factor
from rig.errors import ConfigError

TIME_NAMES = {
    *("t", "time", "timestamp", "stamp", "zeit", "temps", "tiempo", "tempo", "x_value", "clock"),
    *("elapsed", "seconds", "sec", "secs", "s", "ms", "millis", "micros", "us", "ns", "datetime"),
}
TIME_WORD = re.compile(r"(^|[\s_.\-])(t|time|timestamp|stamp|zeit|elapsed)($|[\s_.\-:])")
COUNT_NAME = re.compile(
    r"^(n|no|nr|index|idx|sample|samples|frame|row|seq|count|#)\b[\s_.#]*", re.I
)
COUNT_NAME_REST = re.compile(r"^(number|nr|no|id|index|count)?$", re.I)
FREQUENCY_NAME = re.compile(r"^(freq\w*([\s(\[/:,].*)?|f[\s_]*[(\[/]?\s*hz\W*)$", re.I)
RISING_SHARE = 0.5
EVEN_SHARE = 0.98  # of the steps of an unnamed time column
EVEN_SPREAD = 0.5  # of the usual step


def find_column(table: SignalTable, wanted: str, option: str) -> int:
    """Find a column by name, or by number from 1; raises ConfigError listing the columns."""
    names = [column.name for column in table.columns]
    bare = [split_header(name).name for name in names]
    for spelling in (names, bare, [n.lower() for n in names], [n.lower() for n in bare]):
        for text in (wanted, wanted.lower()):
            if spelling.count(text) == 1:
                return spelling.index(text)
    if wanted.isdecimal() and 1 <= int(wanted) <= len(names):
        return int(wanted) - 1
    parts = [k for k, name in enumerate(names) if wanted and wanted.lower() in name.lower()]
    if len(parts) == 1:
        return parts[0]
    what = "names several columns" if parts else "no such column"
    raise ConfigError(
        f"--{option} {wanted}: {what}; must be a name or a number from 1 to {len(names)} "
        f"({table.listing}): try --{option} {_suggested(table)}"
    )


def _suggested(table: SignalTable) -> int:
    """Number of a column that may be the signal."""
    return min(2, len(table.columns))


def is_time_name(name: str) -> bool:
    """Tell if the header of a column names time."""
    header = split_header(name)
    bare = header.name.lower().strip()
    if bare in TIME_NAMES or TIME_WORD.search(bare) is not None:
        return True
    return bare.endswith(("time", "zeit", "timestamp"))


def is_count_name(name: str) -> bool:
    """Tell if the header of a column names a count of samples."""
    bare = split_header(name).name.strip()
    match = COUNT_NAME.match(bare)
    return match is not None and COUNT_NAME_REST.match(bare[match.end() :]) is not None


def is_frequency_name(name: str) -> bool:
    """Tell if the header of a column names frequency."""
    return FREQUENCY_NAME.match(name.strip().lstrip("#% ")) is not None


def has_time_unit(name: str) -> bool:
    """Tell if the header of a column has a unit of time."""
    return time_factor(split_header(name).unit) is not None


def is_rising(values: FloatArray) -> bool:
    """Tell if values (N,) rise in most steps, or never fall but seldom."""
    steps = np.diff(values[np.isfinite(values)])
    if not steps.size:
        return False
    rising = np.mean(steps > 0)
    return bool(rising >= RISING_SHARE or (rising > 0 and np.mean(steps >= 0) >= EVEN_SHARE))


def is_even(values: FloatArray) -> bool:
    """Tell if values (N,) rise in nearly equal steps."""
    steps = np.diff(values[np.isfinite(values)])
    if steps.size < 2:
        return False
    usual = float(np.median(steps))
    if usual <= 0:
        return False
    near = np.abs(steps - usual) <= EVEN_SPREAD * usual
    return bool(np.mean(near) >= EVEN_SHARE)


def is_count(values: FloatArray) -> bool:
    """Tell if values (N,) count in ones."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(steps.size and np.mean(steps == 1.0) >= EVEN_SHARE)
