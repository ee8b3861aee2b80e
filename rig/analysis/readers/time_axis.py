"""Time of the samples: from a column, or from the sampling rate."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rig.analysis.readers import columns as marks
from rig.analysis.readers.errors import UnreadableData
from rig.analysis.readers.signal_record import FloatArray, ReadFinding, ReadOptions
from rig.analysis.readers.table import SignalTable
from rig.analysis.readers.units import TIME_NAMES, split_header, time_factor
from rig.errors import ConfigError

SLOW_STEP_S = 1.0  # samples further apart suggest another unit than seconds
EPOCHS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))  # stamps since 1970 in ns, us, ms
STEPS = ((1e6, 1e-9), (1e3, 1e-6), (1.0, 1e-3))  # usual steps in ns, us, ms
EPOCH_S = (1.2e9, 2.5e9)  # stamps since 1970 in s, of the years 2008 to 2049
EPOCH_STEP_S = 60.0
DATE_S = 1e8  # later stamps are dates: their origin is taken off
RATE_MISMATCH_REL = 0.01


class TimeAxis(NamedTuple):
    """Instants of the rows, not yet cleaned."""

    t_s: FloatArray  # (N,)
    column: int | None  # None where the rate is given
    source: str
    origin_s: float
    findings: tuple[ReadFinding, ...] = ()


def time_axis(path: object, table: SignalTable, options: ReadOptions) -> TimeAxis:
    """Find the instants of the rows; raises UnreadableData or ConfigError."""
    _check_rate(options)
    column = _time_column(path, table, options)
    if options.rate_hz is not None:
        return _at_rate(table, options.rate_hz, "option --rate", column)
    if column is not None:
        return _of_column(table, column)
    if table.rate_hz is not None:
        return _at_rate(table, table.rate_hz, table.rate_source, None)
    raise UnreadableData(_no_time(path, table))


def _check_rate(options: ReadOptions) -> None:
    if options.rate_hz is None:
        return
    if not 0 < options.rate_hz < np.inf:
        raise ConfigError(
            f"--rate {options.rate_hz:g}; must be > 0: give the sampling rate in hertz"
        )
    if options.time:
        raise ConfigError("--time and --rate; must be one of them: leave out --rate")


def _no_time(path: object, table: SignalTable) -> str:
    counting = [table.label(k) for k, c in enumerate(table.columns) if marks.is_count(c.values)]
    count = f" (column {counting[0]} counts the samples)" if counting else ""
    return (
        f"{path}: no column of time and no sampling rate{count}; {table.listing}: "
        "try --rate HZ with the sampling rate, or --time 1"
    )


def _time_column(path: object, table: SignalTable, options: ReadOptions) -> int | None:
    """Find the column of time; None without one."""
    if options.time:
        column = marks.find_column(table, options.time, "time")
        if not marks.is_rising(table.columns[column].values):
            raise UnreadableData(
                f"{path}: --time {options.time}: column {table.label(column)} does not rise; "
                f"time must rise ({table.listing}): try another column, or --rate HZ"
            )
        return column
    for test in (_is_stamp, _is_named, _is_in_seconds):
        found = [k for k in range(len(table.columns)) if test(table, k)]
        if found:
            return found[0]
    even = [k for k in range(len(table.columns)) if _is_even_time(table, k)]
    return even[0] if even and len(table.columns) > 1 else None


def _is_stamp(table: SignalTable, index: int) -> bool:
    return table.columns[index].is_time and marks.is_rising(table.columns[index].values)


def _is_named(table: SignalTable, index: int) -> bool:
    column = table.columns[index]
    return marks.is_time_name(column.name) and marks.is_rising(column.values)


def _is_in_seconds(table: SignalTable, index: int) -> bool:
    column = table.columns[index]
    return marks.has_time_unit(column.name) and marks.is_rising(column.values)


def _is_even_time(table: SignalTable, index: int) -> bool:
    column = table.columns[index]
    if marks.is_count_name(column.name) or marks.is_count(column.values):
        return False
    return marks.is_even(column.values)


def _at_rate(table: SignalTable, rate_hz: float, source: str, column: int | None) -> TimeAxis:
    rows = len(table.columns[0].values)
    findings = []
    if column is not None:
        findings = _rate_mismatch(table, column, rate_hz)
    t_s = np.arange(rows) / rate_hz
    return TimeAxis(t_s, column, f"{rate_hz:g} Hz, {source}", 0.0, tuple(findings))


def _rate_mismatch(table: SignalTable, column: int, rate_hz: float) -> list[ReadFinding]:
    found = _of_column(table, column)
    step_s = _usual_step(found.t_s)
    if step_s <= 0 or abs(rate_hz * step_s - 1) <= RATE_MISMATCH_REL:
        return []
    text = (
        f"--rate {rate_hz:g} is used; the time column {table.label(column)} says "
        f"{1 / step_s:.6g} Hz"
    )
    return [ReadFinding("rate_mismatch", text)]


def _of_column(table: SignalTable, index: int) -> TimeAxis:
    column = table.columns[index]
    label = f"column {table.label(index)}"
    if column.is_time:
        t_s, origin_s = _without_date(column.values)
        return TimeAxis(t_s, index, label, origin_s + table.origin_s)
    unit = split_header(column.name).unit
    factor = time_factor(unit) if unit else None
    findings: list[ReadFinding] = []
    if factor is None:
        factor = _plausible_factor(column.values)
        findings = _factor_finding(label, column.values, factor)
        words = f"{TIME_NAMES[factor]} assumed"
    else:
        findings = _slow_finding(label, column.values * factor)
        words = f"unit {unit} in its header"
    first = _first(column.values)
    if abs(first) * factor < DATE_S:
        return TimeAxis(column.values * factor, index, f"{label}, {words}", 0.0, tuple(findings))
    t_s = (column.values - first) * factor
    return TimeAxis(t_s, index, f"{label}, {words}", first * factor, tuple(findings))


def _without_date(t_s: FloatArray) -> tuple[FloatArray, float]:
    first = _first(t_s)
    return (t_s - first, first) if abs(first) >= DATE_S else (t_s, 0.0)


def _first(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite[0]) if finite.size else 0.0


def _usual_step(values: FloatArray) -> float:
    steps = np.diff(values[np.isfinite(values)])
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else 0.0


def _plausible_factor(values: FloatArray) -> float:
    """Find the factor to seconds that makes a plausible rate of stamps without unit."""
    step = _usual_step(values)
    first = _first(values)
    is_date = EPOCH_S[0] < first < EPOCH_S[1] and step < EPOCH_STEP_S
    if step < SLOW_STEP_S or is_date:
        return 1.0
    for least, factor in EPOCHS:
        if first > least:
            return factor
    for least, factor in STEPS:
        if step >= least:
            return factor
    return 1.0


def _factor_finding(label: str, values: FloatArray, factor: float) -> list[ReadFinding]:
    if factor == 1.0:
        return []
    step = _usual_step(values)
    if abs(_first(values)) * factor > DATE_S:
        text = (
            f"{label} has no unit; its stamps are taken as {TIME_NAMES[factor]} since 1970 "
            f"({1 / (step * factor):.6g} Hz)"
        )
        return [ReadFinding("time_unit_assumed", text)]
    text = (
        f"{label} has no unit; its usual step of {step:g} is taken as {TIME_NAMES[factor]} "
        f"({1 / (step * factor):.6g} Hz); in seconds it would be {1 / step:.3g} Hz: "
        f"if so, give --rate {1 / step:.6g}"
    )
    return [ReadFinding("time_unit_assumed", text)]


def _slow_finding(label: str, t_s: FloatArray) -> list[ReadFinding]:
    step_s = _usual_step(t_s)
    if step_s < SLOW_STEP_S:
        return []
    text = (
        f"{label} gives a sample every {step_s:g} s; if its numbers are milliseconds, "
        f"give --rate {1000 / step_s:.6g}"
    )
    return [ReadFinding("slow_rate", text)]
