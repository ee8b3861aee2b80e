"""What a plan exactly does, under the columns of the source's tables."""

from __future__ import annotations

import numpy as np

from planners.models.model import Model
from planners.replay.metrics import swing_after
from planners.replay.swing import Swing
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory
from rig.studies.thesis_tables.source_metrics import InputNodes, respond

INTERVALS = 2000  # of a move, to read the angles' peaks from: leaves 1e-6 of them where the acceleration steps, else 1e-8
INSTANT_S = 1e-9


def exact_metrics(model: Model, trajectory: Trajectory) -> dict[str, float]:
    """Absolute maxima and travel of the move, RMS over it, and as every theta*_res the swing's amplitude at its end.

    Platform: exact to rounding. Angles: small swings.
    """
    n = model.links_count
    low, high = trajectory.extent(0)
    t, x = (
        np.linspace(0.0, trajectory.duration_s, INTERVALS + 1),
        states_along(model, trajectory, INTERVALS),
    )
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
    """Position, speed, small angles and their rates at intervals + 1 even times of the move: (intervals + 1, 2 + 2n).

    The acceleration is taken as lines between nodes, twice, and the error of the nodes' distance squared extrapolated.
    """
    coarse, fine = (
        _between_lines(model, trajectory, count) for count in (intervals, 2 * intervals)
    )
    return (4.0 * fine[::2] - coarse) / 3.0


def _between_lines(model: Model, trajectory: Trajectory, intervals: int) -> FloatArray:
    time_s, joints = trajectory.duration_s, trajectory.breaks_s[1:-1]
    t = np.linspace(0.0, time_s, intervals + 1)
    if (
        joints.size
    ):  # where the acceleration may step: a node at the joint, and one an instant before it
        apart = np.abs(np.subtract.outer(t, joints)).min(axis=1) > 2.0 * INSTANT_S
        t = np.sort(np.concatenate([t[apart], joints - INSTANT_S, joints]))
    return respond(
        model.state_space(), InputNodes(t, trajectory.at(t, 2)), time_s, time_s / intervals
    )
