"""Input nodes of the source's techniques that do not use an even grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from planners.errors import PlanError
from planners.models.pendulum import PendulumModel
from rig.studies.thesis_tables.ode45 import ode45
from rig.studies.thesis_tables.source_metrics import SOURCE_SAMPLE_S, InputNodes

# intervals of a shaped law where the source does not state them; its residuals agree within 2 %
FINE_INTERVALS = 20000
# corrections of the first costate: the terminal error falls from 1e-3 m to 1e-11 m
COSTATE_CORRECTIONS = 4


def shaped_nodes(
    distance_m: float,
    time_s: float,
    half_periods_s: Sequence[float],
    derivatives: int = 0,
    samples: Literal["fine", "segments"] = "fine",
) -> InputNodes:
    """Sample the platform acceleration of the harmonic law behind cascaded shapers.

    Each mode has a ZV shaper (derivatives = 0) or a ZVD shaper (1) of its half period. "segments"
    samples every 0.5 ms and drops the last sample of each copy of the law, as in tables 3.2, 3.3
    and 3.7 of the source: the reason why its cart drifts. Raises PlanError when the shapers leave
    no time for the law.
    """
    impulses = _impulses(half_periods_s, derivatives)
    law_s = time_s - max(impulses)
    if not law_s > 0.0:
        raise PlanError(
            f"time_s = {time_s}; must be > {max(impulses):g}, the shapers' duration: "
            "lengthen the move"
        )
    fine = samples == "fine"
    count = FINE_INTERVALS if fine else round(time_s / SOURCE_SAMPLE_S)
    t = np.linspace(0.0, time_s, count + 1)
    edge = 1e-6 * time_s / count
    acceleration = np.zeros_like(t)
    for delay, share in impulses.items():
        inside = np.flatnonzero((t > delay - edge) & (t < delay + law_s + edge))
        if not fine:
            inside = inside[:-1]
        acceleration[inside] += share * np.cos(math.pi * (t[inside] - delay) / law_s)
    return InputNodes(t, acceleration * distance_m / 2 * (math.pi / law_s) ** 2)


def _impulses(half_periods_s: Sequence[float], derivatives: int) -> dict[float, float]:
    """Compute amplitudes by delay [s] of derivatives + 1 ZV shapers a mode, cascaded."""
    impulses = {0.0: 1.0}
    for half in half_periods_s:
        for _ in range(derivatives + 1):
            earlier, impulses = impulses, {}
            for delay, share in earlier.items():
                for at in (delay, round(delay + half, 9)):
                    impulses[at] = impulses.get(at, 0.0) + share / 2
    return impulses


def shooting_nodes(
    model: PendulumModel, distance_m: float, time_s: float, *, robust: bool
) -> InputNodes:
    """Compute the acceleration -b' costate at the points of ode45, as the source shoots (2.1.5).

    The first costate is corrected until the end state of ode45 is the goal. The source's residuals
    are those of a piecewise linear input through 60 to 110 points. robust adds the sensitivity of
    the swing to the length and its rate, 0 at both ends, as printed (3.2.2): without the term of
    the input, which changes the steps of ode45 but not the optimum.
    """
    from scipy.linalg import expm

    plant = model.state_space()
    n = len(plant.states)
    a, b = plant.a, plant.b[:, 0]
    if robust:
        a = np.zeros((n + 2, n + 2))
        b = np.append(b, [0.0, 0.0])
        a[:n, :n] = plant.a
        a[n:, n:] = plant.a[2:, 2:]
        a[n + 1, 2] = model.gravity_m_s2 / model.length_m**2
        n += 2
    hamiltonian = np.block([[a, -np.outer(b, b)], [np.zeros((n, n)), -a.T]])
    goal, start = np.zeros(n), np.zeros(2 * n)
    goal[0] = distance_m
    to_end = np.linalg.inv(expm(hamiltonian * time_s)[:n, n:])
    error = -goal  # terminal error
    for _ in range(COSTATE_CORRECTIONS):
        start[n:] -= to_end @ error
        t, z = ode45(hamiltonian, start, time_s)
        error = z[-1, :n] - goal
    return InputNodes(t, -z[:, n:] @ b)
