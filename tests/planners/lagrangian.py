"""Independent dynamics of cart and chain, from the positions of point masses alone.

A check for models and replays. A homogeneous bar is three points (mass/6 at its ends, 4 mass/6 in
its middle): Simpson's rule is exact for a velocity that is linear along it. Every derivative is
taken numerically, by a complex step or by Cauchy's integral, to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

STEP = 1e-30
CIRCLE = 0.1 * np.exp(2j * np.pi * np.arange(8) / 8)


@dataclass(frozen=True)
class CartAndChain:
    """Cart and chain with coordinates q = [y, angles].

    Relative angles count from the link above, and so do springs and dampers.
    """

    links: tuple  # of (length, mass, kind)
    springs: tuple = ()  # n - 1
    dampers: tuple = ()  # n - 1
    tip: float = 0.0
    gravity: float = 9.81
    cart: float = 32.0
    relative: bool = False

    def points(self, q):
        """List masses (P,) and places (P, 2, ...) for q (n + 1, ...), x to the right and z up."""
        angles = np.cumsum(q[1:], axis=0) if self.relative else q[1:]
        joint = np.array([q[0], 0.0 * q[0]])
        masses, places = [self.cart], [joint]
        for (length, mass, kind), angle in zip(self.links, angles, strict=True):
            along = length * np.array([np.sin(angle), -np.cos(angle)])
            shares = ((0.0, 1 / 6), (0.5, 4 / 6), (1.0, 1 / 6)) if kind == "bar" else ((1.0, 1.0),)
            masses += [mass * share for _, share in shares]
            places += [joint + place * along for place, _ in shares]
            joint = joint + along
        return np.array([*masses, self.tip]), np.array([*places, joint])

    def slopes(self, q):
        """Compute the derivative of every place by every coordinate: (P, 2, n + 1)."""
        return self.points(q[:, None] + 1j * STEP * np.eye(len(q)))[1].imag / STEP

    def bend(self, q, qd):
        """Compute the second derivative of the places along qd: (P, 2)."""
        circle = CIRCLE / max(1.0, np.abs(qd).max())
        around = self.points(q[:, None] + qd[:, None] * circle)[1]  # (P, 2, 8)
        return 2.0 * np.mean(around * circle**-2, axis=-1).real

    def mass(self, q):
        """Compute the mass matrix (n + 1, n + 1)."""
        return self._parts(q)[0]

    def forces(self, q, qd):
        """Compute mass(q) qdd without a force on the cart: (n + 1,).

        From inertia, gravity, springs and dampers.
        """
        _, m, slopes = self._parts(q)
        pull = self.bend(q, qd)
        pull[:, 1] += self.gravity
        out = -(m[:, None] * pull).ravel() @ slopes.reshape(-1, len(q))
        for i, (k, c) in enumerate(zip(self.springs, self.dampers, strict=True)):
            across = np.zeros(len(q))
            across[i + 2] = 1.0
            across[i + 1] = 0.0 if self.relative else -1.0
            out -= across * (k * across @ q + c * across @ qd)
        return out

    def _parts(self, q):
        m, slopes = self.points(q)[0], self.slopes(q)
        flat = slopes.reshape(-1, len(q))
        return flat.T @ (np.repeat(m, 2)[:, None] * flat), m, slopes

    def driven(self, q, qd, acceleration):
        """Compute the angular accelerations under a platform with that acceleration: (n,)."""
        mass = self.mass(q)
        return np.linalg.solve(mass[1:, 1:], self.forces(q, qd)[1:] - mass[1:, 0] * acceleration)

    def pushed(self, q, qd, force):
        """Compute [y'', angular accelerations] with a force on the platform: (n + 1,)."""
        out = self.forces(q, qd)
        out[0] += force
        return np.linalg.solve(self.mass(q), out)

    def energy(self, q, qd):
        """Sum kinetic, gravitational and spring energy."""
        m, places = self.points(q)
        across = q[2:] if self.relative else np.diff(q[1:])
        return (
            0.5 * qd @ self.mass(q) @ qd
            + self.gravity * m @ places[:, 1]
            + 0.5 * np.array(self.springs) @ across**2
        )

    def play(self, trajectory, start=None, steps=()):
        """Compute the largest |angle| and [angles, rates] at the end, by scipy.

        steps (before, after) are speeds outside the move.
        """
        n = len(self.links)
        x = np.zeros(2 * n) if start is None else np.array(start, dtype=float)
        before, after = steps or (0.0, 0.0)
        peak, speed = np.abs(x[:n]).max(), before
        for begin, piece in zip(trajectory.breaks_s, trajectory.pieces, strict=False):
            x = self._kicked(x, float(piece.at(np.zeros(()), 1)) - speed)

            def rates(t, x, piece=piece, begin=begin):
                q, qd = np.append(0.0, x[:n]), np.append(0.0, x[n:])
                return np.append(
                    x[n:], self.driven(q, qd, float(piece.at(np.asarray(t - begin), 2)))
                )

            turns = [lambda t, x, i=i: x[n + i] for i in range(n)]
            span = (begin, begin + piece.duration_s)
            out = solve_ivp(rates, span, x, "DOP853", rtol=1e-10, atol=1e-12, events=turns)
            x, speed = out.y[:, -1], float(piece.at(np.asarray(piece.duration_s), 1))
            extremes = [
                np.abs(y.reshape(-1, 2 * n)[:, i]).max(initial=0.0)
                for i, y in enumerate(out.y_events)
            ]
            peak = max(peak, np.abs(x[:n]).max(), *extremes)
        return peak, self._kicked(x, after - speed)

    def _kicked(self, x, step):
        """Apply the impulse of a step in the platform's speed."""
        n = len(self.links)
        mass = self.mass(np.append(0.0, x[:n]))
        return np.append(x[:n], x[n:] - np.linalg.solve(mass[1:, 1:], mass[1:, 0] * step))
