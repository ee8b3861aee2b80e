"""Results of the study of source 004 in rows, for terminal and page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from rig.studies.source_004.reasons import reason
from rig.studies.source_004.rule import BasisValue, RunFigures
from rig.studies.source_004.spec import (
    CAMERA_QUANTITIES,
    MEASURED,
    SourceFigure,
    SourceFinding,
)
from rig.studies.source_004.study import FigureResult, Source004Study

FINDING_HEADS = ("figure", "published finding", "our figures", "agrees")
RUN_HEADS = ("run", "residual swing\ntrue [mrad]", "measured\n[mrad]", "peak swing\n[mrad]")
PREFIX = "source004_"  # of the experiments, left out in tables
CAMERA_NOT_YET = "camera: not yet"
TABLE = "tab. "  # before the number of a table of the source


class ShownUnit(NamedTuple):
    """Unit, factor from the SI unit, and decimals with which a quantity is shown."""

    unit: str
    factor: float
    digits: int

    def text(self, value: float | None) -> str:
        """Format a value without its unit."""
        if value is None:
            return "-"
        return f"{value * self.factor:.{self.digits}f}".replace("-0.000", "0.000")


UNITS = {
    "residual_swing": ShownUnit("mrad", 1e3, 3),
    "tracking_swing": ShownUnit("mrad", 1e3, 3),
    "peak_swing": ShownUnit("mrad", 1e3, 1),
    "acceleration": ShownUnit("m/s²", 1.0, 2),
    "speed": ShownUnit("m/s", 1.0, 2),
    "reversal": ShownUnit("mm", 1e3, 0),
    "command_lag": ShownUnit("ms", 1e3, 1),
    "cable_length": ShownUnit("m", 1.0, 5),
    "damping_ratio": ShownUnit("", 1.0, 7),
    "natural_frequency": ShownUnit("rad/s", 1.0, 4),
    "rise_time": ShownUnit("ms", 1e3, 1),
    "bandwidth": ShownUnit("Hz", 1.0, 1),
    "fit_deviation": ShownUnit("% of the step", 1e2, 2),
    "frequency_1": ShownUnit("Hz", 1.0, 4),
    "frequency_2": ShownUnit("Hz", 1.0, 4),
}


def finding_rows(result: FigureResult, runs: Mapping[str, RunFigures]) -> list[tuple[str, ...]]:
    """List the findings of a figure under FINDING_HEADS."""
    figure = result.figure
    rows: list[tuple[str, ...]] = []
    for finding, judged in zip(figure.findings, result.results, strict=True):
        rows.append((figure.number, finding.text, our_figures(finding, runs), judged.agreement))
    return rows


def our_figures(finding: SourceFinding, runs: Mapping[str, RunFigures]) -> str:
    """Write the values of a finding on their first basis: those of its runs, then the others."""
    ours, basis = _values(finding, finding.runs, runs)
    unit = UNITS[finding.quantity].unit
    text = f"{ours} {unit}".strip()
    if finding.against:
        others, _ = _values(finding, finding.against, runs)
        text = f"{ours} against {others} {unit}"
    elif finding.bound is not None:
        text += f"; {_bound(finding)}"
    return f"{text}, {basis}{_camera_mark(finding, runs)}"


def _camera_mark(finding: SourceFinding, runs: Mapping[str, RunFigures]) -> str:
    """Mark a quantity of the camera that it did not measure in a run of a finding."""
    names = (*finding.runs, *finding.against)
    is_measured = all(MEASURED in runs[name].values[finding.quantity] for name in names)
    if finding.quantity not in CAMERA_QUANTITIES or is_measured:
        return ""
    return f"; {CAMERA_NOT_YET}"


def _bound(finding: SourceFinding) -> str:
    shown = UNITS[finding.quantity]
    word = "printed" if finding.relation == "equal" else "bound"
    return f"{word} {(finding.bound or 0.0) * shown.factor:.6g} {shown.unit}".strip()


def _values(
    finding: SourceFinding, names: Sequence[str], runs: Mapping[str, RunFigures]
) -> tuple[str, str]:
    shown = UNITS[finding.quantity]
    texts = []
    basis = ""
    for name in names:
        basis, first = next(iter(runs[name].values[finding.quantity].items()))
        texts.append(shown.text(first.value))
    return ", ".join(texts), basis


def run_rows(names: Sequence[str], runs: Mapping[str, RunFigures]) -> list[tuple[str, ...]]:
    """List true and measured residual swing, and true peak swing, of runs under RUN_HEADS."""
    rows: list[tuple[str, ...]] = []
    for name in names:
        run = runs[name]
        if "residual_swing" not in run.values:
            continue  # a step response
        residual = run.values["residual_swing"]
        measured = CAMERA_NOT_YET
        if MEASURED in residual:
            measured = _with_sigma(residual[MEASURED])
        true = UNITS["residual_swing"].text(residual["true"].value)
        peak = UNITS["peak_swing"].text(run.peak_rad)
        rows.append((short_name(name), true, measured, peak))
    return rows


def notes(study: Source004Study) -> Iterator[tuple[str, str]]:
    """Give figure and text of every assumption, and of every reason for a disagreement."""
    for row in study.figures:
        for finding, judged in zip(row.figure.findings, row.results, strict=True):
            why = reason(finding, judged)
            if why:
                yield row.figure.number, f"{judged.agreement}: {why}"
            if finding.assumption:
                yield row.figure.number, finding.assumption


def conclusion(study: Source004Study) -> str:
    """Count the findings by agreement."""
    found = [judged.agreement for row in study.figures for judged in row.results]
    counts = [f"{found.count(word)} {word}" for word in ("yes", "partly", "no")]
    return f"{len(found)} findings: {', '.join(counts)}"


def short_name(experiment: str) -> str:
    """Leave out the prefix that all experiments of the study have."""
    return experiment.removeprefix(PREFIX)


def heading(figure: SourceFigure) -> str:
    """Write number and title of a figure, a table or a section."""
    if figure.number.startswith(TABLE):
        return f"Table {figure.number.removeprefix(TABLE)}: {figure.title}"
    kind = "Section" if figure.number.count(".") > 1 else "Figure"
    return f"{kind} {figure.number}: {figure.title}"


def sentence(text: str) -> str:
    """Write a phrase as a sentence."""
    return f"{text[0].upper()}{text[1:]}."


def _with_sigma(one: BasisValue) -> str:
    shown = UNITS["residual_swing"]
    if one.value is None:
        return "not identifiable"
    return f"{one.value * shown.factor:.4f} ± {one.sigma * shown.factor:.4f}"
