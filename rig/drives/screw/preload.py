"""What a nut's preload costs: load on the balls, and drag (makers' rules for double nuts, general knowledge)."""

from __future__ import annotations

import math

import numpy as np

from planners.trajectories.pieces import FloatArray

LIFT = 2.0**1.5  # times the preload: the force that unloads one half of the nut
DRAG = 0.05  # of the preload's force times travel of a radian, at a lead angle of 45 degrees
PRELOAD_SHARES = (0.05, 0.1)  # of the dynamic load, usual (source 004, C.0.1)


def ball_load_n(force_n: FloatArray, preload_n: float) -> FloatArray:
    """Force on the loaded half of a preloaded nut, (N,) as force_n: F_pr (1 + F / (2^1.5 F_pr))^1.5, and F beyond 2^1.5 F_pr.

    The sign of force_n does not count; without a preload it is its size.
    """
    size = np.abs(force_n)
    if preload_n == 0.0:
        return size
    shared = preload_n * (1.0 + np.minimum(size / (LIFT * preload_n), 1.0)) ** 1.5
    return np.maximum(shared, size)


def drag_torque_n_m(preload_n: float, lead_m: float, diameter_m: float) -> float:
    """0.05 / sqrt(tan beta) F_pr p / 2 pi, with the lead angle beta: tan beta = p / (pi d)."""
    return DRAG / math.sqrt(lead_m / (math.pi * diameter_m)) * preload_n * lead_m / (2.0 * math.pi)
