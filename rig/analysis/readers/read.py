"""The way from a file to one signal over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rig.analysis.readers.cleaning import clean
from rig.analysis.readers.errors import UnreadableData
from rig.analysis.readers.sampling import (
    noise_floor,
    quantum,
    sampling_findings,
    usual_rate_hz,
    value_findings,
)
from rig.analysis.readers.signal_choice import SignalChoice, check_radians, choose_signal
from rig.analysis.readers.signal_record import FloatArray, ReadFinding, ReadOptions, SignalRecord
from rig.analysis.readers.table import SignalTable
from rig.analysis.readers.table_file import read_table
from rig.analysis.readers.time_axis import TimeAxis, time_axis

MIN_SAMPLES = 8


def read_signal(path: Path, options: ReadOptions | None = None) -> SignalRecord:
    """Read one signal over time from a file, a log or a run folder.

    Raises UnreadableData for a file without such a signal, with what was found and what to try,
    and ConfigError for an option that does not fit.
    """
    options = options or ReadOptions()
    table = read_table(path, options)
    with np.errstate(over="ignore", invalid="ignore"):  # of damaged numbers near 1e308
        axis = time_axis(path, table, options)
        choice = choose_signal(path, table, axis, options)
        return _record(path, table, axis, choice)


def _record(path: Path, table: SignalTable, axis: TimeAxis, choice: SignalChoice) -> SignalRecord:
    raw = table.columns[choice.column].values
    used = {choice.column, axis.column}
    bad_cells = [cell for cell in table.bad_cells if cell.column in used]
    samples = clean(axis.t_s, raw, bad_cells)
    if samples.t_s.size < MIN_SAMPLES:
        raise UnreadableData(
            f"{path}: {samples.t_s.size} of {raw.size} samples of column "
            f"{table.label(choice.column)} can be used; must be at least {MIN_SAMPLES} "
            f"({_texts(samples.findings) or table.listing}): try another --signal or --time"
        )
    step = quantum(samples.values)
    values = samples.values * choice.unit.factor
    findings = [*table.findings, *axis.findings, *choice.findings, *samples.findings]
    findings += sampling_findings(samples.t_s)
    findings += value_findings(samples.values, step)
    findings += _radian_findings(path, values, choice)
    return SignalRecord(
        path=path,
        kind=table.kind,
        layout=table.layout,
        t_s=samples.t_s,
        values=values,
        unit=choice.unit.si,
        unit_source=choice.unit_source,
        time_source=axis.source,
        signal_source=f"column {table.label(choice.column)}",
        origin_s=axis.origin_s,
        rate_hz=usual_rate_hz(samples.t_s),
        columns=table.labels,
        rows=int(raw.size),
        dropped_rows=int(raw.size - samples.t_s.size),
        quantum=step * choice.unit.factor,
        noise_floor=noise_floor(values, step * choice.unit.factor),
        findings=tuple(findings),
    )


def _radian_findings(path: Path, values: FloatArray, choice: SignalChoice) -> list[ReadFinding]:
    """Check an angle for degrees given as radians; one in degrees is converted already."""
    is_radian = choice.unit.si == "rad" and bool(np.isclose(choice.unit.factor, 1.0))
    return check_radians(path, values, choice.unit_source) if is_radian else []


def _texts(findings: list[ReadFinding]) -> str:
    return "; ".join(finding.text for finding in findings)
