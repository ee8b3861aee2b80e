"""What a plan leaves on a load that is not the planned one: the source's sensitivity figures, as numbers and drawn."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from planners.catalog import plan
from planners.models.model import Model
from planners.problem import Problem
from planners.sensitivity import residual_amplitudes
from planners.trajectory import Trajectory
from rig import picture_file
from rig.compare.loads import PENDULUM, TWO_BARS

DISTANCE_M = 0.2
POINTS = 49  # of a curve, the nominal value among them
PANEL_WIDE, PANEL_TALL = 3.2, 2.1  # inches
NEAR = 0.05  # share of the nominal value that is shaded: how well such a parameter is usually known
TOP_MRAD = 90.0  # one scale for all panels: the simple plans' worst; what leaves it is in the document
COLOURS = {2.5: "#2e7d32", 2.0: "#1565c0", 1.5: "#c62828"}


class Load(NamedTuple):
    """A load of the source, the parameters that may be wrong with their lowest and highest value, and one to be robust in."""

    model: Model
    ranges: dict[str, tuple[float, float]]
    robust: str  # any that moves the frequencies gives the same plan


class Family(NamedTuple):
    """A planner with its options, and the times the source gives it."""

    planner: str
    times_s: tuple[float, ...]
    input: str = "acceleration"
    robust: bool = False


LOADS = {
    "pendulum": Load(PENDULUM, {"length": (0.7, 1.3)}, "length"),
    "two_bars": Load(TWO_BARS, {"length_1": (0.35, 0.65), "length_2": (0.35, 0.65), "stiffness_1": (5.0, 15.0)}, "length_2"),
}
FAMILIES = {
    "simple": Family("convolution", (2.5, 2.0, 1.5)),
    "robust": Family("convolution", (2.5, 2.0, 1.5), robust=True),
    "jerk": Family("convolution", (2.0, 1.5), input="jerk"),
    "robust_jerk": Family("convolution", (2.0, 1.5), input="jerk", robust=True),
    "ZV": Family("zv", (2.5, 2.0, 1.5)),
    "ZVD": Family("zvd", (2.5,)),  # the shaper alone lasts 2.01 s, that of the bars 2.03 s
}


class Series(msgspec.Struct, frozen=True, kw_only=True):
    """Swing left at the end of one plan over the values of one parameter."""

    load: str
    family: str
    time_s: float
    parameter: str
    nominal: float
    values: list[float]  # SI
    residual_rad: list[float]  # small swings
    residual_nonlinear_rad: list[float]


def sensitivity_document() -> dict[str, Series]:
    """Every curve by its name, e.g. "pendulum.robust_T2.length" (source 004, sections 3.2 and 4.3; 0.2 m from rest to rest)."""
    return {
        f"{load}.{family}_T{time_s:g}.{series.parameter}": series
        for load in LOADS
        for family, kind in FAMILIES.items()
        for time_s in kind.times_s
        for series in _series(load, family, time_s)
    }


def draw(document: dict[str, Series], path: Path) -> None:
    """Draw the document into a .svg, .png or .pdf file: a row for each family, a column for each load and parameter.

    Raises ConfigError for another ending, OSError when the file cannot be written.
    """
    picture_file.save(sheet(document), path)


def sheet(document: dict[str, Series]) -> Figure:
    """The document as a figure: small swings solid, nonlinear dashed, +-5 % shaded."""
    families = list(dict.fromkeys(series.family for series in document.values()))
    columns = list(dict.fromkeys((series.load, series.parameter) for series in document.values()))
    figure = Figure(figsize=(PANEL_WIDE * len(columns), PANEL_TALL * len(families)), layout="constrained")
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
    lines = [Line2D([], [], color=colour, label=f"{time_s:g} s") for time_s, colour in COLOURS.items()]
    lines += [
        Line2D([], [], color="#444", ls=style, label=name) for name, style in (("small swings", "-"), ("true load", "--"))
    ]
    figure.legend(handles=lines, loc="outside lower center", ncols=len(lines), frameon=False)
    title = f"Swing left by a wrong parameter, ±{NEAR * 100:g} % of it shaded"
    figure.suptitle("\n".join([title, *_remarks(document)]), fontsize=10)
    return figure


def _series(load: str, family: str, time_s: float) -> Iterator[Series]:
    """Curves of one plan, all parameters at once."""
    model, ranges, _ = LOADS[load]
    trajectory = _plan(load, family, time_s)
    values = {name: np.linspace(low, high, POINTS).tolist() for name, (low, high) in ranges.items()}
    real = [model.with_parameter(name, value) for name in values for value in values[name]]
    small, full = (residual_amplitudes(real, trajectory, nonlinear=kind).reshape(-1, POINTS) for kind in (False, True))
    for name, linear, nonlinear in zip(values, small.tolist(), full.tolist(), strict=True):
        yield Series(
            load=load,
            family=family,
            time_s=time_s,
            parameter=name,
            nominal=model.parameters[name],
            values=values[name],
            residual_rad=linear,
            residual_nonlinear_rad=nonlinear,
        )


def _plan(load: str, family: str, time_s: float) -> Trajectory:
    model, _, robust = LOADS[load]
    planner, _, input, forgiving = FAMILIES[family]
    problem = Problem(distance_m=DISTANCE_M, time_s=time_s, model=model, input=input, robust=(robust,) if forgiving else ())
    return plan(planner, problem).motion.x


def _add(axes: Axes, series: Series) -> None:
    if not axes.lines:
        axes.axvspan(series.nominal * (1.0 - NEAR), series.nominal * (1.0 + NEAR), color="#00000014", lw=0)
        axes.grid(alpha=0.25, lw=0.5)
        axes.set_xlim(series.values[0], series.values[-1])
    colour = COLOURS.get(series.time_s)
    axes.plot(series.values, 1e3 * np.array(series.residual_rad), color=colour, lw=1.3, label=f"{series.time_s:g} s")
    axes.plot(series.values, 1e3 * np.array(series.residual_nonlinear_rad), color=colour, lw=1.0, ls="--")


def _label(family: str) -> str:
    words = family.replace("_", " ")
    return f"{words}\nto {' / '.join(load.robust for load in LOADS.values())}" if FAMILIES[family].robust else words


def _remarks(document: dict[str, Series]) -> Iterator[str]:
    """Where curves left the panels, and which plans leave them although nothing is wrong."""
    left = {
        f"{series.load} {series.family} {series.time_s:g} s".replace("_", " "): mrad
        for series in document.values()
        if (mrad := 1e3 * float(np.interp(series.nominal, series.values, series.residual_nonlinear_rad))) > TOP_MRAD
    }
    yield f"Curves that leave the panels at {TOP_MRAD:g} mrad are whole in `rig compare sensitivity --json`."
    if left:
        named = ", ".join(f"{plan} leaves {mrad:.0f} mrad" for plan, mrad in left.items())
        yield f"On the true load, which is not linear, even with nothing wrong: {named}."


def _unit(parameter: str) -> str:
    return "m" if parameter.startswith("length") else "N m/rad"
