"""The plan played on the nonlinear pendulum: what the load does when small angles are not assumed.

With p = theta' + v cos(theta)/l the platform's speed v is the only input: theta' = p - v cos(theta)/l,
p' = -(g/l) sin(theta) - 2 zeta w theta' - (v/l) sin(theta) theta'. A step in acceleration is then a mere kink, and a
step in speed is exact, for p does not feel it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.cells import resolve
from planners.models.pendulum import PendulumModel
from planners.pieces import FloatArray, Piece, Smooth, polynomial
from planners.trajectory import Trajectory

STEPS_PER_RADIAN = 40.0  # of the load's own phase w t: leaves less than 1e-8 rad in 3 s of a 1 m cable
STEPS_PER_CELL = 16  # of the commanded motion's fastest mode


class Swing(NamedTuple):
    """Cable angle during a move, at the integration steps."""

    t_s: FloatArray  # (N,)
    angle_rad: FloatArray  # (N,)
    angular_velocity_rad_s: FloatArray  # (N,)

    def peak_rad(self) -> float:
        """Largest |angle|, between the steps too (cubic Hermite)."""
        k = int(np.argmax(np.abs(self.angle_rad)))
        around = [self._between(i) for i in (k - 1, k) if 0 <= i < self.t_s.size - 1]
        return max(Trajectory((piece,)).peak().value for piece in around)

    def _between(self, i: int) -> Piece:
        h = float(self.t_s[i + 1] - self.t_s[i])
        a, b = self.angle_rad[i : i + 2].tolist()
        da, db = (h * self.angular_velocity_rad_s[i : i + 2]).tolist()
        return polynomial(h, (a, da / h, (3 * (b - a) - 2 * da - db) / h**2, (2 * (a - b) + da + db) / h**3))


def replay(
    model: PendulumModel,
    trajectory: Trajectory,
    *,
    angle_rad: float = 0.0,
    angular_velocity_rad_s: float = 0.0,
    speed_before_m_s: float = 0.0,
    speed_after_m_s: float = 0.0,
) -> Swing:
    """Swing of the load from the start to the end of the trajectory, by Runge-Kutta of order 4 between its joints.

    speed_before_m_s and speed_after_m_s are the platform's outside the move: where the trajectory's own differ, the
    load feels the step.
    """
    swing = _Pendulum(model)
    theta, p = angle_rad, angular_velocity_rad_s + speed_before_m_s * math.cos(angle_rad) / model.length_m
    angles, momenta, speeds, times = [theta], [p], [float(trajectory.pieces[0].at(np.zeros(()), 1))], [np.zeros(1)]
    for start, piece in zip(trajectory.breaks_s, trajectory.pieces, strict=False):
        n = _steps(model, piece)
        t = np.linspace(0.0, piece.duration_s, 2 * n + 1)  # ends and middles of the steps
        v = piece.at(t, 1).tolist()
        for k in range(0, 2 * n, 2):
            theta, p = swing.step(theta, p, piece.duration_s / n, v[k], v[k + 1], v[k + 2])
            angles.append(theta)
            momenta.append(p)
        speeds.extend(v[2::2])
        times.append(start + t[2::2])
    speeds[-1] = speed_after_m_s
    angle = np.array(angles)
    return Swing(np.concatenate(times), angle, np.array(momenta) - np.array(speeds) * np.cos(angle) / model.length_m)


def _steps(model: PendulumModel, piece: Piece) -> int:
    phase = model.natural_frequency_rad_s * piece.duration_s
    cells = resolve(piece, 1).halves_s.size if isinstance(piece, Smooth) else piece.cells
    return max(math.ceil(STEPS_PER_RADIAN * phase), STEPS_PER_CELL * cells)


class _Pendulum:
    """Rates of (theta, p) in plain floats, ten times faster than arrays of two."""

    def __init__(self, model: PendulumModel) -> None:
        self.length = model.length_m
        self.stiffness = model.natural_frequency_rad_s**2
        self.damping = 2.0 * model.damping_ratio * model.natural_frequency_rad_s

    def rates(self, theta: float, p: float, v: float) -> tuple[float, float]:
        s, push = math.sin(theta), v / self.length
        rate = p - push * math.cos(theta)
        return rate, -self.stiffness * s - self.damping * rate - push * s * rate

    def step(self, theta: float, p: float, h: float, v0: float, v_middle: float, v1: float) -> tuple[float, float]:
        a1, b1 = self.rates(theta, p, v0)
        a2, b2 = self.rates(theta + h / 2 * a1, p + h / 2 * b1, v_middle)
        a3, b3 = self.rates(theta + h / 2 * a2, p + h / 2 * b2, v_middle)
        a4, b4 = self.rates(theta + h * a3, p + h * b3, v1)
        return theta + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), p + h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
