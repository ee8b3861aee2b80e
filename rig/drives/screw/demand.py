"""Demand of a cycle on a screw's nut and on its motor (source 004, figs. C.9 and C.10)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.screw.cycle import Cycle
from rig.drives.screw.instants import CyclePhase, Instants
from rig.drives.screw.life import equivalent_force_n
from rig.drives.screw.load import AxisLoad
from rig.drives.screw.preload import ball_load_n
from rig.drives.screw.shaft import BallScrew
from rig.drives.screw.transmission import Transmission


class Demand(NamedTuple):
    """Demand on the nut, independent of the screw.

    Peaks are exact absolute values. Means and root mean squares are over the whole cycle with its
    rests.
    """

    peak_speed_m_s: float
    mean_speed_m_s: float
    rms_speed_m_s: float
    peak_acceleration_m_s2: float
    rms_acceleration_m_s2: float
    rms_inertia_force_n: float
    rms_friction_n: float
    peak_force_n: float  # push or pull
    rms_force_n: float
    equivalent_force_n: float  # without a preload
    travel_m: float


class ShaftDemand(NamedTuple):
    """Demand on the motor's shaft; absolute values.

    Means and root mean squares are over the whole cycle with its rests.
    """

    peak_torque_n_m: float
    rms_torque_n_m: float
    peak_speed_rad_s: float
    driving_power_w: float  # largest power from the motor
    braking_power_w: float  # largest power to the motor, where the load drives
    mean_driving_power_w: float
    mean_braking_power_w: float

    @property
    def peak_power_w(self) -> float:
        """Larger one of driving and braking power."""
        return max(self.driving_power_w, self.braking_power_w)


class Powers(NamedTuple):
    """Largest powers within a phase, absolute values; 0 where there is none."""

    driving_w: float
    braking_w: float


def demand(cycle: Cycle, load: AxisLoad) -> Demand:
    """Compute the demand of a cycle on the nut."""
    at = cycle.instants
    force = load.force_at(at)
    acceleration = at.acceleration_m_s2
    return Demand(
        peak_speed_m_s=cycle.peak_speed_m_s,
        mean_speed_m_s=_mean(at, np.abs(at.speed_m_s)),
        rms_speed_m_s=_rms(at, at.speed_m_s),
        peak_acceleration_m_s2=float(np.abs(acceleration).max()),
        rms_acceleration_m_s2=_rms(at, acceleration),
        rms_inertia_force_n=load.mass_kg * _rms(at, acceleration),
        rms_friction_n=_rms(at, load.friction_n * at.direction),
        peak_force_n=float(np.abs(force).max()),
        rms_force_n=_rms(at, force),
        equivalent_force_n=equivalent_load_n(cycle, load, preload_n=0.0),
        travel_m=cycle.travel_m,
    )


def equivalent_load_n(cycle: Cycle, load: AxisLoad, preload_n: float) -> float:
    """Compute the constant load on the balls of the same fatigue damage.

    It is C.0.4 with the preload included at every instant.
    """
    at = cycle.instants
    return equivalent_force_n(
        ball_load_n(load.force_at(at), preload_n), at.weight_s * np.abs(at.speed_m_s)
    )


def shaft_demand(
    cycle: Cycle, load: AxisLoad, transmission: Transmission, screw: BallScrew
) -> ShaftDemand:
    """Compute the demand of a cycle on the motor's shaft."""
    at = cycle.instants
    torque = transmission.torque_at(screw, load, at)
    power = torque * at.speed_m_s / screw.ratio_m_rad
    phases = [
        powers(phase, load, transmission, screw) for move in cycle.counts for phase in move.phases
    ]
    return ShaftDemand(
        peak_torque_n_m=float(np.abs(torque).max()),
        rms_torque_n_m=_rms(at, torque),
        peak_speed_rad_s=cycle.peak_speed_m_s / screw.ratio_m_rad,
        driving_power_w=max(each.driving_w for each in phases),
        braking_power_w=max(each.braking_w for each in phases),
        mean_driving_power_w=_mean(at, np.maximum(power, 0.0)),
        mean_braking_power_w=_mean(at, np.maximum(-power, 0.0)),
    )


def powers(
    phase: CyclePhase, load: AxisLoad, transmission: Transmission, screw: BallScrew
) -> Powers:
    """Compute the largest driving and the largest braking power of a phase."""

    def driving_w(at: Instants) -> FloatArray:
        return transmission.torque_at(screw, load, at) * at.speed_m_s / screw.ratio_m_rad

    def braking_w(at: Instants) -> FloatArray:
        return -driving_w(at)

    return Powers(max(0.0, phase.maximum(driving_w)), max(0.0, phase.maximum(braking_w)))


def _mean(at: Instants, values: FloatArray) -> float:
    return float(at.weight_s @ values) / float(at.weight_s.sum())


def _rms(at: Instants, values: FloatArray) -> float:
    return math.sqrt(_mean(at, values**2))
