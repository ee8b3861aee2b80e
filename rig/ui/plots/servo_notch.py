"""The picture of a notch filter's places: poles of the loops, and what the load does after three steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from planners.trajectories.pieces import ComplexArray
from rig.studies.servo.notch_loops import NotchTask, Placement, Response, placements, step_response

COLOURS = {"none": "#212121", "inside": "#c62828", "upstream": "#2e7d32"}
TITLES = {
    "none": "no notch",
    "inside": "notch inside the speed loop",
    "upstream": "notch upstream of it",
}
GREY = "#757575"
DAMPINGS = (0.2, 0.4, 0.6, 0.8)  # rays in the plane of the poles
PERIODS = 8.0  # of the joint's antiresonance, shown of a response
STEPS = (
    ("motor_torque", "speed of the load [rad/s] after 1 N m on the motor"),
    ("load_torque", "after 1 N m on the load"),
    ("setpoint_angle", "after a setpoint step of 1 rad"),
)


def draw_notch(task: NotchTask) -> Figure:
    """Poles of speed and position loop, and the load's speed after three steps."""
    rows = placements(task)
    figure = Figure(figsize=(14.0, 9.0), layout="constrained")
    maps, courses = figure.subplots(2, 3)
    top = 1.15 * max(float(np.abs(np.concatenate(_shown(row)).imag).max()) for row in rows)
    for panel, row in zip(maps, rows, strict=True):
        _poles(panel, row, top)
    maps[0].set_ylabel("imaginary part [1/s]")
    figure.legend(handles=_symbols(), loc="outside lower center", ncols=4, frameon=False)
    shown_s = PERIODS * 2.0 * np.pi / task.joint.antiresonance_rad_s
    for panel, (source, title) in zip(courses, STEPS, strict=True):
        _course(
            panel,
            [(row.name, step_response(row.position, source, time_s=shown_s)) for row in rows],
            title,
        )
    courses[0].legend(frameon=False)
    figure.suptitle("A notch filter against the joint's resonance", ha="left", x=0.01)
    return figure


def _symbols() -> list[Line2D]:
    """What a mark means, whatever its colour."""
    marks: tuple[tuple[str, dict[str, Any]], ...] = (
        ("speed loop", {"marker": "x", "ls": ""}),
        ("position loop", {"marker": "o", "mfc": "none", "ls": ""}),
        ("cancelled: disturbances move it", {"marker": "D", "alpha": 0.5, "ls": ""}),
        ("lines: damping", {"ls": ":", "lw": 1.0}),
    )
    return [Line2D([], [], color=GREY, ms=8, label=label, **look) for label, look in marks]


def _shown(row: Placement) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    return (
        row.speed.controllable_poles_1_s,
        row.position.controllable_poles_1_s,
        row.position.cancelled_poles_1_s,
    )


def _poles(panel: Axes, row: Placement, top: float) -> None:
    colour, left = COLOURS[row.name], -1.3 * top
    for damping in DAMPINGS:
        slope = np.sqrt(1.0 - damping**2) / damping
        reach = min(top / slope, -left)
        for side in (-slope, slope):
            panel.plot([0.0, -reach], [0.0, side * reach], color=GREY, lw=0.5, ls=":")
        panel.annotate(f"{damping:g}", (-reach, slope * reach), fontsize=8, color=GREY)
    speed, position, hidden = _shown(row)
    panel.plot(speed.real, speed.imag, "x", ms=8, color=GREY)
    panel.plot(position.real, position.imag, "o", ms=8, mfc="none", color=colour)
    panel.plot(hidden.real, hidden.imag, "D", ms=7, color=colour, alpha=0.5)
    panel.set_xlim(left, 0.08 * top)
    panel.set_ylim(-top, top)
    panel.set_title(TITLES[row.name], color=colour)
    panel.set_xlabel("real part [1/s]; faster poles are left out")
    _dress(panel)


def _course(panel: Axes, responses: Sequence[tuple[str, Response]], title: str) -> None:
    for name, found in responses:
        panel.plot(found.t_s, found.speed_rad_s, color=COLOURS[name], lw=1.6, label=TITLES[name])
    panel.set_title(title, fontsize=11)
    panel.set_xlabel("time [s]")
    _dress(panel)


def _dress(panel: Axes) -> None:
    panel.axhline(0.0, color=GREY, lw=0.6)
    panel.grid(alpha=0.25)
    panel.spines[["top", "right"]].set_visible(False)
