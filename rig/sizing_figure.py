"""The chart of diameters and leads: limits, the admissible region and the catalogue's screws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from planners.drives.screw_axis import Axis, Candidate
from planners.drives.screw_limits import absolute_least_lead
from planners.drives.screw_region import Line, Region, region
from planners.drives.screw_verdict import Assessment
from planners.pieces import FloatArray

MM = 1e3
POINTS = 400  # diameters
ROOM = 1.15  # of the largest screw
THINNEST = 0.01  # of the chart's width
COLOURS = {
    "whirling": "#1565c0",
    "balls": "#ef6c00",
    "buckling": "#6a1b9a",
    "life": "#00838f",
    "sag": "#ad1457",
    "accuracy": "#4e342e",
    "stiffness": "#283593",
    "bandwidth": "#558b2f",
}
CALM, BAD, INK, GREY = "#2e7d32", "#c62828", "#1a237e", "#757575"


def draw_region(axis: Axis, found: Sequence[Assessment], choice: Candidate | None) -> Figure:
    """Leads over diameters: a line for each limit, the admissible region shaded, screws that do and those that do not.

    found has at least one assessment; the line of life is that of the choice's dynamic load.
    """
    figure = Figure(figsize=(11.0, 7.5), layout="constrained")
    panel = figure.subplots()
    need = axis.demand
    least = absolute_least_lead(axis.mounting, need.peak_speed_m_s, axis.shares.whirl, axis.balls_m_rpm)
    right = ROOM * max(least.diameter_m, *(a.candidate.diameter_m for a in found))
    top = ROOM * max(least.lead_m, *(a.candidate.lead_m for a in found))
    spread = np.linspace(THINNEST * right, right, POINTS)
    limits = region(axis, spread, choice.dynamic_load_n if choice else None)
    _shade(panel, limits, top)
    for line in limits.lines:
        _line(panel, line, spread, top)
    panel.plot(MM * least.diameter_m, MM * least.lead_m, "*", ms=13, color=INK, label="least lead of all", zorder=4)
    panel.set_xlim(0.0, MM * right)
    panel.set_ylim(0.0, MM * top)
    _screws(panel, found, choice)
    for a in found:
        _name(panel, axis, a, choice)
    panel.set_xlabel("diameter d [mm]")
    panel.set_ylabel("lead p [mm]")
    panel.grid(alpha=0.25)
    panel.spines[["top", "right"]].set_visible(False)
    panel.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    title = f"{need.peak_speed_m_s:.4g} m/s, {need.peak_force_n:.4g} N, screw of {axis.mounting.length_m:g} m"
    figure.suptitle(f"{title}: screws are judged by all checks, the region by its lines", ha="left", x=0.01)
    return figure


def _shade(panel: Axes, limits: Region, top: float) -> None:
    low, high = np.minimum(limits.low_m, top), np.minimum(limits.high_m, top)
    panel.fill_between(
        MM * limits.diameter_m,
        MM * low,
        MM * high,
        where=low < high,
        color=CALM,
        alpha=0.14,
        lw=0,
        label="admissible by the lines",
    )


def _line(panel: Axes, line: Line, diameter_m: FloatArray, top: float) -> None:
    colour = COLOURS[line.name]
    if line.diameter_m is not None:
        panel.axvline(MM * line.diameter_m, color=colour, lw=1.8, label=f"{line.name}: thicker")
        return
    shown = line.lead_m <= 2.0 * top
    side = "below" if line.greatest else "above"
    panel.plot(MM * diameter_m[shown], MM * line.lead_m[shown], color=colour, lw=1.8, label=f"{line.name}: {side}")


def _screws(panel: Axes, found: Sequence[Assessment], choice: Candidate | None) -> None:
    told = [a for a in found if a.admissible and not a.undecided]
    open_ones = [a for a in found if a.admissible and a.undecided]
    for group, mark, inside, colour, label in (
        (told, "o", CALM, CALM, "screw that fits"),
        (open_ones, "o", "white", CALM, "fits as far as is told"),
        ([a for a in found if not a.admissible], "x", BAD, BAD, "does not fit"),
    ):
        if group:
            d, p = zip(*((MM * a.candidate.diameter_m, MM * a.candidate.lead_m) for a in group), strict=True)
            panel.plot(d, p, mark, ms=7, mew=1.6, mfc=inside, mec=colour, label=label, zorder=3)
    if choice:
        at = MM * choice.diameter_m, MM * choice.lead_m
        panel.plot(*at, "D", ms=14, mfc="none", mew=1.6, color=INK, label="the choice", zorder=4)


def _name(panel: Axes, axis: Axis, a: Assessment, choice: Candidate | None) -> None:
    """Names what fits, the choice, and what no line but another check keeps out of the region."""
    d, p, chosen = a.candidate.diameter_m, a.candidate.lead_m, a.candidate is choice
    here = region(axis, np.array([d]), choice.dynamic_load_n if choice else None)
    if not (chosen or here.low_m[0] <= p <= here.high_m[0]):
        return
    breaks = "".join(f"\n{check.name}" for check in a.broken)
    left = chosen or MM * d > 0.8 * panel.get_xlim()[1]
    panel.annotate(
        a.candidate.name + breaks,
        (MM * d, MM * p),
        (-13.0 if left else 8.0, 0.0 if left else 10.0),
        textcoords="offset points",
        ha="right" if left else "left",
        va="center",
        fontsize=9,
        color=BAD if breaks else INK,
    )
