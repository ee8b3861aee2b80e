"""Figure of a report: a panel of a quantity above a panel of differences, on one time axis.

A figure is as wide as a phone: its text stays readable there, and two fit beside each other on a
wide screen.
"""

from __future__ import annotations

import math
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.ui.plots.style import INK, style_axes

WIDTH_IN = 3.8
UPPER_IN = 1.6  # height of the panel of the quantity
LOWER_IN = 0.8  # height of the panel of differences
LEFT_IN = 0.56  # room for a number of six signs
RIGHT_IN = 0.08
TITLE_IN = 0.20  # above each panel
LEGEND_ROW_IN = 0.17
BOTTOM_IN = 0.42
GAP_IN = 0.05
LEGEND_COLUMNS = 3
FONT_PT = 8.0
TITLE_PAD_PT = 3.0
MAX_TICKS = 5  # of a vertical axis

BAND_PT = 4.5
BAND_ALPHA = 0.45
DOT_PT = 1.8
TIME_LABEL = "time from the start of the move [s]"


class TwoPanels:
    """Figure with a panel of a quantity above a panel of differences, on one time axis."""

    def __init__(self, title: str, difference: str) -> None:
        self.figure = Figure()
        self.upper: Axes
        self.lower: Axes
        self.upper, self.lower = self.figure.subplots(2, 1, sharex=True)
        self.upper.set_title(title, loc="left", fontsize=FONT_PT, pad=TITLE_PAD_PT)
        self.title_difference(difference, "left", INK)

    def title_difference(self, text: str, side: Literal["left", "right"], colour: str) -> None:
        """Write the title of the lower panel at one side, in the colour of its line."""
        self.lower.set_title(text, loc=side, fontsize=FONT_PT, pad=TITLE_PAD_PT, color=colour)

    def lay_out(self) -> Figure:
        """Place panels and legend at fixed margins; call it once everything is drawn."""
        for axes in (self.upper, self.lower):
            style_axes(axes)
            axes.patch.set_visible(False)
            axes.tick_params(labelsize=FONT_PT)
            axes.locator_params(axis="y", nbins=MAX_TICKS)
        self.lower.set_xlabel(TIME_LABEL, fontsize=FONT_PT)
        handles, labels = self.upper.get_legend_handles_labels()
        legend_in = math.ceil(len(labels) / LEGEND_COLUMNS) * LEGEND_ROW_IN + GAP_IN
        lower_in = BOTTOM_IN
        upper_in = lower_in + LOWER_IN + TITLE_IN + GAP_IN
        height_in = upper_in + UPPER_IN + TITLE_IN + legend_in
        self.figure.set_size_inches(WIDTH_IN, height_in)
        self._place(self.upper, upper_in, UPPER_IN)
        self._place(self.lower, lower_in, LOWER_IN)
        self.figure.legend(
            handles,
            labels,
            loc="upper left",
            ncols=LEGEND_COLUMNS,
            fontsize=FONT_PT,
            frameon=False,
            borderaxespad=0.0,
            borderpad=0.2,
            labelspacing=0.3,
            handlelength=1.4,
            handletextpad=0.5,
            columnspacing=1.0,
        )
        return self.figure

    def _place(self, axes: Axes, bottom_in: float, height_in: float) -> None:
        height = self.figure.get_figheight()
        width_in = WIDTH_IN - LEFT_IN - RIGHT_IN
        axes.set_position(
            (
                LEFT_IN / WIDTH_IN,
                bottom_in / height,
                width_in / WIDTH_IN,
                height_in / height,
            )
        )
