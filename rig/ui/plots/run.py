"""Figures of a run: position, swing, residual swing, and the camera image with the cable."""

from __future__ import annotations

import math
from typing import Any

import cv2
import msgspec
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from comms.messages import AngleSample
from rig.analysis.identify.decay import DecayFit
from rig.analysis.run_log import FloatArray, RunLog
from rig.ui.plots.style import (
    BLUE,
    GREEN,
    GREY,
    IMAGE_CYAN,
    IMAGE_YELLOW,
    ORANGE,
    RED,
    SHADE,
    style_axes,
)

WIDTH_IN = 10.0
HEIGHT_IN = 3.2  # of a figure with one panel
PLANNED = GREY
ACTUAL = BLUE
TRUE = GREEN
TWIN = ORANGE  # the run without losses
MEASURED = RED
AROUND_S = 0.6  # time shown before and after the move [s]


def position(run: RunLog, twin: RunLog | None) -> Figure:
    """Draw planned, commanded and actual position during the move, and actual minus planned."""
    figure, (upper, lower) = _two_panels()
    t_sent, commanded, t_actual, actual = run.robot.T
    t0, t1 = _move_window(run)
    shown = np.linspace(t0, t1, 1000)
    upper.plot(shown - run.t_move_s, run.planned_m(shown), color=PLANNED, lw=2.5, label="planned")
    upper.plot(*_cut(t_sent, commanded, t0, t1, run.t_move_s), color=TWIN, lw=1, label="commanded")
    upper.plot(*_cut(t_actual, actual, t0, t1, run.t_move_s), color=ACTUAL, lw=1.2, label="actual")
    error = (actual - run.planned_m(t_actual)) * 1e3
    lower.plot(
        *_cut(t_actual, error, t0, t1, run.t_move_s), color=ACTUAL, lw=1.2, label="actual - planned"
    )
    if twin is not None:
        _, _, t_twin, actual_twin = twin.robot.T
        a, b = _move_window(twin)
        upper.plot(
            *_cut(t_twin, actual_twin, a, b, twin.t_move_s),
            color=TRUE,
            lw=1,
            ls="--",
            label="actual, without losses",
        )
        twin_error = (actual_twin - twin.planned_m(t_twin)) * 1e3
        lower.plot(
            *_cut(t_twin, twin_error, a, b, twin.t_move_s),
            color=TRUE,
            lw=1,
            ls="--",
            label="without losses",
        )
    _finish(upper, "x [m]", "")
    _finish(lower, "difference [mm]", "time from the start of the move [s]")
    return figure


def swing(run: RunLog, twin: RunLog | None) -> Figure:
    """Draw measured and true angle over the whole run, and measured minus true."""
    figure, (upper, lower) = _two_panels()
    t, angle, _ = run.swing
    t_true, true, rate, _ = run.truth.T
    zero = run.t_move_s
    if twin is not None:
        upper.plot(
            twin.truth[:, 0] - twin.t_move_s,
            twin.truth[:, 1] * 1e3,
            color=TWIN,
            lw=1,
            label="true, without losses",
        )
    if t_true.size:
        upper.plot(t_true - zero, true * 1e3, color=TRUE, lw=1.6, label="true")
    upper.plot(t - zero, angle * 1e3, ".", ms=2, color=MEASURED, label="measured")
    if t_true.size > 1:
        from rig.analysis.identify.swing import truth_at

        inside = (t >= t_true[0]) & (t <= t_true[-1])
        error = (angle[inside] - truth_at(t[inside], t_true, true, rate)) * 1e3
        lower.plot(t[inside] - zero, error, color=MEASURED, lw=0.8, label="measured - true")
    for axes in (upper, lower):
        if run.plan.time_s:
            axes.axvspan(0, run.plan.time_s, color=SHADE, lw=0)
    _finish(upper, "swing [mrad]", "")
    _finish(lower, "difference [mrad]", "time from the start of the move [s]")
    return figure


