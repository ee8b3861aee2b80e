"""Samples that can be used: finite values at rising instants; what is left out is reported."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.readers.errors import counted
from rig.analysis.readers.signal_record import FloatArray, ReadFinding
from rig.analysis.readers.table import BadCell

BoolArray = npt.NDArray[np.bool_]
SHOWN_ROWS = 5
KEPT_SHARE = 0.9  # below it the longest part without a step back is taken
COARSE_SHARE = 0.1  # of repeated stamps: the clock is coarser than the samples
SHOWN_CHARACTERS = 20


class CleanSamples(NamedTuple):
    """Samples left, and what was left out."""

    t_s: FloatArray  # (N,) strictly increasing
    values: FloatArray  # (N,)
    findings: list[ReadFinding]


def clean(t_s: FloatArray, values: FloatArray, bad_cells: Sequence[BadCell]) -> CleanSamples:
    """Leave out samples (N,) without a number and stamps that do not rise."""
    finite = np.isfinite(t_s) & np.isfinite(values)
    findings = _bad_cell_findings(bad_cells, finite)
    rows = np.flatnonzero(finite) + 1
    t_s = t_s[finite]
    values = values[finite]
    rising, order = _rising(t_s, rows)
    return CleanSamples(t_s[rising], values[rising], findings + order)


def _bad_cell_findings(cells: Sequence[BadCell], finite: BoolArray) -> list[ReadFinding]:
    """Report cells with text, empty cells, and numbers that are not finite."""
    findings = []
    texts = [cell for cell in cells if cell.text]
    if texts:
        first = texts[0]
        text = (
            f"{counted(len(texts), 'cell')} with text, the first: row {first.row}, "
            f"column {first.column + 1}, '{first.text[:SHOWN_CHARACTERS]}'; left out"
        )
        shown = tuple(sorted({cell.row for cell in texts})[:SHOWN_ROWS])
        findings.append(ReadFinding("text_cells", text, len(texts), shown))
    is_text = np.zeros(finite.size, dtype=bool)
    for cell in texts:
        is_text[cell.row - 1] = True
    rows = np.flatnonzero(~finite & ~is_text) + 1
    if rows.size:
        shown = _shown(rows)
        text = (
            f"{counted(rows.size, 'row')} without a finite number (empty, NaN or infinite), "
            f"the first: row {shown[0]}; left out"
        )
        findings.append(ReadFinding("non_finite", text, int(rows.size), shown))
    return findings


def _rising(t_s: FloatArray, rows: npt.NDArray[np.int64]) -> tuple[BoolArray, list[ReadFinding]]:
    """Mark the samples at rising stamps, and report repeated and backward ones."""
    keep = np.ones(t_s.size, dtype=bool)
    steps = np.diff(t_s)
    if not np.any(steps <= 0):
        return keep, []
    before = np.maximum.accumulate(t_s)[:-1]
    keep[1:] = t_s[1:] > before
    findings = _repeats(rows[1:][steps == 0], t_s.size)
    back = np.flatnonzero(steps < 0)
    if back.size:
        is_part = np.mean(keep | np.append(False, steps == 0)) < KEPT_SHARE
        if is_part:
            keep = _longest_part(t_s, back)
        findings.append(_backward(t_s, rows, back, keep, bool(is_part)))
    return keep, findings


def _repeats(rows: npt.NDArray[np.int64], total: int) -> list[ReadFinding]:
    if not rows.size:
        return []
    shown = _shown(rows)
    text = f"{counted(rows.size, 'repeated stamp')}, the first: row {shown[0]}; left out"
    if rows.size > COARSE_SHARE * total:
        text += "; the clock is coarser than the sampling: better give --rate HZ"
    return [ReadFinding("repeated_stamps", text, int(rows.size), shown)]


def _longest_part(t_s: FloatArray, back: npt.NDArray[np.int64]) -> BoolArray:
    """Mark the longest part of stamps (N,) without a step back; back: last index before one."""
    edges = np.concatenate([[0], back + 1, [t_s.size]])
    longest = int(np.argmax(np.diff(edges)))
    keep = np.zeros(t_s.size, dtype=bool)
    first, end = int(edges[longest]), int(edges[longest + 1])
    keep[first:end] = np.append(True, np.diff(t_s[first:end]) > 0)
    return keep


def _backward(
    t_s: FloatArray,
    rows: npt.NDArray[np.int64],
    back: npt.NDArray[np.int64],
    keep: BoolArray,
    is_part: bool,
) -> ReadFinding:
    places = rows[back + 1]
    shown = _shown(places)
    step_s = t_s[back[0] + 1] - t_s[back[0]]
    times = counted(back.size, "time")
    text = f"time steps back {times}, the first: row {shown[0]}, by {-step_s:.4g} s"
    if is_part:
        kept = rows[keep]
        text += (
            f"; the longest part without a step back is used, rows {kept[0]} to {kept[-1]}: "
            "if the samples follow each other evenly, give --rate HZ"
        )
    else:
        text += "; rows that are not later than all before are left out"
    return ReadFinding("backward_stamps", text, int(back.size), shown)


def _shown(rows: npt.NDArray[np.int64]) -> tuple[int, ...]:
    return tuple(int(row) for row in rows[:SHOWN_ROWS])
