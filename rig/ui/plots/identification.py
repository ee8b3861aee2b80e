"""Figure of an identification: signal and fit, residual, spectrum, damping, poles."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.analysis.identify.identification import Identification
from rig.analysis.readers.signal_record import SignalRecord
from rig.ui.plots.style import BLUE, GREEN, GREY, INK, ORANGE, RED, style_axes
from rig.ui.shown_unit import shown_unit

MAX_POINTS = 4000  # drawn of a long record
DOT_PT = 2.0


def identification_figure(record: SignalRecord, found: Identification) -> Figure:
    """Draw a record with its fit, and what the checks of the fit look at."""
    figure = Figure(figsize=(9.0, 7.5))
    grid = figure.add_gridspec(3, 2, height_ratios=(1.3, 0.8, 1.1))
    unit, factor = shown_unit(found.unit)
    label = f"signal [{unit}]" if unit else "signal"
    upper = figure.add_subplot(grid[0, :])
    _draw_signal(upper, record, found, factor, label)
    _draw_residual(figure.add_subplot(grid[1, :], sharex=upper), found, factor, unit)
    _draw_spectrum(figure.add_subplot(grid[2, 0]), found, factor, unit)
    if len(found.damping_over_amplitude) > 1:
        halves = grid[2, 1].subgridspec(2, 1, hspace=0.6)
        _draw_damping(figure.add_subplot(halves[0]), found, factor, unit)
        _draw_poles(figure.add_subplot(halves[1]), found)
    else:
        _draw_poles(figure.add_subplot(grid[2, 1]), found)
    figure.tight_layout()
    return figure


def _step(count: int) -> int:
    return max(1, count // MAX_POINTS)


def _draw_signal(
    panel: Axes, record: SignalRecord, found: Identification, factor: float, label: str
) -> None:
    step = _step(record.t_s.size)
    panel.plot(
        record.t_s[::step],
        factor * record.values[::step],
        ".",
        color=GREY,
        ms=DOT_PT,
        label="record",
    )
    traces = found.traces
    step = _step(traces.t_s.size)
    panel.plot(traces.t_s[::step], factor * traces.fitted[::step], color=BLUE, lw=0.9, label="fit")
    if found.window_s is not None:
        for edge_s in found.window_s:
            panel.axvline(edge_s, color=ORANGE, lw=0.8)
    panel.set_title(f"{record.path.name}: {found.kind}, {found.verdict}", loc="left", fontsize=9)
    panel.legend(loc="upper right", fontsize=8)
    style_axes(panel, ylabel=label, zero_line=True)


def _draw_residual(panel: Axes, found: Identification, factor: float, unit: str) -> None:
    traces = found.traces
    step = _step(traces.t_s.size)
    panel.plot(traces.t_s[::step], factor * traces.residual[::step], ".", color=RED, ms=DOT_PT)
    if found.noise_rms is not None:
        for sign in (-1.0, 1.0):
            panel.axhline(sign * 2.0 * factor * found.noise_rms, color=GREY, lw=0.8, ls="--")
    style_axes(panel, xlabel="time [s]", ylabel=f"residual [{unit}]", zero_line=True)


def _draw_spectrum(panel: Axes, found: Identification, factor: float, unit: str) -> None:
    traces = found.traces
    if traces.spectrum_hz.size:
        shown = traces.spectrum_hz > 0.0
        panel.semilogy(
            traces.spectrum_hz[shown],
            np.maximum(factor * traces.residual_amplitude[shown], 1e-12),
            color=RED,
            lw=0.8,
        )
    for mode in found.modes:
        panel.axvline(mode.frequency_hz, color=BLUE, lw=0.8)
    style_axes(panel, xlabel="frequency [Hz]", ylabel=f"residual, sine [{unit}]")


def _draw_damping(panel: Axes, found: Identification, factor: float, unit: str) -> None:
    rows = found.damping_over_amplitude
    panel.errorbar(
        [factor * row.amplitude for row in rows],
        [row.damping_ratio for row in rows],
        yerr=[2.0 * row.sigma for row in rows],
        fmt="o",
        color=GREEN,
        ms=3,
        capsize=2,
    )
    style_axes(panel, xlabel=f"amplitude [{unit}]", ylabel="damping")


def _draw_poles(panel: Axes, found: Identification) -> None:
    traces = found.traces
    panel.plot(traces.stabilisation_hz, traces.stabilisation_order, ".", color=INK, ms=DOT_PT)
    for mode in found.modes:
        panel.axvline(mode.frequency_hz, color=BLUE, lw=0.8)
    if found.modes:
        panel.set_xlim(0.0, 2.5 * max(mode.frequency_hz for mode in found.modes))
    style_axes(panel, xlabel="poles of the matrix pencil [Hz]", ylabel="order")
