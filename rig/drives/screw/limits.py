"""Where in the plane of diameter and lead a screw may lie: limits solved for one of the two (source 004, C.0.7 to C.0.21)."""

from __future__ import annotations

import math
from typing import NamedTuple

from rig.drives.screw.shaft import BallScrew, Mounting

RPM = 60.0 / (2.0 * math.pi)  # of 1 rad/s


class DesignPoint(NamedTuple):
    """The least lead of all diameters, and the diameter that has it."""

    diameter_m: float
    lead_m: float


def least_lead_by_whirl_m(screw: BallScrew, speed_m_s: float, share: float) -> float:
    """p > 2 pi v_max / (share omega_f) (C.0.7); falls as 1 / d, whatever the screw's own lead."""
    return 2.0 * math.pi * speed_m_s / (share * screw.whirl_rad_s)


def least_lead_by_balls_m(diameter_m: float, speed_m_s: float, limit_m_rpm: float) -> float:
    """p > 60 v_max d / S (C.0.9)."""
    return 60.0 * speed_m_s * diameter_m / limit_m_rpm


def absolute_least_lead(
    mounting: Mounting, speed_m_s: float, share: float, limit_m_rpm: float
) -> DesignPoint:
    """Where the lines of whirling and of the balls cross (C.0.11, C.0.12), the same S in both."""
    slope = BallScrew(diameter_m=1.0, lead_m=1.0, mounting=mounting).whirl_rad_s  # omega_f / d
    diameter = math.sqrt(2.0 * math.pi * limit_m_rpm / (60.0 * share * slope))
    return DesignPoint(diameter, least_lead_by_balls_m(diameter, speed_m_s, limit_m_rpm))


def least_diameter_by_buckling_m(mounting: Mounting, force_n: float, share: float) -> float:
    """d^4 > 64 F L_c^2 / (share f_eu pi^3 E): C.0.14 solved for d. Source 004's C.0.15 has L_c for L_c^2: no length."""
    unit = BallScrew(diameter_m=1.0, lead_m=1.0, mounting=mounting).buckling_load_n
    return float((abs(force_n) / (share * unit)) ** 0.25)


def least_diameter_by_sag_m(
    mounting: Mounting, sag_m: float, slope_rad: float = 0.0, carried_kg: float = 0.0
) -> float:
    """C.0.16 solved for d: the own weight sags as 1 / d^2, a carried load as 1 / d^4."""
    unit = BallScrew(diameter_m=1.0, lead_m=1.0, mounting=mounting)
    own, whole = unit.sag_m(slope_rad), unit.sag_m(slope_rad, carried_kg)
    return _diameter_m(own, whole - own, sag_m)


def greatest_lead_by_accuracy_m(position_error_m: float, angle_error_rad: float) -> float:
    """p <= 2 pi dx / dtheta (C.0.21)."""
    return 2.0 * math.pi * position_error_m / angle_error_rad


def greatest_lead_by_stiffness_m(
    screw: BallScrew, stiffness_n_m: float, support_stiffness_n_m: float = math.inf
) -> float:
    """The lead at which torsion uses up what the rest of the chain leaves (C.0.17 solved for p); 0 where it leaves nothing.

    support_stiffness_n_m is that of bearing and nut in series.
    """
    left = 1.0 / stiffness_n_m - 1.0 / support_stiffness_n_m - 1.0 / screw.axial_stiffness_n_m
    return 2.0 * math.pi * math.sqrt(max(0.0, left) * screw.torsional_stiffness_n_m_rad)


def least_diameter_by_stiffness_m(
    screw: BallScrew, stiffness_n_m: float, support_stiffness_n_m: float
) -> float:
    """C.0.17 solved for d at the screw's lead: a shaft gives way as 1 / d^2, its twist as 1 / d^4. inf where what holds it does
    not leave the stiffness."""
    unit = BallScrew(diameter_m=1.0, lead_m=screw.lead_m, mounting=screw.mounting)
    left = 1.0 / stiffness_n_m - 1.0 / support_stiffness_n_m
    twist = unit.ratio_m_rad**2 / unit.torsional_stiffness_n_m_rad
    return _diameter_m(1.0 / unit.axial_stiffness_n_m, twist, left) if left > 0.0 else math.inf


def stiffness_for_bandwidth_n_m(
    screw: BallScrew, mass_kg: float, bandwidth_rad_s: float, share: float
) -> float:
    """k_eq that puts share omega_z at the bandwidth (C.0.18, C.0.19)."""
    return (mass_kg + screw.mass_kg / 3.0) * (bandwidth_rad_s / share) ** 2


def _diameter_m(second: float, fourth: float, whole: float) -> float:
    """The d of second / d^2 + fourth / d^4 = whole."""
    return math.sqrt((second + math.sqrt(second**2 + 4.0 * whole * fourth)) / (2.0 * whole))
