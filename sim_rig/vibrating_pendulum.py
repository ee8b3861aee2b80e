"""Load on a cable that vibrates itself: the first modes of a string between platform and load.

The string of length L, tension T and mass m' per length is displaced across the cable by
sum_k q_k sin(k pi s / L). Its ends move with platform and load, so the straight cable is the frame:

    q_k'' + 2 zeta w_k q_k' + w_k^2 q_k = 2 / (k pi) (f_0 - (-1)^k f_1)
    w_k = k pi sqrt(T / m') / L

with f = g - a across the cable at the upper (0) and the lower end (1). The vibration does not act
back on the load.
"""

from __future__ import annotations

import math

from sim_rig.load_params import CableParams, LinkParams, LoadParams
from sim_rig.pivot import AT_REST, PivotStep
from sim_rig.spatial_pendulum import SpatialPendulum
from sim_rig.vectors import Vector, dot, plus, scaled

MIN_TENSION_SHARE = 0.01  # of the weight: near a slack cable the modes are not followed further
POINTS = 41  # of the cable in a picture
MODE_STATE = list[tuple[float, float]]  # displacement [m] and speed [m/s] of each mode


class VibratingPendulum(SpatialPendulum):
    """Cable with a point mass; the modes are followed in both planes, exactly over each step.

    Tension and forces are those of the middle of a step. Raises ValueError for a bar.
    """

    def __init__(self, link: LinkParams, load: LoadParams, cable: CableParams) -> None:
        super().__init__(link, load)
        if link.kind != "point":
            raise ValueError(
                "[bench.cable] of a bar; must be with a link of the kind point: leave it out"
            )
        self._cable = cable
        self._modes_x: MODE_STATE = [(0.0, 0.0)] * cable.modes
        self._modes_y: MODE_STATE = [(0.0, 0.0)] * cable.modes

    @property
    def cable_modes_m(self) -> tuple[float, ...]:
        """Amplitudes of the modes across the cable in the plane x, positive ahead."""
        return tuple(q for q, _ in self._modes_x)

    @property
    def points_m(self) -> list[Vector]:
        """Points of the cable relative to the pivot, from it down."""
        sides = [_across(self._u, plane) for plane in (0, 1)]
        points = []
        for j in range(POINTS):
            share = j / (POINTS - 1)
            point = scaled(self._u, share * self._length_m)
            for across, states in zip(sides, (self._modes_x, self._modes_y), strict=True):
                bend_m = sum(
                    q * math.sin(k * math.pi * share) for k, (q, _) in enumerate(states, start=1)
                )
                point = plus(point, scaled(across, bend_m))
            points.append(point)
        return points

    def advance_at_rest(self, step_s: float, steps: int) -> None:
        """Integrate steps of step_s with the pivot at rest. Raises LoadEvent."""
        for _ in range(steps):
            self._advance_step(step_s, AT_REST)

    def _advance_step(self, step_s: float, pivot: PivotStep) -> None:
        super()._advance_step(step_s, pivot)
        pivot_m_s2 = pivot.at(0.5)
        (ux, uy, uz), (wx, wy, wz) = self._u, self._w
        ax, ay, az, factor = self._turn(ux, uy, uz, wx, wy, wz, pivot_m_s2)
        tension_n = -factor * self._inertia_kg_m2 / self._length_m
        weight_n = self._mass_kg * self._gravity_m_s2
        if tension_n < MIN_TENSION_SHARE * weight_n:
            return
        length_m = self._length_m
        px, py, pz = pivot_m_s2
        load_m_s2 = px + length_m * ax, py + length_m * ay, pz + length_m * az
        speed_m_s = math.sqrt(tension_n / self._cable.linear_density_kg_m)
        base_rad_s = math.pi / length_m * speed_m_s
        for plane in (0, 1):
            across = _across(self._u, plane)
            weight_m_s2 = -self._gravity_m_s2 * across[2]
            upper_m_s2 = weight_m_s2 - dot(pivot_m_s2, across)
            lower_m_s2 = weight_m_s2 - dot(load_m_s2, across)
            states = self._modes_x if plane == 0 else self._modes_y
            for k, state in enumerate(states, start=1):
                push = 2.0 / (k * math.pi) * (upper_m_s2 - (-1) ** k * lower_m_s2)
                states[k - 1] = _oscillate(
                    state, push, k * base_rad_s, self._cable.damping_ratio, step_s
                )


def _across(u: Vector, plane: int) -> Vector:
    """Compute the unit vector across the link in the plane x or y, towards that axis."""
    out = u[plane]
    size = math.hypot(out, u[2])
    return (-u[2] / size, 0.0, out / size) if plane == 0 else (0.0, -u[2] / size, out / size)


def _oscillate(
    state: tuple[float, float], push: float, omega_rad_s: float, ratio: float, step_s: float
) -> tuple[float, float]:
    """Advance q'' + 2 zeta w q' + w^2 q = push over a step, exactly for a constant push."""
    rest = push / omega_rad_s**2
    q, v = state[0] - rest, state[1]
    decay = ratio * omega_rad_s
    damped = omega_rad_s * math.sqrt(1.0 - ratio * ratio)
    c, s = math.cos(damped * step_s), math.sin(damped * step_s) / damped
    fade = math.exp(-decay * step_s)
    return (
        rest + fade * (q * (c + decay * s) + v * s),
        fade * (v * (c - decay * s) - q * omega_rad_s**2 * s),
    )
