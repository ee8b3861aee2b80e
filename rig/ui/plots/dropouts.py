"""Figure of the study of lost references: one column a policy, one line a planner."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.studies.dropouts import DropoutRow, DropoutSpec
from rig.ui.plots.style import SERIES, style_axes

Value = Callable[[DropoutRow], float | None]


def draw_dropouts(spec: DropoutSpec, rows: Sequence[DropoutRow]) -> Figure:
    """Draw residual vibration (mean, and range to the largest) and acceleration against loss."""
    figure = Figure(figsize=(4.6 * len(spec.policies) + 1.0, 8.0), layout="constrained")
    panels = figure.subplots(2, len(spec.policies), sharex=True, sharey="row", squeeze=False)
    for column, policy in enumerate(spec.policies):
        upper, lower = panels[0, column], panels[1, column]
        upper.set_title(policy)
        for k, planner in enumerate(spec.planners):
            chosen = [row for row in rows if (row.policy, row.planner) == (policy, planner)]
            colour = SERIES[k % len(SERIES)]
            label = f"{planner}, {chosen[0].time_s:g} s"
            _draw(upper, chosen, _mean_mrad, colour, label)
            _draw(upper, chosen, _largest_mrad, colour, None, style=":")
            _draw(lower, chosen, _acceleration, colour, None)
        style_axes(upper, zero_line=True)
        style_axes(lower, xlabel="lost references [%]", zero_line=True)
    panels[0, 0].set_ylabel("residual vibration [mrad]\nmean, and largest (dotted)")
    panels[1, 0].set_ylabel("largest acceleration\nof the robot [m/s²]")
    figure.legend(
        *panels[0, 0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=5,
        frameon=False,
    )
    figure.suptitle(
        f"Interpolator policies under losses of {spec.burst} references in a row, "
        f"{spec.seeds} runs each",
        ha="left",
        x=0.01,
    )
    return figure


def _draw(
    panel: Axes,
    rows: Sequence[DropoutRow],
    value: Value,
    colour: str,
    label: str | None,
    style: str = "-",
) -> None:
    points = [(row.loss * 100, found) for row in rows if (found := value(row)) is not None]
    x = [loss for loss, _ in points]
    y = [found for _, found in points]
    panel.plot(x, y, style, color=colour, marker="o", ms=3, lw=1.4, label=label)


def _mean_mrad(row: DropoutRow) -> float | None:
    return None if row.residual_mean_rad is None else row.residual_mean_rad * 1e3


def _largest_mrad(row: DropoutRow) -> float | None:
    return None if row.residual_max_rad is None else row.residual_max_rad * 1e3


def _acceleration(row: DropoutRow) -> float | None:
    return row.acceleration_max_m_s2
