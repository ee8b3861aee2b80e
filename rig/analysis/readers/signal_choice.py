"""Choice of the signal column and of its unit."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from rig.analysis.readers import columns as marks
from rig.analysis.readers.errors import UnreadableData, list_names
from rig.analysis.readers.signal_record import FloatArray, ReadFinding, ReadOptions
from rig.analysis.readers.table import SignalTable
from rig.analysis.readers.time_axis import TimeAxis
from rig.analysis.readers.units import OPTION_UNITS, UNITS, UnitFactor, split_header, unit_factor
from rig.errors import ConfigError

ANGLE_NAME = re.compile(
    r"angle|theta|phi\b|alpha|winkel|swing|pendul|tilt|pitch|roll|yaw|encoder|[θφα]", re.I
)
MAGNITUDE_NAME = re.compile(r"^(abs|absolute|magnitude|norm|total)\b", re.I)
KLIPPER_NAMES = ("time", "accel_x", "accel_y", "accel_z")
CONVENTIONS = (  # units that a name implies
    (re.compile(r"linear_acceleration", re.I), "m/s2", "convention of ROS (REP 103): m/s2"),
    (re.compile(r"angular_velocity", re.I), "rad/s", "convention of ROS (REP 103): rad/s"),
)
PREFERRED_UNITS = ("none", "N", "V", "m/s", "m/s2", "rad/s", "m", "rad")  # the last one first
FULL_TURN_RAD = 2 * np.pi
SUSPECT_RAD = 1.0  # a swing beyond it may be in degrees
NONE = UnitFactor("none", 1.0)


class SignalChoice(NamedTuple):
    """Column of the signal and its unit."""

    column: int
    unit: UnitFactor
    unit_source: str
    findings: tuple[ReadFinding, ...]


def choose_signal(
    path: object, table: SignalTable, axis: TimeAxis, options: ReadOptions
) -> SignalChoice:
    """Choose the column of the signal; raises UnreadableData or ConfigError."""
    _check_unit(options)
    _refuse_spectrum(path, table)
    wanted = options.signal or options.field
    if wanted:
        option = "signal" if options.signal else "field"
        column = marks.find_column(table, wanted, option)
        if column == axis.column and options.rate_hz is None:
            raise ConfigError(
                f"--{option} {wanted}: column {table.label(column)} is the time; must be another "
                f"one ({table.listing}): leave it out, or set --time too"
            )
        unit, source = _unit(table, column, options)
        return SignalChoice(column, unit, source, ())
    candidates = _candidates(table, axis)
    if not candidates:
        raise UnreadableData(
            f"{path}: no column with a signal beside the time ({table.listing}); "
            "the others are constant, empty, text or counts: choose with --signal"
        )
    column = _preferred(table, candidates)
    unit, source = _unit(table, column, options)
    return SignalChoice(column, unit, source, tuple(_others(table, candidates, column)))


def _check_unit(options: ReadOptions) -> None:
    if options.unit and options.unit not in OPTION_UNITS:
        raise ConfigError(
            f"--unit {options.unit}; must be one of {', '.join(OPTION_UNITS)}: "
            "take none for another unit"
        )


def _refuse_spectrum(path: object, table: SignalTable) -> None:
    """Raise UnreadableData for a table over frequency."""
    first = table.columns[0]
    if not marks.is_frequency_name(first.name) or not marks.is_rising(first.values):
        return
    if any(marks.is_time_name(column.name) for column in table.columns):
        return
    rest = [column.name for column in table.columns[1:]]
    psd = "a power spectral density" if any("psd" in name.lower() for name in rest) else "a table"
    raise UnreadableData(
        f"{path}: a spectrum: {psd} over frequency (column 1 '{first.name}'; then "
        f"{list_names(rest)}); must be a signal over time: record the raw samples, with Klipper "
        "by ACCELEROMETER_MEASURE or TEST_RESONANCES OUTPUT=raw_data"
    )


def _candidates(table: SignalTable, axis: TimeAxis) -> list[int]:
    """List the columns that may be the signal: those with a unit, else all that vary."""
    varying = []
    for index, column in enumerate(table.columns):
        is_other = index == axis.column or column.is_time or _is_time_or_count(table, index)
        if not is_other and _variance(column.values) > 0:
            varying.append(index)
    for test in (_has_unit, _is_named):
        chosen = [k for k in varying if test(table, k)]
        if chosen:
            varying = chosen
            break
    parts = [k for k in varying if not MAGNITUDE_NAME.match(table.columns[k].name)]
    return parts or varying


def _is_time_or_count(table: SignalTable, index: int) -> bool:
    column = table.columns[index]
    is_count = marks.is_count_name(column.name) or not column.name
    if is_count and marks.is_count(column.values):
        return True
    if not column.name and marks.is_even(column.values):
        return True
    is_time = marks.is_time_name(column.name) or marks.has_time_unit(column.name)
    return is_time and marks.is_rising(column.values)


def _has_unit(table: SignalTable, index: int) -> bool:
    return unit_factor(split_header(table.columns[index].name).unit) is not None


def _is_angle(table: SignalTable, index: int) -> bool:
    return ANGLE_NAME.search(table.columns[index].name) is not None


def _is_named(table: SignalTable, index: int) -> bool:
    """Tell if the name of a column implies a unit."""
    name = table.columns[index].name
    implied = [pattern.search(name) is not None for pattern, _, _ in CONVENTIONS]
    return any(implied) or _is_angle(table, index)


def _variance(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    if finite.size < 2 or finite.min() == finite.max():
        return 0.0
    return float(np.var(finite))


def _preferred(table: SignalTable, candidates: list[int]) -> int:
    """Find the column of the unit that a swing is best seen in, and of the largest variance.

    The first of equal ones.
    """

    def rank(index: int) -> tuple[int, float]:
        column = table.columns[index]
        unit, _ = _unit(table, index, ReadOptions())
        order = PREFERRED_UNITS.index(unit.si) if unit.si in PREFERRED_UNITS else -1
        return order, _variance(column.values) * unit.factor**2

    return max(candidates, key=rank)


def _others(table: SignalTable, candidates: list[int], column: int) -> list[ReadFinding]:
    others = [table.label(k) for k in candidates if k != column]
    if not others:
        return []
    text = (
        f"column {table.label(column)} is taken; others that may be meant: "
        f"{list_names(others)}: choose with --signal"
    )
    return [ReadFinding("other_columns", text, len(others))]


def _unit(table: SignalTable, column: int, options: ReadOptions) -> tuple[UnitFactor, str]:
    """Find the unit of a column, and say where it comes from."""
    if options.unit:
        return OPTION_UNITS[options.unit], f"option --unit {options.unit}"
    name = table.columns[column].name
    names = tuple(other.name.lower().lstrip("#") for other in table.columns)
    if names[:4] == KLIPPER_NAMES and column > 0:
        return UNITS["mm/s2"], "raw data of a Klipper accelerometer: mm/s2"
    written = split_header(name).unit
    unit = unit_factor(written)
    if unit is not None:
        return unit, f"header '{name}'"
    for pattern, key, source in CONVENTIONS:
        if pattern.search(name):
            return UNITS[key], source
    if table.unit_hint is not None:
        hinted = unit_factor(table.unit_hint.value)
        if hinted is not None:
            return hinted, table.unit_hint.source
    if _is_angle(table, column):
        return UNITS["rad"], f"assumed: '{name}' has no unit; set it with --unit"
    return NONE, "assumed: the file names no unit; set it with --unit"


def check_radians(path: object, values_rad: FloatArray, source: str) -> list[ReadFinding]:
    """Find degrees that are given as radians.

    Raises UnreadableData beyond a full turn; a swing above 1 rad is a finding.
    """
    peak_rad = float(np.max(np.abs(values_rad)))
    if peak_rad > FULL_TURN_RAD:
        raise UnreadableData(
            f"{path}: angles up to {peak_rad:.4g} rad (unit: {source}); must be below a full turn, "
            "6.28 rad: these are degrees, give --unit deg"
        )
    swing_rad = float(np.max(np.abs(values_rad - np.median(values_rad))))
    if swing_rad <= SUSPECT_RAD:
        return []
    text = f"swing up to {swing_rad:.3g} rad (unit: {source}): if these are degrees, --unit deg"
    return [ReadFinding("degrees_suspected", text)]
