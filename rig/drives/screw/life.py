"""How long a nut lasts: equivalent force, dynamic load, hours (source 004, C.0.1 to C.0.5)."""

from __future__ import annotations

import math

import numpy as np

from planners.trajectories.pieces import FloatArray

REVOLUTIONS = 1e6  # for which the dynamic load is rated, at a survival of 90 %
SECONDS = 3600.0


def equivalent_force_n(force_n: FloatArray, travel_m: FloatArray) -> float:
    """The constant force that wears as much (C.0.4): cube root of the mean of |F|^3 over the way travelled.

    force_n and travel_m >= 0 are (N,) alike: stretches of constant force, or nodes of a quadrature; no travel wears nothing.
    """
    travel = float(np.sum(travel_m))
    return float(np.cbrt(np.sum(np.abs(force_n) ** 3 * travel_m) / travel)) if travel > 0.0 else 0.0


def life_h(
    dynamic_load_n: float,
    force_n: float,
    mean_speed_m_s: float,
    lead_m: float,
    service_factor: float = 1.0,
) -> float:
    """L_h = 1e6 p / (3600 v_m) (C / (f_s F_eq))^3 (C.0.2 with C.0.3's service factor); inf where nothing moves or presses."""
    if force_n == 0.0 or mean_speed_m_s == 0.0:
        return math.inf
    return (
        REVOLUTIONS
        * lead_m
        / (SECONDS * mean_speed_m_s)
        * (dynamic_load_n / (service_factor * force_n)) ** 3
    )


def dynamic_load_n(
    hours: float, force_n: float, mean_speed_m_s: float, lead_m: float, service_factor: float = 1.0
) -> float:
    """The rating that lasts so long (C.0.3): C = f_s F_eq cbrt(3600 L_h v_m / (1e6 p))."""
    return (
        service_factor
        * force_n
        * math.cbrt(SECONDS * hours * mean_speed_m_s / (REVOLUTIONS * lead_m))
    )


def least_lead_by_life_m(
    hours: float,
    rated_load_n: float,
    force_n: float,
    mean_speed_m_s: float,
    service_factor: float = 1.0,
) -> float:
    """The lead whose turns are few enough for a rating: C.0.3 solved for p."""
    return (
        SECONDS
        * hours
        * mean_speed_m_s
        / REVOLUTIONS
        * (service_factor * force_n / rated_load_n) ** 3
    )
