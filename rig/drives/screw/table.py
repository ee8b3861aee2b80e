"""The motion-law table of a cycle, phase by phase (source 004, figs. C.9 and C.10)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rig.drives.screw.cycle import Cycle, Move
from rig.drives.screw.demand import powers
from rig.drives.screw.load import AxisLoad
from rig.drives.screw.shaft import BallScrew
from rig.drives.screw.transmission import Transmission


class CyclePhaseRow(NamedTuple):
    """One phase; acceleration, forces and torque are those of its largest force, as in the source."""

    move: int
    phase: int  # 0 is the rest
    duration_s: float
    mean_speed_m_s: float
    acceleration_m_s2: float
    friction_n: float
    inertia_n: float
    force_n: float
    torque_n_m: float
    peak_torque_n_m: float  # the largest in size, with its sign; elsewhere where the acceleration is not constant
    peak_speed_m_s: float
    peak_power_w: float  # of the motor, the largest in size; negative where it brakes


def table(
    cycle: Cycle, load: AxisLoad, transmission: Transmission, screw: BallScrew
) -> list[CyclePhaseRow]:
    """All phases of all moves."""
    known = {move: _rows(move, load, transmission, screw) for move in cycle.counts}
    return [
        row._replace(move=number)
        for number, move in enumerate(cycle.moves, start=1)
        for row in known[move]
    ]


def _rows(
    move: Move, load: AxisLoad, transmission: Transmission, screw: BallScrew
) -> list[CyclePhaseRow]:
    rows = []
    for phase in move.phases:
        at = phase.instants
        force, torque = load.force_at(at), transmission.torque_at(screw, load, at)
        driving_w, braking_w = powers(phase, load, transmission, screw)
        k = int(np.abs(force).argmax())
        rows.append(
            CyclePhaseRow(
                0,
                phase.number,
                phase.duration_s,
                float(at.weight_s @ at.speed_m_s) / phase.duration_s,
                float(at.acceleration_m_s2[k]),
                load.friction_n * float(at.direction[k]),
                load.mass_kg * float(at.acceleration_m_s2[k]),
                float(force[k]),
                float(torque[k]),
                float(torque[np.abs(torque).argmax()]),
                float(np.abs(at.speed_m_s).max()),
                driving_w if driving_w >= braking_w else -braking_w,
            )
        )
    return rows
