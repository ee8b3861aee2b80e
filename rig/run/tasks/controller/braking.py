"""Braking in windows of 30 ms, in each of which the speed falls by at most change_m_s."""

from __future__ import annotations

import math

from rig.run.tasks.grid import WINDOW_S


def braking_distance_m(speed_m_s: float, change_m_s: float) -> float:
    """Compute the distance to rest after a window at speed_m_s: T sum over k >= 1 of (v - k A)+."""
    windows = math.floor(speed_m_s / change_m_s)
    return WINDOW_S * (windows * speed_m_s - change_m_s * windows * (windows + 1) / 2)


def stopping_speed_m_s(distance_m: float, change_m_s: float, duration_s: float) -> float:
    """Compute the largest speed, held for duration_s, from which braking ends within distance_m.

    Inverse of v -> v duration + braking_distance_m(v), which is linear between multiples of A:
    v (duration + m T) - T A m (m + 1) / 2 for m = floor(v / A).
    """
    unit_m = WINDOW_S * change_m_s
    half = duration_s / WINDOW_S - 0.5
    windows = math.floor(math.sqrt(half * half + 2 * distance_m / unit_m) - half)
    reserve_m = unit_m * windows * (windows + 1) / 2
    return (distance_m + reserve_m) / (duration_s + windows * WINDOW_S)
