"""Plot of the sensitivity curves: residual vibration versus parameter error."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from rig.studies.thesis_tables.curves import FAMILIES, LOADS, SensitivityCurve
from rig.ui.plots import picture_file

PANEL_WIDE, PANEL_TALL = 3.2, 2.1  # inches
NEAR = 0.05  # share of the nominal value that is shaded: how well such a parameter is usually known
TOP_MRAD = (
    90.0  # one scale for all panels: the simple plans' worst; what leaves it is in the document
)
COLOURS = {2.5: "#2e7d32", 2.0: "#1565c0", 1.5: "#c62828"}


def draw(document: dict[str, SensitivityCurve], path: Path) -> None:
    """Draw the document into a .svg, .png or .pdf file: a row for each family, a column for each load and parameter.

    Raises ConfigError for another ending, OSError when the file cannot be written.
    """
    picture_file.save(sheet(document), path)


def sheet(document: dict[str, SensitivityCurve]) -> Figure:
    """The document as a figure: small swings solid, nonlinear dashed, +-5 % shaded."""
    families = list(dict.fromkeys(series.family for series in document.values()))
    columns = list(dict.fromkeys((series.load, series.parameter) for series in document.values()))
    figure = Figure(
        figsize=(PANEL_WIDE * len(columns), PANEL_TALL * len(families)), layout="constrained"
    )
    panels = figure.subplots(len(families), len(columns), sharex="col", sharey=True, squeeze=False)
    panels[0, 0].set_ylim(0.0, TOP_MRAD)
    for series in document.values():
        row, column = families.index(series.family), columns.index((series.load, series.parameter))
        _add(panels[row, column], series)
    for family, axes in zip(families, panels[:, 0], strict=True):
        axes.set_ylabel(f"{_label(family)}\nresidual [mrad]")
    for (load, parameter), top, bottom in zip(columns, panels[0], panels[-1], strict=True):
        top.set_title(load.replace("_", " "), fontsize=10)
        bottom.set_xlabel(f"{parameter} [{_unit(parameter)}]")
    lines = [
        Line2D([], [], color=colour, label=f"{time_s:g} s") for time_s, colour in COLOURS.items()
    ]
    lines += [
        Line2D([], [], color="#444", ls=style, label=name)
        for name, style in (("small swings", "-"), ("true load", "--"))
    ]
    figure.legend(handles=lines, loc="outside lower center", ncols=len(lines), frameon=False)
    title = f"Swing left by a wrong parameter, ±{NEAR * 100:g} % of it shaded"
    figure.suptitle("\n".join([title, *_remarks(document)]), fontsize=10)
    return figure


def _add(axes: Axes, series: SensitivityCurve) -> None:
    if not axes.lines:
        axes.axvspan(
            series.nominal * (1.0 - NEAR), series.nominal * (1.0 + NEAR), color="#00000014", lw=0
        )
        axes.grid(alpha=0.25, lw=0.5)
        axes.set_xlim(series.values[0], series.values[-1])
    colour = COLOURS.get(series.time_s)
    axes.plot(
        series.values,
        1e3 * np.array(series.residual_rad),
        color=colour,
        lw=1.3,
        label=f"{series.time_s:g} s",
    )
    axes.plot(
        series.values, 1e3 * np.array(series.residual_nonlinear_rad), color=colour, lw=1.0, ls="--"
    )


def _label(family: str) -> str:
    words = family.replace("_", " ")
    return (
        f"{words}\nto {' / '.join(load.robust for load in LOADS.values())}"
        if FAMILIES[family].robust
        else words
    )


def _remarks(document: dict[str, SensitivityCurve]) -> Iterator[str]:
    """Where curves left the panels, and which plans leave them although nothing is wrong."""
    left = {
        f"{series.load} {series.family} {series.time_s:g} s".replace("_", " "): mrad
        for series in document.values()
        if (
            mrad := 1e3
            * float(np.interp(series.nominal, series.values, series.residual_nonlinear_rad))
        )
        > TOP_MRAD
    }
    yield f"Curves that leave the panels at {TOP_MRAD:g} mrad are whole in `rig compare sensitivity --json`."
    if left:
        named = ", ".join(f"{plan} leaves {mrad:.0f} mrad" for plan, mrad in left.items())
        yield f"On the true load, which is not linear, even with nothing wrong: {named}."


def _unit(parameter: str) -> str:
    return "m" if parameter.startswith("length") else "N m/rad"
