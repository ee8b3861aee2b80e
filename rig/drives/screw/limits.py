"""Limits of a screw's size, solved for the diameter or the lead (source 004, C.0.7 to C.0.21)."""

from __future__ import annotations

import math
from typing import NamedTuple

from rig.drives.screw.shaft import BallScrew, Mounting

RPM_PER_RAD_S = 60.0 / (2.0 * math.pi)


class DesignPoint(NamedTuple):
    """Least lead over all diameters, and the diameter at which it is reached."""

    diameter_m: float
    lead_m: float


def least_lead_by_whirl_m(screw: BallScrew, speed_m_s: float, share: float) -> float:
    """Compute the least lead by whirling: p > 2 pi v_max / (share omega_f) (C.0.7).

    It falls as 1 / d and does not depend on the screw's own lead.
    """
    return 2.0 * math.pi * speed_m_s / (share * screw.whirl_rad_s)


def least_lead_by_balls_m(diameter_m: float, speed_m_s: float, limit_m_rpm: float) -> float:
    """Compute the least lead by the ball speed limit S: p > 60 v_max d / S (C.0.9)."""
    return 60.0 * speed_m_s * diameter_m / limit_m_rpm


def absolute_least_lead(
    mounting: Mounting, speed_m_s: float, share: float, limit_m_rpm: float
) -> DesignPoint:
    """Intersect the limits of whirling and ball speed (C.0.11, C.0.12), the same S in both."""
    slope = BallScrew(diameter_m=1.0, lead_m=1.0, mounting=mounting).whirl_rad_s  # omega_f / d
    diameter = math.sqrt(2.0 * math.pi * limit_m_rpm / (60.0 * share * slope))
    return DesignPoint(diameter, least_lead_by_balls_m(diameter, speed_m_s, limit_m_rpm))


def least_diameter_by_buckling_m(mounting: Mounting, force_n: float, share: float) -> float:
    """Compute the least diameter by buckling: d^4 > 64 F L_c^2 / (share f_eu pi^3 E).

    It is C.0.14 solved for d. C.0.15 of source 004 has L_c in place of L_c^2, which is no length.
    """
    unit = BallScrew(diameter_m=1.0, lead_m=1.0, mounting=mounting).buckling_load_n
    return float((abs(force_n) / (share * unit)) ** 0.25)


def least_diameter_by_sag_m(
    mounting: Mounting, sag_m: float, slope_rad: float = 0.0, carried_kg: float = 0.0
) -> float:
    """Compute the least diameter by sag: C.0.16 solved for d.

    The sag falls as 1 / d^2 under the own weight, as 1 / d^4 under a carried load.
    """
    unit = BallScrew(diameter_m=1.0, lead_m=1.0, mounting=mounting)
    own, whole = unit.sag_m(slope_rad), unit.sag_m(slope_rad, carried_kg)
    return _diameter_m(own, whole - own, sag_m)


def greatest_lead_by_accuracy_m(position_error_m: float, angle_error_rad: float) -> float:
    """Compute the greatest lead by accuracy: p <= 2 pi dx / dtheta (C.0.21)."""
    return 2.0 * math.pi * position_error_m / angle_error_rad


def greatest_lead_by_stiffness_m(
    screw: BallScrew, stiffness_n_m: float, support_stiffness_n_m: float = math.inf
) -> float:
    """Compute the greatest lead by stiffness: C.0.17 solved for p.

    Torsion may use the compliance that the rest of the chain leaves; 0 where it leaves none.
    support_stiffness_n_m is that of bearing and nut in series.
    """
    left = 1.0 / stiffness_n_m - 1.0 / support_stiffness_n_m - 1.0 / screw.axial_stiffness_n_m
    return 2.0 * math.pi * math.sqrt(max(0.0, left) * screw.torsional_stiffness_n_m_rad)


def least_diameter_by_stiffness_m(
    screw: BallScrew, stiffness_n_m: float, support_stiffness_n_m: float
) -> float:
    """Compute the least diameter by stiffness at the screw's lead: C.0.17 solved for d.

    The compliance falls as 1 / d^2 in tension, as 1 / d^4 in torsion. inf where bearing and nut
    (support_stiffness_n_m, in series) are too soft by themselves.
    """
    unit = BallScrew(diameter_m=1.0, lead_m=screw.lead_m, mounting=screw.mounting)
    left = 1.0 / stiffness_n_m - 1.0 / support_stiffness_n_m
    if not left > 0.0:
        return math.inf
    twist = unit.ratio_m_rad**2 / unit.torsional_stiffness_n_m_rad
    return _diameter_m(1.0 / unit.axial_stiffness_n_m, twist, left)


def stiffness_for_bandwidth_n_m(
    screw: BallScrew, mass_kg: float, bandwidth_rad_s: float, share: float
) -> float:
    """Compute the k_eq with which share x omega_z is the bandwidth (C.0.18, C.0.19)."""
    return (mass_kg + screw.mass_kg / 3.0) * (bandwidth_rad_s / share) ** 2


def _diameter_m(second: float, fourth: float, whole: float) -> float:
    """Solve second / d^2 + fourth / d^4 = whole for d."""
    return math.sqrt((second + math.sqrt(second**2 + 4.0 * whole * fourth)) / (2.0 * whole))
