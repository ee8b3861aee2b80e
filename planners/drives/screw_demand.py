"""What a cycle asks of a screw's nut and of the motor that turns it (source 004, figs. C.9 and C.10)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planners.drives.ball_screw import GRAVITY_M_S2, BallScrew
from planners.drives.screw_cycle import Cycle, Instants
from planners.drives.screw_life import equivalent_force_n
from planners.errors import check_range
from planners.laws import bounds
from planners.pieces import FloatArray


@dataclass(frozen=True, kw_only=True)
class AxisLoad:
    """What is moved, up a slope where that is positive, against dry friction of its guides and a constant force.

    Raises PlanError for a mass that is not 1e-12 to 1e12 kg, a slope beyond the vertical or a negative friction.
    """

    mass_kg: float  # with the nut
    slope_rad: float = 0.0
    friction_coefficient: float = 0.0
    force_n: float = 0.0  # against positive travel, of any sign

    def __post_init__(self) -> None:
        bounds.datum("mass_kg", self.mass_kg)
        check_range("slope_rad", self.slope_rad, -math.pi / 2.0, math.pi / 2.0, "0 is horizontal, positive goes up")
        check_range("friction_coefficient", self.friction_coefficient, 0.0, 10.0, "guides with balls have some 0.01 to 0.1")
        check_range("force_n", self.force_n, -bounds.DATUM, bounds.DATUM, "give it in N")

    @property
    def weight_n(self) -> float:
        """Along the axis: M g sin(slope)."""
        return self.mass_kg * GRAVITY_M_S2 * math.sin(self.slope_rad)

    @property
    def friction_n(self) -> float:
        """Its size while it moves: mu M g cos(slope)."""
        return self.friction_coefficient * self.mass_kg * GRAVITY_M_S2 * math.cos(self.slope_rad)

    def force_at(self, instants: Instants) -> FloatArray:
        """On the nut, positive with positive travel [N] (N,): constant + weight + friction against the motion + M a."""
        steady = self.force_n + self.weight_n + self.friction_n * instants.direction
        return steady + self.mass_kg * instants.acceleration_m_s2


@dataclass(frozen=True, kw_only=True)
class Transmission:
    """What turns besides the screw, and what is lost. Raises PlanError for an efficiency that is not above 0 and <= 1."""

    efficiency: float = 0.9
    motor_inertia_kg_m2: float = 0.0
    coupling_inertia_kg_m2: float = 0.0
    drag_torque_n_m: float = 0.0  # of preload and seals, against the motion

    def __post_init__(self) -> None:
        check_range("efficiency", self.efficiency, 1e-3, 1.0, "a ball screw has 0.9 to 0.97")
        for name in ("motor_inertia_kg_m2", "coupling_inertia_kg_m2", "drag_torque_n_m"):
            bounds.datum(name, getattr(self, name), zero=True)

    def inertia_kg_m2(self, screw: BallScrew) -> float:
        """All that turns."""
        return self.motor_inertia_kg_m2 + self.coupling_inertia_kg_m2 + screw.inertia_kg_m2

    def torque_at(self, screw: BallScrew, load: AxisLoad, instants: Instants) -> FloatArray:
        """At the motor's shaft [N m] (N,): F tau / efficiency + J a / tau, F tau x efficiency where the load drives.

        In a rest the motor holds, and the loss counts against it as if it drove: the source's way, and the safe one.
        """
        tau, force = screw.ratio_m_rad, load.force_at(instants)
        passed = np.where(force * instants.direction < 0.0, self.efficiency, 1.0 / self.efficiency)
        turning = self.inertia_kg_m2(screw) * instants.acceleration_m_s2 / tau + self.drag_torque_n_m * instants.direction
        return np.asarray(force * tau * passed + turning, dtype=np.float64)


class Demand(NamedTuple):
    """Of the nut, whatever the screw: peaks are exact; means and root mean squares are over the whole cycle with its rests."""

    peak_speed_m_s: float
    mean_speed_m_s: float
    rms_speed_m_s: float
    peak_acceleration_m_s2: float
    rms_acceleration_m_s2: float
    rms_inertia_force_n: float
    rms_friction_n: float
    peak_force_n: float  # its size, push or pull
    rms_force_n: float
    equivalent_force_n: float
    travel_m: float


class ShaftDemand(NamedTuple):
    """Of the motor; rms over the whole cycle with its rests."""

    peak_torque_n_m: float
    rms_torque_n_m: float
    peak_speed_rad_s: float
    peak_power_w: float  # exact for constant accelerations, else the largest of the cycle's instants


class Row(NamedTuple):
    """One phase of the motion-law table; acceleration, forces and torque are those of its largest force."""

    move: int
    phase: int  # 0 is the rest
    duration_s: float
    mean_speed_m_s: float
    acceleration_m_s2: float
    friction_n: float
    inertia_n: float
    force_n: float
    torque_n_m: float
    peak_speed_m_s: float
    peak_power_w: float  # of the motor


def demand(cycle: Cycle, load: AxisLoad) -> Demand:
    """What the cycle asks of the nut."""
    at, force = cycle.instants, load.force_at(cycle.instants)
    acceleration = at.acceleration_m_s2
    return Demand(
        peak_speed_m_s=cycle.peak_speed_m_s,
        mean_speed_m_s=float(at.weight_s @ np.abs(at.speed_m_s)) / cycle.duration_s,
        rms_speed_m_s=_rms(at, at.speed_m_s),
        peak_acceleration_m_s2=float(np.abs(acceleration).max()),
        rms_acceleration_m_s2=_rms(at, acceleration),
        rms_inertia_force_n=load.mass_kg * _rms(at, acceleration),
        rms_friction_n=_rms(at, load.friction_n * at.direction),
        peak_force_n=float(np.abs(force).max()),
        rms_force_n=_rms(at, force),
        equivalent_force_n=equivalent_force_n(force, at.weight_s * np.abs(at.speed_m_s)),
        travel_m=cycle.travel_m,
    )


def shaft_demand(cycle: Cycle, load: AxisLoad, transmission: Transmission, screw: BallScrew) -> ShaftDemand:
    """What the cycle asks of the motor."""
    at = cycle.instants
    torque = transmission.torque_at(screw, load, at)
    return ShaftDemand(
        peak_torque_n_m=float(np.abs(torque).max()),
        rms_torque_n_m=_rms(at, torque),
        peak_speed_rad_s=cycle.peak_speed_m_s / screw.ratio_m_rad,
        peak_power_w=float(np.abs(torque * at.speed_m_s).max()) / screw.ratio_m_rad,
    )


def table(cycle: Cycle, load: AxisLoad, transmission: Transmission, screw: BallScrew) -> list[Row]:
    """The motion-law table, phase by phase."""
    rows = []
    for move, phase, at in cycle.stretches:
        force, torque = load.force_at(at), transmission.torque_at(screw, load, at)
        k, duration_s = int(np.argmax(np.abs(force))), float(at.weight_s.sum())
        acceleration = float(at.acceleration_m_s2[k])
        rows.append(
            Row(
                move,
                phase,
                duration_s,
                float(at.weight_s @ at.speed_m_s) / duration_s,
                acceleration,
                load.friction_n * float(at.direction[k]),
                load.mass_kg * acceleration,
                float(force[k]),
                float(torque[k]),
                float(np.abs(at.speed_m_s).max()),
                float(np.abs(torque * at.speed_m_s).max()) / screw.ratio_m_rad,
            )
        )
    return rows


def _rms(at: Instants, values: FloatArray) -> float:
    return math.sqrt(float(at.weight_s @ values**2) / float(at.weight_s.sum()))
