"""Replay of one link by Runge-Kutta of order 4 in plain floats."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from planners.errors import PlanError
from planners.models.model import Equations
from planners.replay.swing import ReplaySegment
from planners.trajectories.cells import resolve
from planners.trajectories.pieces import FloatArray, Piece, Smooth
from planners.trajectories.trajectory import Trajectory

STEPS_PER_RADIAN = 40.0  # of the load's phase w t; error below 1e-8 rad in 3 s of a 1 m cable
STEPS_PER_CELL = 16  # of the commanded motion's fastest mode
SPEED_ERROR_RAD = 1e-10  # integral of speed over length, in a piece, by Simpson's rule


def play_one_link(
    equations: Equations, trajectory: Trajectory, angles: FloatArray, momenta: FloatArray
) -> Iterator[ReplaySegment]:
    """Integrate one link piece by piece: plain floats are ten times faster than arrays of one."""
    link, inertia = _Link(equations), float(equations.mass_kg_m2[0, 0])
    theta, p = float(angles[0]), float(momenta[0]) / inertia
    for start, piece in zip(trajectory.breaks_s, trajectory.pieces, strict=False):
        n = link.steps(piece)
        t = np.linspace(0.0, piece.duration_s, 2 * n + 1)  # ends and middles of the steps
        v = piece.at(t, 1)
        h = piece.duration_s / n
        spin = (v * link.coupling).tolist()  # speed over the reduced length [rad/s]
        path = [(theta, p)]
        for k in range(0, 2 * n, 2):
            try:
                theta, p = link.step(theta, p, h, spin[k], spin[k + 1], spin[k + 2])
            except (ValueError, OverflowError):  # the sine of infinity
                raise PlanError(
                    f"the load rotates too fast in the piece that begins at {start:.6g} s, at a "
                    f"speed of {v[k]:.3g} m/s; must be slow enough for steps of {h:.3g} s: "
                    "give the move more time"
                ) from None
            path.append((theta, p))
        states = np.array(path)
        yield ReplaySegment(start + t[::2], states[:, :1], inertia * states[:, 1:], v[::2])


class _Link:
    """Equations of motion of one link: state (theta, p / inertia), input speed over length."""

    def __init__(self, equations: Equations) -> None:
        inertia = float(equations.mass_kg_m2[0, 0])
        self.coupling = float(equations.coupling_kg_m[0]) / inertia  # 1 / length of a point mass
        self.gravity = equations.gravity_m_s2 * self.coupling
        self.spring = float(equations.springs_n_m_rad[0, 0]) / inertia
        self.damping = float(equations.damping_n_m_s_rad[0, 0]) / inertia

    def steps(self, piece: Piece) -> int:
        """Compute the number of steps that resolve the load's phase and the piece's speed."""
        cells = 0
        if isinstance(piece, Smooth):
            cells = resolve(piece, 1).halves_s.size
        elif piece.modes:
            cells = piece.cell_count
        phase = math.sqrt(self.gravity + self.spring) * piece.duration_s
        phase_steps = math.ceil(STEPS_PER_RADIAN * phase)
        return max(phase_steps, STEPS_PER_CELL * cells, self._simpson_steps(piece))

    def _simpson_steps(self, piece: Piece) -> int:
        """Compute the number of steps that integrate the polynomial's speed.

        Simpson's rule has an error of d (d/n)^4 max|v''''| / 2880.
        """
        if isinstance(piece, Smooth) or len(piece.coefficients) < 6:
            return 1
        fifth = sum(
            abs(c) * math.perm(j, 5) * piece.duration_s**j for j, c in enumerate(piece.coefficients)
        )
        return math.ceil(math.sqrt(math.sqrt(fifth * self.coupling / (2880.0 * SPEED_ERROR_RAD))))

    def rates(self, theta: float, p: float, spin: float) -> tuple[float, float]:
        """Compute theta' and p' at the speed over length `spin` [rad/s]."""
        s = math.sin(theta)
        rate = p - spin * math.cos(theta)
        return rate, -(self.gravity + spin * rate) * s - self.damping * rate - self.spring * theta

    def step(
        self, theta: float, p: float, h: float, spin0: float, spin_middle: float, spin1: float
    ) -> tuple[float, float]:
        """Integrate one step of length h by the classical Runge-Kutta scheme."""
        a1, b1 = self.rates(theta, p, spin0)
        a2, b2 = self.rates(theta + h / 2 * a1, p + h / 2 * b1, spin_middle)
        a3, b3 = self.rates(theta + h / 2 * a2, p + h / 2 * b2, spin_middle)
        a4, b4 = self.rates(theta + h * a3, p + h * b3, spin1)
        return theta + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), p + h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
