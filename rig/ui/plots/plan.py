"""The picture of a plan: platform, speed, acceleration, and the swing of every link during and after the move."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from planners.problem import Plan
from planners.replay import replay
from planners.trajectories.trajectory import Trajectory

AFTER_PERIODS = 2.0  # of the slowest mode, shown after the move
COLOURS = ("#c62828", "#1565c0", "#2e7d32", "#ef6c00", "#6a1b9a")


def draw_plan(plan: Plan) -> Figure:
    """Position, speed and acceleration over the move; the true load's angles until AFTER_PERIODS later."""
    move, model, n = plan.motion.x, plan.problem.model, plan.problem.model.links_count
    after_s = AFTER_PERIODS * 2 * math.pi / model.natural_frequency_rad_s
    still = Trajectory(
        (*move.pieces, *Trajectory.hold(float(move.at(move.duration_s)), after_s).pieces)
    )
    start = plan.problem.start()
    swing = replay(
        model,
        still,
        angles_rad=start[2 : 2 + n],
        rates_rad_s=start[2 + n : 2 + 2 * n],
        speed_before_m_s=float(start[1]),
    )
    figure = Figure(figsize=(10.0, 9.0), layout="constrained")
    axes = figure.subplots(4, 1, sharex=True)
    t = np.linspace(0.0, move.duration_s, 1001)
    labels = ("position [m]", "speed [m/s]", "acceleration [m/s²]", "swing [mrad]")
    for order in range(3):
        axes[order].plot(t, move.at(t, order), color="#1565c0", lw=1.6)
    for k in range(n):
        label = f"link {k + 1}" if n > 1 else "cable"
        axes[3].plot(
            swing.t_s,
            swing.angle_rad[:, k] * 1e3,
            color=COLOURS[k % len(COLOURS)],
            lw=1.4,
            label=label,
        )
    axes[3].legend(loc="upper right", frameon=False)
    for panel, label in zip(axes, labels, strict=True):
        panel.set_ylabel(label)
        panel.axvspan(0.0, move.duration_s, color="#00000010", lw=0)
        panel.grid(alpha=0.3)
    axes[3].set_xlabel("time [s]; the move is shaded, the load is the nonlinear one")
    p = plan.problem
    figure.suptitle(
        f"{plan.planner}: {p.distance_m:g} m in {p.time_s:g} s, {p.input} input", ha="left", x=0.01
    )
    return figure
