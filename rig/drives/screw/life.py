"""Fatigue life of a nut: equivalent force, rating and hours (source 004, C.0.1 to C.0.5)."""

from __future__ import annotations

import math

import numpy as np

from planners.trajectories.pieces import FloatArray

RATED_REVOLUTIONS = 1e6  # life under the dynamic load rating, at a survival of 90 % (L10)
SECONDS_PER_HOUR = 3600.0


def equivalent_force_n(force_n: FloatArray, travel_m: FloatArray) -> float:
    """Compute the constant force of the same fatigue damage (C.0.4).

    It is the cube root of the mean of |F|^3 over the distance travelled. force_n and travel_m >= 0
    are (N,) each: intervals of constant force, or nodes of a quadrature. 0 without any travel.
    """
    travel = float(np.sum(travel_m))
    if not travel > 0.0:
        return 0.0
    return float(np.cbrt(np.sum(np.abs(force_n) ** 3 * travel_m) / travel))


def life_h(
    dynamic_load_n: float,
    force_n: float,
    mean_speed_m_s: float,
    lead_m: float,
    service_factor: float = 1.0,
) -> float:
    """Compute the L10 life in hours (C.0.2 with the service factor of C.0.3).

    L_h = 1e6 p / (3600 v_m) (C / (f_s F_eq))^3; inf without force or without motion.
    """
    if force_n == 0.0 or mean_speed_m_s == 0.0:
        return math.inf
    return (
        RATED_REVOLUTIONS
        * lead_m
        / (SECONDS_PER_HOUR * mean_speed_m_s)
        * (dynamic_load_n / (service_factor * force_n)) ** 3
    )


def dynamic_load_n(
    hours: float, force_n: float, mean_speed_m_s: float, lead_m: float, service_factor: float = 1.0
) -> float:
    """Compute the dynamic load rating for a life (C.0.3).

    C = f_s F_eq cbrt(3600 L_h v_m / (1e6 p)).
    """
    return (
        service_factor
        * force_n
        * math.cbrt(SECONDS_PER_HOUR * hours * mean_speed_m_s / (RATED_REVOLUTIONS * lead_m))
    )


def least_lead_by_life_m(
    hours: float,
    rated_load_n: float,
    force_n: float,
    mean_speed_m_s: float,
    service_factor: float = 1.0,
) -> float:
    """Compute the least lead with which a rating reaches a life: C.0.3 solved for p."""
    return (
        SECONDS_PER_HOUR
        * hours
        * mean_speed_m_s
        / RATED_REVOLUTIONS
        * (service_factor * force_n / rated_load_n) ** 3
    )
