"""Figures of a run: position, swing and residual swing, each with a panel of differences.

A figure is as wide as a phone: its text stays readable there, and two fit beside each other on a
wide screen. The true curve is a wide band, the measured samples are dots on top of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.analysis.identify.decay import DecayFit
from rig.analysis.identify.swing import truth_at
from rig.analysis.run_log import RunLog
from rig.analysis.seen_swing import FloatArray
from rig.ui.plots.style import BLUE, GREEN, GREY, ORANGE, RED, SHADE
from rig.ui.plots.two_panels import BAND_ALPHA, BAND_PT, DOT_PT, TwoPanels

BoolArray = npt.NDArray[np.bool_]

PLANNED = GREY
COMMANDED = ORANGE
ACTUAL = BLUE
TRUE = GREEN
TWIN = ORANGE  # the run without losses
MEASURED = RED
FITTED = BLUE

AROUND_S = 0.6  # time shown before and after the move [s]


def position(run: RunLog, twin: RunLog | None) -> Figure:
    """Draw planned, commanded and actual position during the move, and actual minus planned."""
    panels = TwoPanels(f"position {'xyz'[run.main_axis]} [m]", "actual - planned [mm]")
    upper = panels.upper
    t_sent, commanded, _, _ = run.robot.T
    t0, t1 = _move_window(run)
    shown = np.linspace(t0, t1, 500)
    upper.plot(
        shown - run.t_move_s,
        run.planned_m(shown),
        color=PLANNED,
        lw=BAND_PT,
        alpha=BAND_ALPHA,
        label="planned",
    )
    upper.plot(*_cut(run, t_sent, commanded), color=COMMANDED, lw=1, label="commanded")
    _draw_actual(panels, run, ACTUAL, "-", "actual")
    if twin is not None:
        _draw_actual(panels, twin, TRUE, "--", "actual, without losses")
    return panels.lay_out()


def swing(run: RunLog, twin: RunLog | None) -> Figure:
    """Draw measured and true angle over the whole run, and measured minus true."""
    panels = TwoPanels("swing [mrad]", "measured - true [mrad]")
    everything = np.ones(run.swing[0].size, dtype=bool)
    if twin is not None:
        _draw_twin(panels.upper, twin, -math.inf)
    _draw_truth(panels.upper, run, -math.inf)
    _draw_measured(panels.upper, run, everything)
    _draw_error(panels.lower, run, everything)
    if run.plan.time_s:
        for axes in (panels.upper, panels.lower):
            axes.axvspan(0, run.plan.time_s, color=SHADE, lw=0)
    return panels.lay_out()


def residual(run: RunLog, fit: DecayFit | None, twin: RunLog | None) -> Figure:
    """Draw measured, true and fitted swing after the move, and the differences from measured."""
    panels = TwoPanels("swing after the move [mrad]", "")
    after = run.swing[0] >= run.t_settled_s
    if twin is not None:
        _draw_twin(panels.upper, twin, twin.t_settled_s)
    _draw_truth(panels.upper, run, run.t_settled_s)
    if fit is not None and after.any():
        _draw_fit(panels, run, fit, after)
    _draw_measured(panels.upper, run, after)
    if run.truth.size:
        panels.title_difference("measured - true [mrad]", "left", MEASURED)
        _draw_error(panels.lower, run, after)
    return panels.lay_out()


def all_figures(
    run: RunLog, fit: DecayFit | None, twin: RunLog | None
) -> Iterator[tuple[str, Figure]]:
    """Draw the figures of a run one after the other, each with its name."""
    yield "position", position(run, twin)
    yield "swing", swing(run, twin)
    yield "residual swing", residual(run, fit, twin)


def _draw_actual(panels: TwoPanels, run: RunLog, colour: str, line: str, label: str) -> None:
    _, _, t, actual = run.robot.T
    error_mm = (actual - run.planned_m(t)) * 1e3
    panels.upper.plot(*_cut(run, t, actual), color=colour, lw=1.2, ls=line, label=label)
    panels.lower.plot(*_cut(run, t, error_mm), color=colour, lw=1.2, ls=line)


def _draw_truth(axes: Axes, run: RunLog, from_s: float) -> None:
    t, true, _, _ = run.truth.T
    shown = t >= from_s
    if shown.any():
        axes.plot(
            t[shown] - run.t_move_s,
            true[shown] * 1e3,
            color=TRUE,
            lw=BAND_PT,
            alpha=BAND_ALPHA,
            label="true",
        )


def _draw_twin(axes: Axes, twin: RunLog, from_s: float) -> None:
    t, true, _, _ = twin.truth.T
    shown = t >= from_s
    axes.plot(
        t[shown] - twin.t_move_s,
        true[shown] * 1e3,
        color=TWIN,
        lw=1,
        label="true, without losses",
    )


def _draw_measured(axes: Axes, run: RunLog, shown: BoolArray) -> None:
    t, angle, _ = run.swing
    axes.plot(
        t[shown] - run.t_move_s,
        angle[shown] * 1e3,
        ".",
        ms=DOT_PT,
        color=MEASURED,
        label="measured",
    )


def _draw_error(axes: Axes, run: RunLog, shown: BoolArray) -> None:
    """Draw measured minus true swing of the samples shown, where the truth is known."""
    t, angle, _ = run.swing
    t_true, true, rate, _ = run.truth.T
    if t_true.size < 2:
        return
    inside = shown & (t >= t_true[0]) & (t <= t_true[-1])
    error = angle[inside] - truth_at(t[inside], t_true, true, rate)
    axes.plot(t[inside] - run.t_move_s, error * 1e3, color=MEASURED, lw=0.8)


def _draw_fit(panels: TwoPanels, run: RunLog, fit: DecayFit, after: BoolArray) -> None:
    t, angle, _ = run.swing
    t_after = t[after]
    fine = np.linspace(t_after[0], t_after[-1], 600)
    fine_s = fine - run.t_move_s
    amplitude = fit.offset_rad + fit.amplitude_at(fine)
    averaged = fit.angle(
        t_after,
        average_frames=run.facts.average_frames,
        frame_period_s=1.0 / run.facts.rate_hz,
    )
    upper = panels.upper
    upper.plot(fine_s, fit.angle(fine) * 1e3, color=FITTED, lw=0.8, label="fitted decay")
    upper.plot(fine_s, amplitude * 1e3, color=FITTED, lw=0.8, ls=":", label="amplitude")
    difference_mrad = (angle[after] - averaged) * 1e3
    panels.title_difference("measured - fitted [mrad]", "right", FITTED)
    panels.lower.plot(t_after - run.t_move_s, difference_mrad, color=FITTED, lw=0.8)


def _move_window(run: RunLog) -> tuple[float, float]:
    """Compute start and end of the time shown around the move [s], run clock."""
    end_s = run.plan.time_s or run.plan.watch_s
    return run.t_move_s - AROUND_S, run.t_move_s + end_s + AROUND_S


def _cut(run: RunLog, t: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Keep the samples around the move; times count from its start."""
    t0, t1 = _move_window(run)
    keep = (t >= t0) & (t <= t1)
    return t[keep] - run.t_move_s, y[keep]
