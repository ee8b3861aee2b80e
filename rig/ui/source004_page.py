"""Page of the study of source 004: one HTML file with tables and a picture of each comparison."""

from __future__ import annotations

from rig.studies.source_004.study import FigureResult, Source004Study
from rig.ui.plots.inline_svg import inline_svg
from rig.ui.plots.source004 import draw_comparison
from rig.ui.report_page import Html, element, join, page, table, trusted
from rig.ui.source004_rows import (
    FINDING_HEADS,
    RUN_HEADS,
    conclusion,
    finding_rows,
    heading,
    notes,
    run_rows,
    sentence,
    short_name,
)

TITLE = "Experiments of source 004, repeated on the simulated bench"
COLOURS = {"yes": "good", "partly": "doubtful", "no": "bad"}  # classes of report_style.py


def document(found: Source004Study) -> str:
    """Write the whole page."""
    sections = [_section(found, row) for row in found.figures]
    return page(
        TITLE,
        element("header", element("h1", TITLE), element("p", sentence(conclusion(found)))),
        element("div", *sections, class_="columns"),
    )


def _section(found: Source004Study, row: FigureResult) -> Html:
    """Findings, reasons, runs and picture of one figure."""
    figure = row.figure
    head = element("h2", heading(figure))
    findings = [
        (finding, ours, element("b", agrees, class_=COLOURS[agrees]))
        for _, finding, ours, agrees in finding_rows(row, found.runs)
    ]
    of_figure = Source004Study(figures=(row,), runs=found.runs, curves=found.curves)
    texts = [element("p", text, class_="note") for _, text in notes(of_figure)]
    names = [name for name in figure.experiments if name in found.curves]
    if not names:
        return element("section", head, table(FINDING_HEADS[1:], findings), join(*texts))
    curves = {short_name(name): found.curves[name] for name in names}
    svg = trusted(inline_svg(draw_comparison(curves), f"figure {figure.number}"))
    return element(
        "section",
        head,
        table(FINDING_HEADS[1:], findings),
        join(*texts),
        element("figure", svg),
        table(RUN_HEADS, run_rows(names, found.runs)),
    )