def residual(run: RunLog, fit: DecayFit | None, twin: RunLog | None) -> Figure:
    """Draw the swing after the move: measured, true and fitted decay."""
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), layout="constrained")
    axes = figure.subplots()
    t, angle, _ = run.swing
    zero, after = run.t_move_s, run.t_settled_s
    if twin is not None:
        later = twin.truth[:, 0] >= twin.t_settled_s
        axes.plot(
            twin.truth[later, 0] - twin.t_move_s,
            twin.truth[later, 1] * 1e3,
            color=TWIN,
            lw=1,
            label="true, without losses",
        )
    later = run.truth[:, 0] >= after
    axes.plot(
        run.truth[later, 0] - zero, run.truth[later, 1] * 1e3, color=TRUE, lw=1.5, label="true"
    )
    seen = t >= after
    axes.plot(t[seen] - zero, angle[seen] * 1e3, ".", ms=2.5, color=MEASURED, label="measured")
    if fit is not None and seen.any():
        fine = np.linspace(t[seen][0], t[seen][-1], 800)
        axes.plot(fine - zero, fit.angle(fine) * 1e3, color=ACTUAL, lw=0.9, label="fitted decay")
        axes.plot(
            fine - zero,
            (fit.offset_rad + fit.amplitude_at(fine)) * 1e3,
            color=ACTUAL,
            lw=0.6,
            ls=":",
            label="amplitude",
        )
    _finish(axes, "swing [mrad]", "time from the start of the move [s]")
    return figure


def camera(run: RunLog) -> Figure | None:
    """Draw the logged image nearest the largest measured swing, with the detected cable.

    None when the log has no images or no angles.
    """
    pictures = run.pictures()
    seen = [a for a in run.angles if a.raw_rad is not None]
    settings = msgspec.json.decode(run.log.attachments.get("vision.json", b"null"))
    if not pictures or not seen or settings is None:
        return None
    largest_s = max(seen, key=lambda a: abs(a.angle_rad or 0.0)).t_valid_ns * 1e-9
    stamps = [p.timestamp.sec + p.timestamp.nsec * 1e-9 for p in pictures]
    k = int(np.argmin([abs(t - largest_s) for t in stamps]))
    image = cv2.imdecode(np.frombuffer(pictures[k].data, dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
    if image is None:
        return None
    average_s = (settings["average_frames"] - 1) / 2 * settings["period_ns"] * 1e-9
    sample = min(seen, key=lambda a: abs(a.t_valid_ns * 1e-9 + average_s - stamps[k]))
    width_in = WIDTH_IN * 0.72
    height_in = width_in * image.shape[0] / image.shape[1] + 0.3
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    axes = figure.subplots()
    axes.imshow(np.dstack([image, image // 6, image // 6]))
    _draw_cable(axes, sample, settings, image.shape[0])
    raw = (sample.raw_rad or 0.0) * 1e3
    axes.set_title(
        f"{stamps[k] - run.t_move_s:+.2f} s from the start of the move: "
        f"{raw:.2f} mrad in the image",
        fontsize=9,
    )
    axes.set_xlim(0, image.shape[1])
    axes.set_ylim(image.shape[0], min(0.0, settings["pivot_home_px"][1] - 10))
    axes.legend(loc="lower right", fontsize=8)
    return figure


def _draw_cable(axes: Axes, sample: AngleSample, settings: dict[str, Any], height: int) -> None:
    u0, v0 = settings["pivot_home_px"]
    u0 += settings["pixels_per_m"] * (sample.platform_m or 0.0)
    rows = np.array([v0, height - 1.0])
    columns = u0 + (sample.pivot_miss_px or 0.0) + math.tan(sample.raw_rad or 0.0) * (rows - v0)
    axes.plot(
        columns,
        rows,
        color=IMAGE_CYAN,
        lw=1.0,
        ls="--",
        label=f"detected cable ({sample.rows} rows)",
    )
    axes.plot([u0], [v0], "x", color=IMAGE_YELLOW, label="predicted pivot")


def _two_panels() -> tuple[Figure, tuple[Axes, Axes]]:
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN * 1.5), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    return figure, (upper, lower)


def _move_window(run: RunLog) -> tuple[float, float]:
    """Compute start and end of the time shown around the move [s], run clock."""
    end_s = run.plan.time_s if run.plan.time_s else run.plan.watch_s
    return run.t_move_s - AROUND_S, run.t_move_s + end_s + AROUND_S


def _cut(
    t: FloatArray, y: FloatArray, t0: float, t1: float, zero_s: float
) -> tuple[FloatArray, FloatArray]:
    """Keep the samples from t0 to t1; times count from zero_s."""
    keep = (t >= t0) & (t <= t1)
    return t[keep] - zero_s, y[keep]


def _finish(axes: Axes, ylabel: str, xlabel: str) -> None:
    style_axes(axes, xlabel=xlabel, ylabel=ylabel)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            fontsize=8,
            ncols=6,
            frameon=False,
            borderaxespad=0.2,
        )
