"""Figures of a run of an elastic joint: speed of the load, its vibration after the move, torque."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from rig.analysis.joint import JointRun
from rig.ui.plots.style import GREEN, GREY, INK, ORANGE, RED, SHADE
from rig.ui.plots.two_panels import BAND_ALPHA, BAND_PT, TwoPanels

BEFORE_S = 0.05  # shown before the move
AROUND_END_S = (-0.03, 0.25)  # shown around its end
REFERENCE, TRUE, MEASURED, TORQUE = GREY, GREEN, RED, ORANGE


def joint_figures(joint: JointRun) -> Iterator[tuple[str, Figure]]:
    """Draw the figures one after the other, each with its name."""
    yield "speed of the load", _speed(joint)
    yield "vibration after the move", _vibration(joint)


def _speed(joint: JointRun) -> Figure:
    panels = TwoPanels("speed of the load [°/s]", "motor torque [N m]")
    r = joint.recording
    shown = r.t_s >= -BEFORE_S
    t_s = r.t_s[shown]
    panels.upper.plot(
        t_s,
        np.degrees(r.reference_rad_s[shown]),
        color=REFERENCE,
        lw=BAND_PT,
        alpha=BAND_ALPHA,
        label="reference",
    )
    if joint.metrics is not None:
        panels.upper.plot(t_s, np.degrees(r.load_rad_s[shown]), color=TRUE, lw=1.2, label="true")
    measured = np.degrees(r.measured_rad_s[shown])
    panels.upper.plot(t_s, measured, color=MEASURED, lw=0.8, ls="--", label="by the accelerometer")
    panels.lower.plot(t_s, r.torque_n_m[shown], color=TORQUE, lw=0.8)
    for axes in (panels.upper, panels.lower):
        axes.axvspan(0.0, r.end_s, color=SHADE, lw=0)
    return panels.lay_out()


def _vibration(joint: JointRun) -> Figure:
    panels = TwoPanels("speed after the move [% of top speed]", "")
    r = joint.recording
    percent = 100.0 / float(np.abs(r.reference_rad_s).max())
    since_s = r.t_s - r.end_s
    shown = (since_s >= AROUND_END_S[0]) & (since_s <= AROUND_END_S[1])
    t_s, measured = r.t_s[shown], percent * r.measured_rad_s[shown]
    if joint.metrics is not None:
        true = percent * r.load_rad_s[shown]
        panels.upper.plot(t_s, true, color=TRUE, lw=BAND_PT, alpha=BAND_ALPHA, label="true")
        panels.lower.plot(t_s, measured - true, color=MEASURED, lw=0.8)
        panels.title_difference("accelerometer - true [% of top speed]", "left", INK)
    panels.upper.plot(t_s, measured, color=MEASURED, lw=0.8, label="by the accelerometer")
    panels.upper.axvline(r.end_s, color=INK, lw=0.6, ls=":")
    return panels.lay_out()
