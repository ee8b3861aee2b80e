"""Figure of the free cart: position and angles, nonlinear bench beside the linear model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from rig.studies.thesis_tables.bench import CartMotion
from rig.studies.thesis_tables.free_cart import FREE_FROM_S, FreeCartCase
from rig.ui.plots import picture_file
from rig.ui.plots.style import BLUE, RED, SHADE, style_axes

SIZE_IN = (9.0, 8.0)
LABELS = ("travel of the cart [m]", "θ1 [°]", "θ2 [°]")
COLOURS = (RED, BLUE)  # printed mass, mass of its parts


def draw(cases: Sequence[FreeCartCase], path: Path) -> None:
    """Draw the motions into a .svg, .png or .pdf file.

    Raises ConfigError for another ending, OSError when the file cannot be written.
    """
    picture_file.save(sheet(cases), path)


def sheet(cases: Sequence[FreeCartCase]) -> Figure:
    """Draw travel, θ1 and θ2 over time; bench solid, linear dashed, time of the force shaded."""
    figure = Figure(figsize=SIZE_IN, layout="constrained")
    panels = figure.subplots(len(LABELS), 1, sharex=True)
    for panel, label in zip(panels, LABELS, strict=True):
        panel.axvspan(0.0, FREE_FROM_S, color=SHADE, lw=0)
        style_axes(panel, ylabel=label, zero_line=True)
    for case, colour in zip(cases, COLOURS, strict=True):
        for name, motion, style in (("bench", case.bench, "-"), ("linear", case.linear, "--")):
            label = f"{name}, {case.cart_mass_kg:.4f} kg"
            for panel, values in zip(panels, _curves(motion), strict=True):
                panel.plot(motion.t_s, values, color=colour, ls=style, lw=1.2, label=label)
    style_axes(panels[-1], xlabel="time [s]")
    panels[-1].set_xlim(0.0, cases[0].bench.t_s[-1])
    handles = panels[0].get_lines()[1:]  # without the zero line
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    figure.suptitle("Free cart with two bars from 30°: 2 N to 2 s, -2 N to 4 s", fontsize=11)
    return figure


def _curves(motion: CartMotion) -> list[np.ndarray]:
    """Values of the three panels."""
    angles_deg = np.degrees(motion.angles_rad)
    return [motion.position_m, angles_deg[:, 0], angles_deg[:, 1]]
