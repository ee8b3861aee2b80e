"""A figure as SVG inside an HTML page: text stays text, colours are variables of the page."""

from __future__ import annotations

import io
import re

import matplotlib
from matplotlib.figure import Figure

from rig.ui.plots.style import DARK

NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}
NAMESPACE = re.compile(r' xmlns(:xlink)?="[^"]*"')  # HTML knows them
SIZE = re.compile(r'<svg width="[^"]*" height="[^"]*"')  # the page sets it


def inline_svg(figure: Figure, name: str) -> str:
    """Write a figure as an <svg> element.

    name: of the figure, one of its own on the page; the identifiers inside are derived from it.
    """
    stream = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(stream, format="svg", facecolor="none", metadata=NO_METADATA)
    text = stream.getvalue()
    svg = NAMESPACE.sub("", text[text.index("<svg") :])
    svg = SIZE.sub("<svg", svg)
    for colour in DARK:
        svg = svg.replace(colour, f"var({variable(colour)})")
    return svg


def variable(colour: str) -> str:
    """Name the CSS variable of a colour."""
    return f"--c{colour.removeprefix('#')}"


def colour_variables() -> tuple[str, str]:
    """Declare the CSS variables of the colours, on a light and on a dark page."""
    light = "; ".join(f"{variable(colour)}: {colour}" for colour in DARK)
    dark = "; ".join(f"{variable(colour)}: {other}" for colour, other in DARK.items())
    return light, dark
