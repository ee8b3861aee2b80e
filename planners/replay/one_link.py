"""One link, by Runge-Kutta of order 4 in plain floats: ten times faster than arrays of one."""

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

STEPS_PER_RADIAN = (
    40.0  # of the load's own phase w t; leaves less than 1e-8 rad in 3 s of a 1 m cable
)
STEPS_PER_CELL = 16  # of the commanded motion's fastest mode
SPEED_ERROR = 1e-10  # of the speed over the length, in radians a piece, by Simpson's rule


def play_one_link(
    equations: Equations, trajectory: Trajectory, angles: FloatArray, momenta: FloatArray
) -> Iterator[ReplaySegment]:
    """Plain floats: ten times faster than arrays of one."""
    link, inertia = _Link(equations), float(equations.mass_kg_m2[0, 0])
    theta, p = float(angles[0]), float(momenta[0]) / inertia
    for start, piece in zip(trajectory.breaks_s, trajectory.pieces, strict=False):
        n = link.steps(piece)
        t = np.linspace(0.0, piece.duration_s, 2 * n + 1)  # ends and middles of the steps
        v, h = piece.at(t, 1), piece.duration_s / n
        push = (v * link.reach).tolist()
        path = [(theta, p)]
        for k in range(0, 2 * n, 2):
            try:
                theta, p = link.step(theta, p, h, push[k], push[k + 1], push[k + 2])
            except (ValueError, OverflowError):  # the sine of infinity
                raise PlanError(
                    f"the load spins away in the piece that begins at {start:.6g} s, at a speed of {v[k]:.3g} m/s; steps of "
                    f"{h:.3g} s must follow it: give the move more time"
                ) from None
            path.append((theta, p))
        states = np.array(path)
        yield ReplaySegment(start + t[::2], states[:, :1], inertia * states[:, 1:], v[::2])


class _Link:
    """Rates of (theta, p / mass) of a single link, pushed by the speed over its reduced length."""

    def __init__(self, equations: Equations) -> None:
        inertia = float(equations.mass_kg_m2[0, 0])
        self.reach = float(equations.coupling_kg_m[0]) / inertia  # of a point mass: 1 / length
        self.weight = equations.gravity_m_s2 * self.reach
        self.spring = float(equations.springs_n_m_rad[0, 0]) / inertia
        self.damping = float(equations.damping_n_m_s_rad[0, 0]) / inertia

    def steps(self, piece: Piece) -> int:
        """How many resolve the load's phase and the piece's speed."""
        cells = 0
        if isinstance(piece, Smooth):
            cells = resolve(piece, 1).halves_s.size
        elif piece.modes:
            cells = piece.cell_count
        phase = math.sqrt(self.weight + self.spring) * piece.duration_s
        return max(
            math.ceil(STEPS_PER_RADIAN * phase), STEPS_PER_CELL * cells, self._simpson_steps(piece)
        )

    def _simpson_steps(self, piece: Piece) -> int:
        """How many integrate the polynomial's speed: Simpson's rule leaves d (d/n)^4 max|v''''| / 2880."""
        if isinstance(piece, Smooth) or len(piece.coefficients) < 6:
            return 1
        bend = sum(
            abs(c) * math.perm(j, 5) * piece.duration_s**j for j, c in enumerate(piece.coefficients)
        )
        return math.ceil(math.sqrt(math.sqrt(bend * self.reach / (2880.0 * SPEED_ERROR))))

    def rates(self, theta: float, p: float, push: float) -> tuple[float, float]:
        s = math.sin(theta)
        rate = p - push * math.cos(theta)
        return rate, -(self.weight + push * rate) * s - self.damping * rate - self.spring * theta

    def step(
        self, theta: float, p: float, h: float, push0: float, push_middle: float, push1: float
    ) -> tuple[float, float]:
        a1, b1 = self.rates(theta, p, push0)
        a2, b2 = self.rates(theta + h / 2 * a1, p + h / 2 * b1, push_middle)
        a3, b3 = self.rates(theta + h / 2 * a2, p + h / 2 * b2, push_middle)
        a4, b4 = self.rates(theta + h * a3, p + h * b3, push1)
        return theta + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), p + h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
