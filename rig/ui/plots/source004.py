"""Figure of a comparison of source 004: swing, residual swing and position of its runs."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.analysis.run_log import SETTLE_S
from rig.studies.source_004.runs import RunCurves
from rig.ui.plots.style import SERIES, style_axes
from rig.ui.plots.two_panels import FONT_PT, MAX_TICKS, TIME_LABEL, WIDTH_IN

HEIGHT_IN = 4.4
TITLES = (
    "true swing of the lowest link [mrad]",
    "true swing of the lowest link after the move [mrad]",
    "platform x [m]",
)


def draw_comparison(curves: Mapping[str, RunCurves]) -> Figure:
    """Draw the runs of a comparison, by the label of each, over the time from their move."""
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 2))
    for k, (label, run) in enumerate(curves.items()):
        colour = SERIES[k % len(SERIES)]
        after = run.t_s >= run.move_s + SETTLE_S
        swing_mrad = run.swing_rad * 1e3
        panels[0].plot(run.t_s, swing_mrad, color=colour, lw=1.0, label=label)
        panels[1].plot(run.t_s[after], swing_mrad[after], color=colour, lw=1.0)
        panels[2].plot(run.t_s, run.position_m, color=colour, lw=1.0)
    for panel, title in zip(panels, TITLES, strict=True):
        _style(panel, title)
    panels[2].set_xlabel(TIME_LABEL, fontsize=FONT_PT)
    figure.legend(loc="outside upper left", ncols=2, fontsize=FONT_PT, frameon=False)
    return figure


def _style(panel: Axes, title: str) -> None:
    style_axes(panel, zero_line=True)
    panel.set_title(title, loc="left", fontsize=FONT_PT)
    panel.patch.set_visible(False)
    panel.tick_params(labelsize=FONT_PT)
    panel.locator_params(axis="y", nbins=MAX_TICKS)
