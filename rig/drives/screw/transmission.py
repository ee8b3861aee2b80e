"""Rotating inertias and losses between the motor and the nut (source 004, fig. C.10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planners import bounds
from planners.errors import check_range, unknown_name
from planners.trajectories.pieces import FloatArray
from rig.drives.screw.instants import Instants
from rig.drives.screw.load import AxisLoad
from rig.drives.screw.shaft import BallScrew

MOTOR, BRAKE = "motor", "brake"


@dataclass(frozen=True, kw_only=True)
class Transmission:
    """Inertias of motor and coupling, efficiency and drag.

    Raises PlanError for an efficiency that is not 0.001 to 1, a negative inertia or drag, and an
    unknown hold.
    """

    efficiency: float = 0.9
    motor_inertia_kg_m2: float = 0.0
    coupling_inertia_kg_m2: float = 0.0
    # of preload and seals, against the motion; None: computed from the nut's preload
    drag_torque_n_m: float | None = None
    hold: str = MOTOR  # holds the load in the rests; with a brake the motor has no torque then

    def __post_init__(self) -> None:
        check_range("efficiency", self.efficiency, 1e-3, 1.0, "a ball screw has 0.9 to 0.97")
        for name in ("motor_inertia_kg_m2", "coupling_inertia_kg_m2", "drag_torque_n_m"):
            value = getattr(self, name)
            if value is not None:
                bounds.datum(name, value, zero=True)
        if self.hold not in (MOTOR, BRAKE):
            raise unknown_name("hold", self.hold, (MOTOR, BRAKE))

    def inertia_kg_m2(self, screw: BallScrew) -> float:
        """Compute the inertia of motor, coupling and screw."""
        return self.motor_inertia_kg_m2 + self.coupling_inertia_kg_m2 + screw.inertia_kg_m2

    def torque_at(self, screw: BallScrew, load: AxisLoad, instants: Instants) -> FloatArray:
        """Compute the torque at the motor's shaft [N m] (N,).

        F tau / efficiency + J a / tau + drag; F tau x efficiency where the load drives. Where the
        motor holds in a rest, the loss counts as if it drove: as in the source, on the safe side.
        """
        tau, force = screw.ratio_m_rad, load.force_at(instants)
        passed = np.where(force * instants.direction < 0.0, self.efficiency, 1.0 / self.efficiency)
        if self.hold == BRAKE:
            passed = np.where(instants.direction == 0.0, 0.0, passed)
        drag = (self.drag_torque_n_m or 0.0) * instants.direction
        turning = self.inertia_kg_m2(screw) * instants.acceleration_m_s2 / tau + drag
        return np.asarray(force * tau * passed + turning, dtype=np.float64)

    def steady_torque_n_m(self, screw: BallScrew, load: AxisLoad, direction: float) -> float:
        """Compute the absolute torque at constant speed (direction 1 or -1) or in a rest (0)."""
        still = np.zeros(1)
        instant = Instants(still, still + direction, still, still)
        return float(np.abs(self.torque_at(screw, load, instant))[0])
