"""Phases of a move as a quadrature: instants with weights, and maxima within a phase."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from planners.trajectories.cells import resolve
from planners.trajectories.pieces import FloatArray, Piece

# Nodes of each phase, exact for constant acceleration. Otherwise losses bend the torque where the
# force changes its sign: means are then right to 1e-6 (cubed forces), 1e-5 (squared torques) and
# 1e-3 (driving and braking powers).
GAUSS_NODES = 128
REFINEMENT_ROUNDS = 6  # they leave 3e-14 of the largest power, with losses
REFINEMENT_POINTS = 17  # each round narrows the interval to an eighth


class Instants(NamedTuple):
    """State of an axis at the nodes of a quadrature, (N,) each.

    Extremes of speed and acceleration are among the instants, with weight 0.
    """

    weight_s: FloatArray  # their sum is the duration
    direction: FloatArray  # of the move: 1 or -1; 0 in a rest
    speed_m_s: FloatArray
    acceleration_m_s2: FloatArray


class CyclePhase(NamedTuple):
    """Row of a motion-law table: a piece of a move's law, or the rest after it."""

    number: int  # from 1; 0 is the rest
    duration_s: float
    instants: Instants  # in the order of time
    t_s: FloatArray  # (N,) times of the instants, from 0
    piece: Piece | None = None  # of the position; None at constant acceleration

    def maximum(self, quantity: Callable[[Instants], FloatArray]) -> float:
        """Compute the largest value of a quantity over the phase.

        It is refined around the largest instant. At constant acceleration the largest instant is
        taken itself: the quantity must then be linear in time.
        """
        t = self.t_s
        values = quantity(self.instants)
        best = float(values.max())
        if self.piece is None:
            return best
        direction = float(self.instants.direction[0])
        for _ in range(REFINEMENT_ROUNDS):
            k = int(values.argmax())
            t = np.linspace(t[max(k - 1, 0)], t[min(k + 1, t.size - 1)], REFINEMENT_POINTS)
            values = quantity(_instants(self.piece, t, np.zeros_like(t), direction))
            best = max(best, float(values.max()))
        return best


def moving_phase(number: int, piece: Piece, direction: float) -> CyclePhase:
    """Build the phase of a piece of a move's position."""
    x, w = _quadrature()
    edges = np.unique(np.concatenate([resolve(piece, order).candidates_s() for order in (1, 2)]))
    t = np.concatenate([piece.duration_s * (1.0 + x) / 2.0, edges])
    weight = np.concatenate([piece.duration_s * w / 2.0, np.zeros_like(edges)])
    rank = np.argsort(t, kind="stable")
    instants = _instants(piece, t[rank], weight[rank], direction)
    varies = np.ptp(instants.acceleration_m_s2) > 0.0
    return CyclePhase(number, piece.duration_s, instants, t[rank], piece if varies else None)


def rest_phase(duration_s: float) -> CyclePhase:
    """Build the phase of the rest after a move."""
    still = np.zeros(1)
    return CyclePhase(0, duration_s, Instants(np.full(1, duration_s), still, still, still), still)


def _instants(piece: Piece, t: FloatArray, weight_s: FloatArray, direction: float) -> Instants:
    return Instants(weight_s, np.full_like(t, direction), piece.at(t, 1), piece.at(t, 2))


@lru_cache(maxsize=1)
def _quadrature() -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of the Gauss-Legendre rule on [-1, 1], (GAUSS_NODES,) each."""
    x, w = np.polynomial.legendre.leggauss(GAUSS_NODES)
    return x, w
