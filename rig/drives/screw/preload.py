"""Effects of a nut's preload: load on the balls, and drag.

The rules are those of makers for double nuts (general knowledge).
"""

from __future__ import annotations

import math

import numpy as np

from planners.trajectories.pieces import FloatArray

LIFT_OFF_FACTOR = 2.0**1.5  # force that unloads one half of the nut, over the preload
DRAG_FACTOR = 0.05  # drag torque over preload x travel of a radian, at a lead angle of 45 degrees
PRELOAD_SHARES = (0.05, 0.1)  # usual preload over dynamic load rating (source 004, C.0.1)


def ball_load_n(force_n: FloatArray, preload_n: float) -> FloatArray:
    """Compute the force on the loaded half of a preloaded nut, (N,) as force_n.

    F_pr (1 + F / (2^1.5 F_pr))^1.5 up to F = 2^1.5 F_pr, and F beyond; F = |force_n|, also without
    a preload.
    """
    size = np.abs(force_n)
    if preload_n == 0.0:
        return size
    shared = preload_n * (1.0 + np.minimum(size / (LIFT_OFF_FACTOR * preload_n), 1.0)) ** 1.5
    return np.maximum(shared, size)


def drag_torque_n_m(preload_n: float, lead_m: float, diameter_m: float) -> float:
    """Compute the drag torque 0.05 / sqrt(tan beta) F_pr p / 2 pi of a preloaded nut.

    beta is the lead angle: tan beta = p / (pi d).
    """
    tan_lead_angle = lead_m / (math.pi * diameter_m)
    return DRAG_FACTOR / math.sqrt(tan_lead_angle) * preload_n * lead_m / (2.0 * math.pi)
