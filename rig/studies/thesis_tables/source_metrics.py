"""Metrics of the source, with its definitions, sampling and windows."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from planners.models.model import StateSpace
from planners.trajectories.pieces import FloatArray

SOURCE_SAMPLE_S = 0.5e-3  # sample time of the source's simulations
# terms of a power series over one sample: |a| SOURCE_SAMPLE_S = 0.03 for the fastest plant here,
# and 0.03^8 / 8! = 2e-17
SERIES_TERMS = 8


class InputNodes(NamedTuple):
    """Nodes of an input; it is linear between them and 0 after the last one."""

    t_s: FloatArray  # (m,) strictly increasing from 0
    values: FloatArray  # (m,) input of the plant


def response(
    plant: StateSpace, nodes: InputNodes, duration_s: float, sample_s: float = SOURCE_SAMPLE_S
) -> FloatArray:
    """Simulate the linear plant from rest; return its states (N + 1, n), exact to rounding.

    Samples are every sample_s from 0 to duration_s. The input changes its value and slope at the
    nodes only, so that [x; u; u'] obeys one linear equation between them. The change at a node is
    carried to the next sample by a power series; all samples are then summed in log2 N steps.
    """
    n, count = len(plant.states), round(duration_s / sample_s) + 1
    matrix = np.zeros((n + 2, n + 2))
    matrix[:n, :n] = plant.a
    matrix[:n, n] = plant.b[:, 0]
    matrix[n, n + 1] = 1.0
    sample = np.ceil(nodes.t_s / sample_s - 1e-6).astype(np.intp)
    carried = _carry(matrix, _changes(nodes, n), sample * sample_s - nodes.t_s)
    inside = sample < count
    z = np.zeros((count, n + 2))
    np.add.at(z, sample[inside], carried[inside])
    flow = _carry(matrix, np.eye(n + 2), np.full(n + 2, sample_s))  # transposed transition matrix
    step = 1
    while step < count:
        z[step:] += z[:-step] @ flow
        flow = flow @ flow
        step *= 2
    return z[:, :n]


def source_metrics(
    plant: StateSpace,
    nodes: InputNodes,
    *,
    window: int = 2,
    acceleration: Literal["nodes", "speed"] = "nodes",
) -> dict[str, float]:
    """Compute the columns of the source's tables for an input from rest (sections 3.2 and 4.2).

    T is the duration of the move.

    theta*_max_rad: largest signed value over [0, T]; theta*_res_rad: over [T, 2T];
    dy_max_m: highest minus lowest position over [0, 2T]; v_max_m_s: largest signed value;
    v_rms_m_s: over [0, window T]; a_max_m_s2 (signed) and a_rms_m_s2: unweighted over the nodes,
    or ("speed") over differences of the simulated speed in [0, 2T].
    """
    time_s = float(nodes.t_s[-1])
    end = round(time_s / SOURCE_SAMPLE_S)
    x = response(plant, nodes, max(window, 2) * time_s)
    both = x[: 2 * end + 1]
    angles = [k for k, name in enumerate(plant.states) if name.startswith("angle_")]
    figures: dict[str, float] = {}
    for i, k in enumerate(angles):
        mark = i + 1 if len(angles) > 1 else ""
        figures[f"theta{mark}_max_rad"] = float(x[: end + 1, k].max())
        figures[f"theta{mark}_res_rad"] = float(both[end:, k].max())
    a = nodes.values if acceleration == "nodes" else np.diff(both[:, 1]) / SOURCE_SAMPLE_S
    return figures | {
        "dy_max_m": float(np.ptp(both[:, 0])),
        "v_max_m_s": float(x[:, 1].max()),
        "v_rms_m_s": _rms(x[: window * end + 1, 1]),
        "a_max_m_s2": float(a.max()),
        "a_rms_m_s2": _rms(a),
    }


def _changes(nodes: InputNodes, n: int) -> FloatArray:
    """Compute the change of [x; u; u'] at each node: (m, n + 2)."""
    slopes = np.diff(nodes.values) / np.diff(nodes.t_s)
    changes = np.zeros((len(nodes.t_s), n + 2))
    changes[0, n] = nodes.values[0]
    changes[-1, n] = -nodes.values[-1]
    changes[:, n + 1] = np.diff(slopes, prepend=0.0, append=0.0)
    return changes


def _carry(matrix: FloatArray, start: FloatArray, after_s: FloatArray) -> FloatArray:
    """Compute exp(matrix after_s) start for each row of start: (m, n), (m,)."""
    total = term = start
    for k in range(1, SERIES_TERMS):
        term = term @ matrix.T * (after_s / k)[:, None]
        total = total + term
    return total


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values * values)))
