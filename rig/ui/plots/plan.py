"""Figure of a plan: position, speed and acceleration of the platform, swing of every link."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from planners.problem import Plan
from planners.replay import replay
from planners.trajectories.trajectory import Trajectory
from rig.ui.plots.style import BLUE, SERIES, SHADE, style_axes

AFTER_PERIODS = 2.0  # periods of the slowest mode that are shown after the move


def draw_plan(plan: Plan) -> Figure:
    """Draw position, speed and acceleration of a move, and the swing of the nonlinear load.

    The swing is shown until AFTER_PERIODS after the move.
    """
    move = plan.motion.x
    model = plan.problem.model
    n = model.links_count
    after_s = AFTER_PERIODS * 2 * math.pi / model.natural_frequency_rad_s
    standstill = Trajectory.hold(float(move.at(move.duration_s)), after_s)
    extended = Trajectory((*move.pieces, *standstill.pieces))
    start = plan.problem.start()
    swing = replay(
        model,
        extended,
        angles_rad=start[2 : 2 + n],
        rates_rad_s=start[2 + n : 2 + 2 * n],
        speed_before_m_s=float(start[1]),
    )
    figure = Figure(figsize=(10.0, 9.0), layout="constrained")
    axes = figure.subplots(4, 1, sharex=True)
    t = np.linspace(0.0, move.duration_s, 1001)
    labels = ("position [m]", "speed [m/s]", "acceleration [m/s²]", "swing [mrad]")
    for order in range(3):
        axes[order].plot(t, move.at(t, order), color=BLUE, lw=1.6)
    for k in range(n):
        label = f"link {k + 1}" if n > 1 else "cable"
        axes[3].plot(
            swing.t_s,
            swing.angle_rad[:, k] * 1e3,
            color=SERIES[k % len(SERIES)],
            lw=1.4,
            label=label,
        )
    axes[3].legend(loc="upper right", frameon=False)
    for panel, label in zip(axes, labels, strict=True):
        panel.axvspan(0.0, move.duration_s, color=SHADE, lw=0)
        style_axes(panel, ylabel=label)
    axes[3].set_xlabel("time [s]; move shaded; swing of the nonlinear load")
    p = plan.problem
    figure.suptitle(
        f"{plan.planner}: {p.distance_m:g} m in {p.time_s:g} s, {p.input} input", ha="left", x=0.01
    )
    return figure
