"""A move as a quadrature: instants with weights, phase by phase, and the largest value of a quantity within a phase."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from planners.trajectories.cells import resolve
from planners.trajectories.pieces import FloatArray, Piece

# Nodes of each phase: exact for constant acceleration. Else a loss bends the torque where the force changes sign, and means are
# right to 1e-6 of cubed forces, 1e-5 of squared torques, 1e-3 of powers that drive or brake.
GAUSS_NODES = 128
ROUNDS, POINTS = (
    6,
    17,
)  # each round looks eight times closer; six leave 3e-14 of the largest power, with losses


class Instants(NamedTuple):
    """Extremes of speed and acceleration are among the instants, with no weight: (N,) each."""

    weight_s: FloatArray  # sums to the duration
    direction: FloatArray  # of the move: 1, -1, and 0 in a rest
    speed_m_s: FloatArray
    acceleration_m_s2: FloatArray


class CyclePhase(NamedTuple):
    """One row of a motion-law table: a piece of a move's law, or the rest after it."""

    number: int  # from 1; 0 is the rest
    duration_s: float
    instants: Instants  # in the order of time
    t_s: FloatArray  # (N,) of the instants, from 0
    piece: Piece | None = None  # of a move's position, where its acceleration is not constant

    def greatest(self, quantity: Callable[[Instants], FloatArray]) -> float:
        """Largest value over the phase, refined around the largest of the instants; that one itself at constant acceleration,
        where the quantity is to change in proportion to the time."""
        t, values, piece = self.t_s, quantity(self.instants), self.piece
        best = float(values.max())
        if piece is None:
            return best
        for _ in range(ROUNDS):
            k = int(values.argmax())
            t = np.linspace(t[max(k - 1, 0)], t[min(k + 1, t.size - 1)], POINTS)
            values = quantity(
                _instants(piece, t, np.zeros_like(t), float(self.instants.direction[0]))
            )
            best = max(best, float(values.max()))
        return best


def moving(number: int, piece: Piece, direction: float) -> CyclePhase:
    """A piece of a move's position."""
    x, w = _quadrature()
    edges = np.unique(np.concatenate([resolve(piece, order).candidates_s() for order in (1, 2)]))
    t = np.concatenate([piece.duration_s * (1.0 + x) / 2.0, edges])
    weight = np.concatenate([piece.duration_s * w / 2.0, np.zeros_like(edges)])
    rank = np.argsort(t, kind="stable")
    instants = _instants(piece, t[rank], weight[rank], direction)
    varies = np.ptp(instants.acceleration_m_s2) > 0.0
    return CyclePhase(number, piece.duration_s, instants, t[rank], piece if varies else None)


def resting(duration_s: float) -> CyclePhase:
    """The rest after a move."""
    still = np.zeros(1)
    return CyclePhase(0, duration_s, Instants(np.full(1, duration_s), still, still, still), still)


def _instants(piece: Piece, t: FloatArray, weight_s: FloatArray, direction: float) -> Instants:
    return Instants(weight_s, np.full_like(t, direction), piece.at(t, 1), piece.at(t, 2))


@lru_cache(maxsize=1)
def _quadrature() -> tuple[FloatArray, FloatArray]:
    x, w = np.polynomial.legendre.leggauss(GAUSS_NODES)
    return x, w
