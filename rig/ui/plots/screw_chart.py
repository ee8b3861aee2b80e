"""Figure of ball screws: diameter and lead, limits, admissible region and catalogue entries."""

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
from rig.ui.plots.style import (
    BLUE,
    BROWN,
    GREEN,
    NAVY,
    OLIVE,
    ORANGE,
    PINK,
    PURPLE,
    RED,
    SLATE,
    TEAL,
    style_axes,
)

MM = 1e3
CURVE_POINTS = 400  # diameters of a limit curve
AXIS_RANGE_REL = 1.15  # upper end of both axes over the largest screw
MIN_DIAMETER_REL = 0.01  # smallest diameter of a curve over the width of the chart
MAX_VIOLATION_NOTES = 4  # screws whose violated limits are listed beside the chart
COLOURS = {  # by name of the limit
    "whirling": BLUE,
    "balls": ORANGE,
    "buckling": PURPLE,
    "life": TEAL,
    "sag": PINK,
    "accuracy": BROWN,
    "stiffness": SLATE,
    "bandwidth": OLIVE,
}


def draw_region(axis: AxisSpec, found: Sequence[Assessment], judged: Assessment) -> Figure:
    """Draw lead over diameter: limit curves, admissible region and the screws of a catalogue.

    judged: the assessed choice, one of found. The curves of ball speed and life are those of
    its nut.
    """
    figure = Figure(figsize=(11.0, 7.5), layout="constrained")
    panel = figure.subplots()
    need = axis.demand
    nut = judged.candidate
    least = absolute_least_lead(
        axis.mounting, need.peak_speed_m_s, axis.utilisation.whirl, axis.balls_m_rpm(nut)
    )
    right = AXIS_RANGE_REL * max(least.diameter_m, *(a.candidate.diameter_m for a in found))
    top = AXIS_RANGE_REL * max(least.lead_m, *(a.candidate.lead_m for a in found))
    limits = region(axis, np.linspace(MIN_DIAMETER_REL * right, right, CURVE_POINTS), nut)
    notes = _shade_region(panel, limits, top)
    for line in limits.lines:
        notes.append(_draw_limit(panel, line, limits.diameter_m, top))
    panel.plot(
        MM * least.diameter_m,
        MM * least.lead_m,
        "*",
        ms=13,
        color=NAVY,
        label="least admissible lead",
        zorder=4,
    )
    panel.set_xlim(0.0, MM * right)
    panel.set_ylim(0.0, MM * top)
    _draw_screws(panel, found, judged)
    named = [a for a in found if a is judged or _is_inside(axis, a, judged)]
    violating = [a for a in named if a.broken]
    notes += _violation_notes(sorted(violating, key=lambda a: a is not judged))
    style_axes(panel, xlabel="diameter d [mm]", ylabel="lead p [mm]")
    panel.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    panel.annotate(
        "\n".join(filter(None, notes)),
        (1.02, 0.0),
        xycoords="axes fraction",
        va="bottom",
        fontsize=9,
        color=NAVY,
    )
    title = (
        f"{need.peak_speed_m_s:.4g} m/s, {need.peak_force_n:.4g} N, "
        f"screw length {axis.mounting.length_m:g} m; "
        "region: admissible by the limits drawn; marks: all checks"
    )
    figure.suptitle(title, ha="left", x=0.01)
    places = [(MM * a.candidate.diameter_m, MM * a.candidate.lead_m) for a in found]
    labels = {found.index(a): (a.candidate.name, RED if a.broken else NAVY) for a in named}
    label_points(panel, places, labels)
    return figure


def _shade_region(panel: Axes, limits: Region, top: float) -> list[str]:
    """Shade the admissible region; gives a note where it is empty."""
    low = np.minimum(limits.low_m, top)
    high = np.minimum(limits.high_m, top)
    inside = low < high
    if not inside.any():
        return ["admissible region: empty\nwithin this chart"]
    panel.fill_between(
        MM * limits.diameter_m,
        MM * low,
        MM * high,
        where=inside,
        color=GREEN,
        alpha=0.14,
        lw=0,
        label="admissible region",
    )
    return []


def _draw_limit(panel: Axes, line: LimitCurve, diameter_m: FloatArray, top: float) -> str:
    """Draw a limit curve, labelled by its admissible side.

    Gives a note instead where the curve is off the chart.
    """
    colour = COLOURS[line.name]
    if line.diameter_m is not None:
        if MIN_DIAMETER_REL * diameter_m[-1] < line.diameter_m < diameter_m[-1]:
            label = f"{line.name}: larger diameter"
            panel.axvline(MM * line.diameter_m, color=colour, lw=1.8, label=label)
            return ""
        return _off_chart_note(line, satisfied=line.diameter_m < diameter_m[-1])
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
    is_above_chart = bool((line.lead_m >= top).any())
    return _off_chart_note(line, satisfied=line.greatest == is_above_chart)


def _off_chart_note(line: LimitCurve, *, satisfied: bool) -> str:
    return f"{line.name}: off the chart, satisfied {'everywhere' if satisfied else 'nowhere'}"


def _draw_screws(panel: Axes, found: Sequence[Assessment], judged: Assessment) -> None:
    """Mark every screw: admissible, admissible with data missing, or not admissible."""
    decided = [a for a in found if a.admissible and not a.undecided]
    undecided = [a for a in found if a.admissible and a.undecided]
    rejected = [a for a in found if not a.admissible]
    for group, mark, inside, colour, label in (
        (decided, "o", GREEN, GREEN, "admissible"),
        (undecided, "o", "white", GREEN, "admissible, data missing"),
        (rejected, "x", RED, RED, "not admissible"),
    ):
        if group:
            d = [MM * a.candidate.diameter_m for a in group]
            p = [MM * a.candidate.lead_m for a in group]
            panel.plot(d, p, mark, ms=7, mew=1.6, mfc=inside, mec=colour, label=label, zorder=3)
    at = MM * judged.candidate.diameter_m, MM * judged.candidate.lead_m
    panel.plot(*at, "D", ms=14, mfc="none", mew=1.6, color=NAVY, label="assessed screw", zorder=4)


def _violation_notes(broken: Sequence[Assessment]) -> list[str]:
    """List the limits that screws violate, for MAX_VIOLATION_NOTES of them."""
    notes = []
    for a in broken[:MAX_VIOLATION_NOTES]:
        names = "\n  ".join(check.name for check in a.broken)
        notes.append(f"{a.candidate.name} violates\n  {names}")
    if len(broken) > MAX_VIOLATION_NOTES:
        notes.append(f"and {len(broken) - MAX_VIOLATION_NOTES} more")
    return notes


def _is_inside(axis: AxisSpec, a: Assessment, judged: Assessment) -> bool:
    """Check whether a screw lies in the admissible region."""
    here = region(axis, np.array([a.candidate.diameter_m]), judged.candidate)
    return bool(here.low_m[0] <= a.candidate.lead_m <= here.high_m[0])
