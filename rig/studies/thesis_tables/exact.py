"""Exact figures of a plan, under the columns of the source's tables."""

from __future__ import annotations

import numpy as np

from planners.models.model import Model
from planners.replay.metrics import swing_after
from planners.replay.swing import Swing
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory
from rig.studies.thesis_tables.source_metrics import InputNodes, response

# intervals of a move for the peaks of the angles; relative error 1e-6 where the acceleration
# steps, else 1e-8
INTERVALS = 2000
BEFORE_STEP_S = 1e-9  # distance of the last node before a step of the acceleration


def exact_metrics(model: Model, trajectory: Trajectory) -> dict[str, float]:
    """Compute absolute maxima, travel, RMS over the move, and the residual swing.

    Every theta*_res is the amplitude of the swing at the end of the move. Figures of the platform
    are exact to rounding; angles are those of small swings.
    """
    n = model.links_count
    low, high = trajectory.extent(0)
    t = np.linspace(0.0, trajectory.duration_s, INTERVALS + 1)
    x = states_along(model, trajectory, INTERVALS)
    peaks = [Swing(t, x[:, [k]], x[:, [n + k]]).peak_rad() for k in range(2, 2 + n)]
    residual = model.amplitude_rad(*swing_after(model, trajectory))
    marks = [""] if n == 1 else range(1, n + 1)
    figures: dict[str, float] = {}
    for mark, peak in zip(marks, peaks, strict=True):
        figures |= {f"theta{mark}_max_rad": peak, f"theta{mark}_res_rad": residual}
    return figures | {
        "dy_max_m": high - low,
        "v_max_m_s": trajectory.peak(1).value,
        "v_rms_m_s": trajectory.rms(1),
        "a_max_m_s2": trajectory.peak(2).value,
        "a_rms_m_s2": trajectory.rms(2),
    }


def states_along(model: Model, trajectory: Trajectory, intervals: int) -> FloatArray:
    """Compute position, speed, small angles and their rates at evenly spaced times.

    (intervals + 1, 2 + 2n). The acceleration is taken as linear between nodes, with intervals and
    with twice as many; the error, quadratic in the node distance, is extrapolated to 0.
    """
    coarse = _piecewise_linear_states(model, trajectory, intervals)
    fine = _piecewise_linear_states(model, trajectory, 2 * intervals)
    return (4.0 * fine[::2] - coarse) / 3.0


def _piecewise_linear_states(model: Model, trajectory: Trajectory, intervals: int) -> FloatArray:
    time_s, joints = trajectory.duration_s, trajectory.breaks_s[1:-1]
    t = np.linspace(0.0, time_s, intervals + 1)
    if joints.size:
        # the acceleration may step here: a node at the joint, and one just before it
        apart = np.abs(np.subtract.outer(t, joints)).min(axis=1) > 2.0 * BEFORE_STEP_S
        t = np.sort(np.concatenate([t[apart], joints - BEFORE_STEP_S, joints]))
    nodes = InputNodes(t, trajectory.at(t, 2))
    return response(model.state_space(), nodes, time_s, time_s / intervals)
