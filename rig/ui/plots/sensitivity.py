"""Figure of the sensitivity curves: residual vibration versus parameter error."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from rig.studies.thesis_tables.curves import FAMILIES, LOADS, SensitivityCurve
from rig.ui.plots import picture_file
from rig.ui.plots.style import BLUE, GREEN, INK, RED, SHADE, style_axes

PANEL_WIDTH_IN = 3.2
PANEL_HEIGHT_IN = 2.1
SHADED_REL = 0.05  # usual uncertainty of such a parameter, relative to its nominal value
TOP_MRAD = 90.0  # of all panels: the largest residual of the plans without robustness
COLOURS = {2.5: GREEN, 2.0: BLUE, 1.5: RED}  # by duration of the move [s]


def draw(document: dict[str, SensitivityCurve], path: Path) -> None:
    """Draw the sensitivity curves into a .svg, .png or .pdf file.

    Raises ConfigError for another ending, OSError when the file cannot be written.
    """
    picture_file.save(sheet(document), path)


def sheet(document: dict[str, SensitivityCurve]) -> Figure:
    """Draw the sensitivity curves: a row for each family, a column for each load and parameter.

    Linear load solid, nonlinear load dashed; +-5 % around the nominal value shaded.
    """
    families = list(dict.fromkeys(series.family for series in document.values()))
    columns = list(dict.fromkeys((series.load, series.parameter) for series in document.values()))
    size_in = (PANEL_WIDTH_IN * len(columns), PANEL_HEIGHT_IN * len(families))
    figure = Figure(figsize=size_in, layout="constrained")
    panels = figure.subplots(len(families), len(columns), sharex="col", sharey=True, squeeze=False)
    panels[0, 0].set_ylim(0.0, TOP_MRAD)
    for series in document.values():
        row = families.index(series.family)
        column = columns.index((series.load, series.parameter))
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
        Line2D([], [], color=INK, ls=style, label=name)
        for name, style in (("linear load", "-"), ("nonlinear load", "--"))
    ]
    figure.legend(handles=lines, loc="outside lower center", ncols=len(lines), frameon=False)
    title = f"Residual swing versus parameter error, ±{SHADED_REL * 100:g} % shaded"
    figure.suptitle("\n".join([title, *_remarks(document)]), fontsize=10)
    return figure


def _add(axes: Axes, series: SensitivityCurve) -> None:
    if not axes.lines:
        low = series.nominal * (1.0 - SHADED_REL)
        high = series.nominal * (1.0 + SHADED_REL)
        axes.axvspan(low, high, color=SHADE, lw=0)
        style_axes(axes)
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
    if not FAMILIES[family].robust:
        return words
    parameters = " / ".join(load.robust for load in LOADS.values())
    return f"{words}\nto {parameters}"


def _remarks(document: dict[str, SensitivityCurve]) -> Iterator[str]:
    """Describe curves above TOP_MRAD, and plans above it without parameter error."""
    yield (
        f"Curves are cut at {TOP_MRAD:g} mrad; "
        "`rig compare sensitivity --json` gives all their values."
    )
    large: dict[str, float] = {}
    for series in document.values():
        residual_rad = np.interp(series.nominal, series.values, series.residual_nonlinear_rad)
        residual_mrad = 1e3 * float(residual_rad)
        if residual_mrad > TOP_MRAD:
            plan = f"{series.load} {series.family} {series.time_s:g} s".replace("_", " ")
            large[plan] = residual_mrad
    if large:
        named = ", ".join(f"{plan}: {mrad:.0f} mrad" for plan, mrad in large.items())
        yield f"Residual swing of the nonlinear load without parameter error: {named}."


def _unit(parameter: str) -> str:
    return "m" if parameter.startswith("length") else "N m/rad"
