"""Motion-law table of a cycle, phase by phase (source 004, figs. C.9 and C.10)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rig.drives.screw.cycle import Cycle, Move
from rig.drives.screw.demand import powers
from rig.drives.screw.load import AxisLoad
from rig.drives.screw.shaft import BallScrew
from rig.drives.screw.transmission import Transmission


class CyclePhaseRow(NamedTuple):
    """Row of the table: one phase.

    Acceleration, forces and torque_n_m are those at its largest force, as in the source.
    """

    move: int
    phase: int  # 0 is the rest
    duration_s: float
    mean_speed_m_s: float
    acceleration_m_s2: float
    friction_n: float
    inertia_n: float
    force_n: float
    torque_n_m: float
    # largest in absolute value, with its sign; at another instant where the acceleration varies
    peak_torque_n_m: float
    peak_speed_m_s: float
    peak_power_w: float  # of the motor, largest in absolute value; negative where it brakes


def table(
    cycle: Cycle, load: AxisLoad, transmission: Transmission, screw: BallScrew
) -> list[CyclePhaseRow]:
    """Compute the rows of all moves; equal moves are computed once."""
    rows_of = {move: _rows(move, load, transmission, screw) for move in cycle.counts}
    rows = []
    for number, move in enumerate(cycle.moves, start=1):
        rows += [row._replace(move=number) for row in rows_of[move]]
    return rows


def _rows(
    move: Move, load: AxisLoad, transmission: Transmission, screw: BallScrew
) -> list[CyclePhaseRow]:
    """Compute the rows of one move, numbered 0."""
    rows = []
    for phase in move.phases:
        at = phase.instants
        force = load.force_at(at)
        torque = transmission.torque_at(screw, load, at)
        driving_w, braking_w = powers(phase, load, transmission, screw)
        k = int(np.abs(force).argmax())
        rows.append(
            CyclePhaseRow(
                move=0,
                phase=phase.number,
                duration_s=phase.duration_s,
                mean_speed_m_s=float(at.weight_s @ at.speed_m_s) / phase.duration_s,
                acceleration_m_s2=float(at.acceleration_m_s2[k]),
                friction_n=load.friction_n * float(at.direction[k]),
                inertia_n=load.mass_kg * float(at.acceleration_m_s2[k]),
                force_n=float(force[k]),
                torque_n_m=float(torque[k]),
                peak_torque_n_m=float(torque[np.abs(torque).argmax()]),
                peak_speed_m_s=float(np.abs(at.speed_m_s).max()),
                peak_power_w=driving_w if driving_w >= braking_w else -braking_w,
            )
        )
    return rows
