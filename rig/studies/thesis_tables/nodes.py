"""The nodes at which a technique of the source knew its input, where they are not those of its grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from planners.errors import PlanError
from planners.models.pendulum import PendulumModel
from rig.studies.thesis_tables.ode45 import ode45
from rig.studies.thesis_tables.source_metrics import SOURCE_SAMPLE_S, InputNodes

FINE = 20000  # intervals of a shaped law where the source does not say; its residuals then agree within 2 %
CORRECTIONS = 4  # of a costate: the miss falls from 1e-3 m to 1e-11 m, three decades each


def shaped_nodes(
    distance_m: float,
    time_s: float,
    half_periods_s: Sequence[float],
    derivatives: int = 0,
    samples: Literal["fine", "segments"] = "fine",
) -> InputNodes:
    """Platform acceleration of the harmonic law through one ZV (derivatives = 0) or ZVD (1) shaper a mode, cascaded.

    "segments": every 0.5 ms, and the last sample of each copy of the law is lost, as in the source's tables 3.2, 3.3 and 3.7;
    it is why its cart drifts. Raises PlanError when the shapers leave the law no time.
    """
    impulses = {0.0: 1.0}
    for half in half_periods_s:
        for _ in range(derivatives + 1):
            earlier, impulses = impulses, {}
            for delay, share in earlier.items():
                for at in (delay, round(delay + half, 9)):
                    impulses[at] = impulses.get(at, 0.0) + share / 2
    law_s = time_s - max(impulses)
    if not law_s > 0.0:
        raise PlanError(
            f"time_s = {time_s}; must be > {max(impulses):g}, the shapers' length: lengthen the move"
        )
    count = FINE if samples == "fine" else round(time_s / SOURCE_SAMPLE_S)
    t = np.linspace(0.0, time_s, count + 1)
    edge, acceleration = 1e-6 * time_s / count, np.zeros_like(t)
    for delay, share in impulses.items():
        inside = np.flatnonzero((t > delay - edge) & (t < delay + law_s + edge))
        inside = inside if samples == "fine" else inside[:-1]
        acceleration[inside] += share * np.cos(math.pi * (t[inside] - delay) / law_s)
    return InputNodes(t, acceleration * distance_m / 2 * (math.pi / law_s) ** 2)


def shooting_nodes(
    model: PendulumModel, distance_m: float, time_s: float, *, robust: bool
) -> InputNodes:
    """Acceleration -b'costate at ode45's points, the first costate corrected until ode45's own end is the goal.

    That is how the source shoots (section 2.1.5): its residuals are those of a line through some 60 to 110 points.
    robust adds the swing's sensitivity to the length and its rate, 0 at both ends, as the source printed them (3.2.2):
    without the input's own part, which leaves the optimum as it is but not ode45's steps.
    """
    from scipy.linalg import expm

    plant = model.state_space()
    n = len(plant.states)
    a, b = plant.a, plant.b[:, 0]
    if robust:
        a, b = np.zeros((n + 2, n + 2)), np.append(b, [0.0, 0.0])
        a[:n, :n], a[n:, n:] = plant.a, plant.a[2:, 2:]
        a[n + 1, 2] = model.gravity_m_s2 / model.length_m**2
        n += 2
    hamiltonian = np.block([[a, -np.outer(b, b)], [np.zeros((n, n)), -a.T]])
    goal, start = np.zeros(n), np.zeros(2 * n)
    goal[0] = distance_m
    to_end = np.linalg.inv(expm(hamiltonian * time_s)[:n, n:])
    miss = -goal
    for _ in range(CORRECTIONS):
        start[n:] -= to_end @ miss
        t, z = ode45(hamiltonian, start, time_s)
        miss = z[-1, :n] - goal
    return InputNodes(t, -z[:, n:] @ b)
