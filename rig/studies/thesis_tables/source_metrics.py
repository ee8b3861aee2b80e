"""The source's own metrics: its definitions, its sampling, its windows."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from planners.models.model import StateSpace
from planners.trajectories.pieces import FloatArray

SOURCE_SAMPLE_S = 0.5e-3  # of the source's simulations
TERMS = 8  # of a series over one sample: the fastest plant here has |a| SAMPLE_S = 0.03, and 0.03^8/8! = 2e-17


class InputNodes(NamedTuple):
    """Where a method knows its input; between nodes it is linear, after the last it is 0."""

    t_s: FloatArray  # (m,) strictly increasing from 0
    values: FloatArray  # (m,) of the plant's input


def respond(
    plant: StateSpace, nodes: InputNodes, duration_s: float, sample_s: float = SOURCE_SAMPLE_S
) -> FloatArray:
    """States of the linear plant from rest, every sample_s from 0 to duration_s: (N + 1, n), exact to rounding.

    The input is a line that changes its value and slope at the nodes, so [x; u; u'] obeys one linear law between nodes;
    a change is carried to the next sample by its power series, and all samples are then summed in log2 N steps.
    """
    n, count = len(plant.states), round(duration_s / sample_s) + 1
    law = np.zeros((n + 2, n + 2))
    law[:n, :n], law[:n, n], law[n, n + 1] = plant.a, plant.b[:, 0], 1.0
    sample = np.ceil(nodes.t_s / sample_s - 1e-6).astype(np.intp)
    carried = _carry(law, _changes(nodes, n), sample * sample_s - nodes.t_s)
    inside = sample < count
    z = np.zeros((count, n + 2))
    np.add.at(z, sample[inside], carried[inside])
    flow, step = (
        _carry(law, np.eye(n + 2), np.full(n + 2, sample_s)),
        1,
    )  # rows: what each state becomes
    while step < count:
        z[step:] += z[:-step] @ flow
        flow, step = flow @ flow, 2 * step
    return z[:, :n]


def measure(
    plant: StateSpace,
    nodes: InputNodes,
    *,
    window: int = 2,
    acceleration: Literal["nodes", "speed"] = "nodes",
) -> dict[str, float]:
    """The columns of the source's tables for an input that moves the plant from rest (source 004, sections 3.2 and 4.2).

    theta*_max_rad: largest signed value over the move; theta*_res_rad: over as long again; dy_max_m: highest minus lowest
    position in both; v_max_m_s: signed; v_rms_m_s: over [0, window T]; a_max_m_s2 (signed), a_rms_m_s2: unweighted over the
    method's nodes, or ("speed") over differences of the simulated speed in [0, 2T].
    """
    time_s = float(nodes.t_s[-1])
    end = round(time_s / SOURCE_SAMPLE_S)
    x = respond(plant, nodes, max(window, 2) * time_s)
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
    """Change of [x; u; u'] at each node: (m, n + 2)."""
    slopes = np.diff(nodes.values) / np.diff(nodes.t_s)
    changes = np.zeros((len(nodes.t_s), n + 2))
    changes[0, n], changes[-1, n] = nodes.values[0], -nodes.values[-1]
    changes[:, n + 1] = np.diff(slopes, prepend=0.0, append=0.0)
    return changes


def _carry(law: FloatArray, start: FloatArray, after_s: FloatArray) -> FloatArray:
    """exp(law after_s) start for each row of start: (m, n), (m,)."""
    total = term = start
    for k in range(1, TERMS):
        term = term @ law.T * (after_s / k)[:, None]
        total = total + term
    return total


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values * values)))
