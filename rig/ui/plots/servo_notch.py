"""Figure of a notch filter in a P/PI cascade: poles of both loops, three step responses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from planners.trajectories.pieces import ComplexArray
from rig.studies.servo.notch_loops import NotchTask, Placement, Response, placements, step_response
from rig.ui.plots.style import GREEN, GREY, INK, RED, style_axes

COLOURS = {"none": INK, "inside": RED, "upstream": GREEN}
TITLES = {
    "none": "no notch",
    "inside": "notch inside the speed loop",
    "upstream": "notch upstream of the speed loop",
}
DAMPING_RATIOS = (0.2, 0.4, 0.6, 0.8)  # of the lines in the s-plane
SHOWN_PERIODS = 8.0  # of the antiresonance, length of a step response
STEPS = (
    ("motor_torque", "load speed [rad/s], step of 1 N m on the motor"),
    ("load_torque", "load speed [rad/s], step of 1 N m on the load"),
    ("setpoint_angle", "load speed [rad/s], setpoint step of 1 rad"),
)


def draw_notch(task: NotchTask) -> Figure:
    """Draw the poles of speed and position loop, and the load speed after three steps."""
    rows = placements(task)
    figure = Figure(figsize=(14.0, 9.0), layout="constrained")
    maps, courses = figure.subplots(2, 3)
    top = 1.15 * max(float(np.abs(np.concatenate(_shown_poles(row)).imag).max()) for row in rows)
    for panel, row in zip(maps, rows, strict=True):
        _draw_poles(panel, row, top)
    maps[0].set_ylabel("imaginary part [1/s]")
    figure.legend(handles=_legend_handles(), loc="outside lower center", ncols=4, frameon=False)
    shown_s = SHOWN_PERIODS * 2.0 * np.pi / task.joint.antiresonance_rad_s
    for panel, (source, title) in zip(courses, STEPS, strict=True):
        responses = [
            (row.name, step_response(row.position, source, time_s=shown_s)) for row in rows
        ]
        _draw_responses(panel, responses, title)
    courses[0].legend(frameon=False)
    figure.suptitle("Notch filter for the resonance of an elastic joint", ha="left", x=0.01)
    return figure


def _legend_handles() -> list[Line2D]:
    """Create the legend entries of the markers, in a neutral colour."""
    marks: tuple[tuple[str, dict[str, Any]], ...] = (
        ("speed loop", {"marker": "x", "ls": ""}),
        ("position loop", {"marker": "o", "mfc": "none", "ls": ""}),
        ("cancelled pole, excited by disturbances", {"marker": "D", "alpha": 0.5, "ls": ""}),
        ("constant damping ratio", {"ls": ":", "lw": 1.0}),
    )
    return [Line2D([], [], color=GREY, ms=8, label=label, **look) for label, look in marks]


def _shown_poles(row: Placement) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Collect the poles of both loops, and the cancelled ones of the position loop [1/s]."""
    return (
        row.speed.controllable_poles_1_s,
        row.position.controllable_poles_1_s,
        row.position.cancelled_poles_1_s,
    )


def _draw_poles(panel: Axes, row: Placement, top: float) -> None:
    """Draw the poles of one placement and lines of constant damping ratio."""
    colour = COLOURS[row.name]
    left = -1.3 * top
    for damping in DAMPING_RATIOS:
        slope = np.sqrt(1.0 - damping**2) / damping
        reach = min(top / slope, -left)
        for side in (-slope, slope):
            panel.plot([0.0, -reach], [0.0, side * reach], color=GREY, lw=0.5, ls=":")
        panel.annotate(f"{damping:g}", (-reach, slope * reach), fontsize=8, color=GREY)
    speed, position, hidden = _shown_poles(row)
    panel.plot(speed.real, speed.imag, "x", ms=8, color=GREY)
    panel.plot(position.real, position.imag, "o", ms=8, mfc="none", color=colour)
    panel.plot(hidden.real, hidden.imag, "D", ms=7, color=colour, alpha=0.5)
    panel.set_xlim(left, 0.08 * top)
    panel.set_ylim(-top, top)
    panel.set_title(TITLES[row.name], color=colour)
    style_axes(panel, xlabel="real part [1/s]; faster poles not shown", zero_line=True)


def _draw_responses(panel: Axes, responses: Sequence[tuple[str, Response]], title: str) -> None:
    for name, found in responses:
        panel.plot(found.t_s, found.speed_rad_s, color=COLOURS[name], lw=1.6, label=TITLES[name])
    panel.set_title(title, fontsize=11)
    style_axes(panel, xlabel="time [s]", zero_line=True)
