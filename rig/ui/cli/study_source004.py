"""`rig study source004`: the experiments of source 004, repeated in virtual time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import counting, print_json
from rig.ui.cli.page import (
    Column,
    PageTable,
    out,
    plain_table,
    print_paragraph,
    print_table,
    print_written,
)

if TYPE_CHECKING:
    from rig.studies.source_004.rule import RunFigures
    from rig.studies.source_004.study import FigureResult, Source004Study

LEGEND = (
    "Residual swing: amplitude after the move, true and from the camera ± its noise. Findings are "
    "in our words; an agreement is computed on every basis of a value, true and measured, planned "
    "and reached. yes: every comparison holds; partly: some; no: none. Of several links the camera "
    "sees the first one, whose free swing shows the modes. camera: not yet: their peak swing is "
    "that of a link which the camera does not see, and is judged by the truth alone."
)


def source004(
    only: Annotated[
        str | None,
        typer.Option(
            help="Figures, tables or experiments, e.g. 3.33,'tab. 4.3', with commas between them; "
            "all by default."
        ),
    ] = None,
    page: Annotated[
        Path | None, typer.Option(help="HTML file with tables and a picture of every comparison.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Repeat the experiments of source 004 and compare their findings with our figures."""
    from rig.studies.source_004.spec import choose, experiments_of
    from rig.studies.source_004.study import study

    if page is not None:
        from rig.ui.plots.picture_file import check_folder

        check_folder("--page", page)
    words = [word.strip() for word in (only or "").split(",") if word.strip()]
    figures = choose(words)
    total = len(experiments_of(figures))
    with counting("runs in virtual time", total, quiet=as_json) as progress:
        found = study(figures, progress)
    if page is not None:
        from rig.ui.source004_page import document  # matplotlib is slow to import

        page.write_text(document(found), encoding="utf-8")
    if as_json:
        print_json(_document(found))
    else:
        _print(found)
        print_written(page)
    return 0


def _document(found: Source004Study) -> dict[str, Any]:
    figures = [_figure_document(row) for row in found.figures]
    runs = {name: run.values for name, run in found.runs.items()}
    without = [name for name, run in found.runs.items() if _is_unseen(run)]
    return {"exit_status": "ok", "figures": figures, "runs": runs, "runs_without_camera": without}


def _is_unseen(run: RunFigures) -> bool:
    """Tell if the run has a swing, and no camera measured it."""
    return "measured" not in run.values.get("residual_swing", {"measured": None})


def _figure_document(row: FigureResult) -> dict[str, Any]:
    from rig.studies.source_004.reasons import reason

    findings = []
    for finding, judged in zip(row.figure.findings, row.results, strict=True):
        findings.append(
            {
                "text": finding.text,
                "quantity": finding.quantity,
                "relation": finding.relation,
                "runs": finding.runs,
                "against": finding.against,
                "bound": finding.bound,
                "agreement": judged.agreement,
                "reason": reason(finding, judged),
                "assumption": finding.assumption,
                "checks": judged.checks,
            }
        )
    figure = row.figure
    head = {"number": figure.number, "title": figure.title}
    return {**head, "findings": findings}


def _print(found: Source004Study) -> None:
    from rig.ui import source004_rows as rows

    if found.runs:
        print_table(_run_table(found))
        out.print()
    print_table(_finding_table(found))
    for number, text in rows.notes(found):
        print_paragraph(f"{number}  {text}", indent="      ")
    print_paragraph(LEGEND, "dim")
    print_paragraph(rows.conclusion(found), "bold")


def _run_table(found: Source004Study) -> PageTable:
    from rig.ui.source004_rows import RUN_HEADS, run_rows

    table = plain_table("runs, of the experiments source004_...", RUN_HEADS)
    for row in run_rows(tuple(found.runs), found.runs):
        table.add_row(*row)
    return table


def _finding_table(found: Source004Study) -> PageTable:
    from rig.ui.source004_rows import FINDING_HEADS, finding_rows

    number, finding, ours, agrees = FINDING_HEADS
    columns = (number, Column(finding, folds=True), Column(ours, folds=True), agrees)
    table = plain_table("findings of source 004", columns, left=len(columns))
    for result in found.figures:
        for row in finding_rows(result, found.runs):
            table.add_row(*row)
    return table
