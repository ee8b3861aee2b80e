"""The chart of diameters and leads: limits, the admissible region and the catalogue's screws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from planners.trajectories.pieces import FloatArray
from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.limits import absolute_least_lead
from rig.drives.screw.region import LimitCurve, Region, region
from rig.drives.screw.verdict import Assessment
from rig.ui.plots.labels import label_points

MM = 1e3
CURVE_POINTS = 400  # diameters
ROOM = 1.15  # of the largest screw
THINNEST = 0.01  # of the chart's width
TOLD = 4  # screws of which the chart says what they break
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
CALM, BAD, INK = "#2e7d32", "#c62828", "#1a237e"


def draw_region(axis: AxisSpec, found: Sequence[Assessment], judged: Assessment) -> Figure:
    """Leads over diameters: a line for each limit, the admissible region shaded, screws that do and those that do not.

    judged is one of those found; the lines of the balls and of life are those of its nut.
    """
    figure = Figure(figsize=(11.0, 7.5), layout="constrained")
    panel = figure.subplots()
    need, nut = axis.demand, judged.candidate
    least = absolute_least_lead(
        axis.mounting, need.peak_speed_m_s, axis.utilisation.whirl, axis.balls_m_rpm(nut)
    )
    right = ROOM * max(least.diameter_m, *(a.candidate.diameter_m for a in found))
    top = ROOM * max(least.lead_m, *(a.candidate.lead_m for a in found))
    limits = region(axis, np.linspace(THINNEST * right, right, CURVE_POINTS), nut)
    notes = [
        *_shade(panel, limits, top),
        *(_line(panel, line, limits.diameter_m, top) for line in limits.lines),
    ]
    panel.plot(
        MM * least.diameter_m,
        MM * least.lead_m,
        "*",
        ms=13,
        color=INK,
        label="least lead of all",
        zorder=4,
    )
    panel.set_xlim(0.0, MM * right)
    panel.set_ylim(0.0, MM * top)
    _screws(panel, found, judged)
    named = [a for a in found if a is judged or _inside(axis, a, judged)]
    notes += _told(sorted((a for a in named if a.broken), key=lambda a: a is not judged))
    panel.set_xlabel("diameter d [mm]")
    panel.set_ylabel("lead p [mm]")
    panel.grid(alpha=0.25)
    panel.spines[["top", "right"]].set_visible(False)
    panel.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    panel.annotate(
        "\n".join(filter(None, notes)),
        (1.02, 0.0),
        xycoords="axes fraction",
        va="bottom",
        fontsize=9,
        color=INK,
    )
    title = f"{need.peak_speed_m_s:.4g} m/s, {need.peak_force_n:.4g} N, screw of {axis.mounting.length_m:g} m"
    figure.suptitle(
        f"{title}: screws are judged by all checks, the region by its lines", ha="left", x=0.01
    )
    places = [(MM * a.candidate.diameter_m, MM * a.candidate.lead_m) for a in found]
    labels = {found.index(a): (a.candidate.name, BAD if a.broken else INK) for a in named}
    label_points(panel, places, labels)
    return figure


def _shade(panel: Axes, limits: Region, top: float) -> list[str]:
    """The region; a note where there is none."""
    low, high = np.minimum(limits.low_m, top), np.minimum(limits.high_m, top)
    inside = low < high
    if not inside.any():
        return ["no diameter and lead of the chart\nkeep all lines"]
    panel.fill_between(
        MM * limits.diameter_m,
        MM * low,
        MM * high,
        where=inside,
        color=CALM,
        alpha=0.14,
        lw=0,
        label="admissible by the lines",
    )
    return []


def _line(panel: Axes, line: LimitCurve, diameter_m: FloatArray, top: float) -> str:
    """A limit; a note in its place where it is off the chart."""
    colour = COLOURS[line.name]
    if line.diameter_m is not None:
        if THINNEST * diameter_m[-1] < line.diameter_m < diameter_m[-1]:
            panel.axvline(MM * line.diameter_m, color=colour, lw=1.8, label=f"{line.name}: thicker")
            return ""
        return _off(line, kept=line.diameter_m < diameter_m[-1])
    if ((line.lead_m > 0.0) & (line.lead_m < top)).any():
        shown = line.lead_m <= 2.0 * top
        side = "below" if line.greatest else "above"
        panel.plot(
            MM * diameter_m[shown],
            MM * line.lead_m[shown],
            color=colour,
            lw=1.8,
            label=f"{line.name}: {side}",
        )
        return ""
    return _off(line, kept=line.greatest == bool((line.lead_m >= top).any()))


def _off(line: LimitCurve, kept: bool) -> str:
    return f"{line.name}: off the chart, kept {'everywhere' if kept else 'nowhere'}"


def _screws(panel: Axes, found: Sequence[Assessment], judged: Assessment) -> None:
    told = [a for a in found if a.admissible and not a.undecided]
    open_ones = [a for a in found if a.admissible and a.undecided]
    for group, mark, inside, colour, label in (
        (told, "o", CALM, CALM, "screw that fits"),
        (open_ones, "o", "white", CALM, "fits as far as is told"),
        ([a for a in found if not a.admissible], "x", BAD, BAD, "does not fit"),
    ):
        if group:
            d, p = zip(
                *((MM * a.candidate.diameter_m, MM * a.candidate.lead_m) for a in group),
                strict=True,
            )
            panel.plot(d, p, mark, ms=7, mew=1.6, mfc=inside, mec=colour, label=label, zorder=3)
    at = MM * judged.candidate.diameter_m, MM * judged.candidate.lead_m
    panel.plot(*at, "D", ms=14, mfc="none", mew=1.6, color=INK, label="the one judged", zorder=4)


def _told(broken: Sequence[Assessment]) -> list[str]:
    """What keeps named screws from fitting."""
    rest = [f"and {len(broken) - TOLD} more"] if len(broken) > TOLD else []
    return [
        f"{a.candidate.name} breaks\n  " + "\n  ".join(check.name for check in a.broken)
        for a in broken[:TOLD]
    ] + rest


def _inside(axis: AxisSpec, a: Assessment, judged: Assessment) -> bool:
    """Whether a screw lies within the region."""
    here = region(axis, np.array([a.candidate.diameter_m]), judged.candidate)
    return bool(here.low_m[0] <= a.candidate.lead_m <= here.high_m[0])
