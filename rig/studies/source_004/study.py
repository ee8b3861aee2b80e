"""All runs of the study, and the agreement of every figure."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from rig.studies.source_004.robot_step import ROBOT_STEP, robot_step
from rig.studies.source_004.rule import FindingResult, RunFigures, judge
from rig.studies.source_004.runs import RunCurves, repeat
from rig.studies.source_004.spec import SourceFigure, experiments_of


class FigureResult(msgspec.Struct, frozen=True, kw_only=True):
    """Figure of the source with one result for each of its findings."""

    figure: SourceFigure
    results: tuple[FindingResult, ...]


class Source004Study(msgspec.Struct, frozen=True, kw_only=True):
    """Results of the study: figures of the source, runs, and curves by experiment."""

    figures: tuple[FigureResult, ...]
    runs: dict[str, RunFigures]
    curves: dict[str, RunCurves]


def study(figures: Sequence[SourceFigure], progress: Callable[[int], None]) -> Source004Study:
    """Run every experiment of the figures once and judge their findings.

    progress is called with the number of runs done. Raises RunFailed for a run that was stopped.
    """
    runs: dict[str, RunFigures] = {}
    curves: dict[str, RunCurves] = {}
    with tempfile.TemporaryDirectory() as scratch:
        for name in experiments_of(figures):
            if name == ROBOT_STEP:
                runs[name] = robot_step()
                progress(len(runs))
                continue
            folder = Path(scratch) / name
            folder.mkdir()
            run = repeat(name, folder)
            runs[name], curves[name] = run.figures, run.curves
            progress(len(runs))
    return Source004Study(figures=_results(figures, runs), runs=runs, curves=curves)


def _results(
    figures: Sequence[SourceFigure], runs: dict[str, RunFigures]
) -> tuple[FigureResult, ...]:
    rows = []
    for figure in figures:
        results = tuple(judge(finding, runs) for finding in figure.findings)
        rows.append(FigureResult(figure=figure, results=results))
    return tuple(rows)
