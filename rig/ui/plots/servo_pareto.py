"""Figure of the trade-off of drive controllers: residual vibration over peak sensitivity."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter, StrMethodFormatter

from rig.studies.servo.pareto import TradeOffPoint
from rig.ui.plots.style import INK, RED, SERIES_WITHOUT_RED, style_axes

LOG_SPAN = 10.0  # ratio of largest and least value from which an axis is logarithmic
MARKERS = "osD^v<>P*X"
HALO_PT2 = 150.0  # area of the ring around a point on the front


def draw_trade_off(points: Sequence[TradeOffPoint], best: Sequence[TradeOffPoint]) -> Figure:
    """Draw a curve a controller along its knob, and the front over all of them.

    Points without figures are left out.
    """
    figure = Figure(figsize=(8.5, 6.0), layout="constrained")
    panel = figure.subplots()
    rated = [point for point in points if not point.refusal]
    colours = (RED, *SERIES_WITHOUT_RED)
    for k, name in enumerate(dict.fromkeys(point.controller for point in points)):
        x, y = _coordinates([point for point in rated if point.controller == name])
        panel.plot(x, y, color=colours[k], marker=MARKERS[k], ms=5, lw=1.1, label=name)
    x, y = _coordinates(best)
    panel.step(x, y, where="post", color=INK, lw=1.2, ls="--", label="front")
    panel.scatter(x, y, s=HALO_PT2, facecolors="none", edgecolors=INK, linewidths=1.4, zorder=3)
    sensitivities, residuals = _coordinates(rated)
    if _is_wide(sensitivities):
        panel.set_xscale("log")
        panel.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        panel.xaxis.set_minor_formatter(LogFormatter(labelOnlyBase=False))
    if _is_wide(residuals):
        panel.set_yscale("log")
        panel.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    style_axes(panel, xlabel="peak sensitivity", ylabel="residual vibration [% of top speed]")
    figure.legend(loc="outside right upper", frameon=False)
    return figure


def _coordinates(points: Sequence[TradeOffPoint]) -> tuple[list[float], list[float]]:
    """Split points with figures into peak sensitivities and residuals [%]."""
    x, y = [], []
    for point in points:
        if point.peak_sensitivity is not None and point.residual is not None:
            x.append(point.peak_sensitivity)
            y.append(100.0 * point.residual)
    return x, y


def _is_wide(values: Sequence[float]) -> bool:
    positive = [value for value in values if value > 0.0]
    return len(positive) == len(values) > 0 and max(values) > LOG_SPAN * min(values)
