"""Colours and axes style of all figures."""

from __future__ import annotations

from matplotlib.axes import Axes

BLUE = "#1565c0"
RED = "#c62828"
GREEN = "#2e7d32"
ORANGE = "#ef6c00"
PURPLE = "#6a1b9a"
TEAL = "#00838f"
BROWN = "#5d4037"
PINK = "#d81b60"
OLIVE = "#9e9d24"
SLATE = "#455a64"
NAVY = "#1a237e"
INK = "#212121"  # nearly black
BLACK = "#000000"  # matplotlib's own colour of text, ticks and frames
GREY = "#757575"
PALE_RED = "#ffcdd2"
LIGHT_RED = "#e57373"
SHADE = "#21212112"  # INK at 7 % opacity: the time of a move, the range of a parameter
IMAGE_CYAN = "#00e5ff"  # on top of a camera image
IMAGE_YELLOW = "#ffd600"

# the same colours on a dark page
DARK = {
    BLUE: "#64b5f6",
    RED: "#ff8a80",
    GREEN: "#81c784",
    ORANGE: "#ffb74d",
    GREY: "#bdbdbd",
    INK: "#e0e0e0",
    BLACK: "#e0e0e0",
}

SERIES = (BLUE, RED, GREEN, ORANGE, PURPLE, TEAL)
SERIES_WITHOUT_RED = (BLUE, GREEN, ORANGE, PURPLE, TEAL, BROWN, PINK, OLIVE, SLATE)

GRID_ALPHA = 0.25
ZERO_LINE_PT = 0.6


def style_axes(
    panel: Axes,
    *,
    xlabel: str | None = None,
    ylabel: str | None = None,
    zero_line: bool = False,
) -> None:
    """Set grid, frame and axis labels of a panel; draw the line y = 0 on request.

    A label of None is left unchanged.
    """
    if xlabel is not None:
        panel.set_xlabel(xlabel)
    if ylabel is not None:
        panel.set_ylabel(ylabel)
    if zero_line:
        panel.axhline(0.0, color=GREY, lw=ZERO_LINE_PT)
    panel.grid(alpha=GRID_ALPHA)
    panel.spines[["top", "right"]].set_visible(False)
