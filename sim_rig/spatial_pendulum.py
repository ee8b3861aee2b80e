"""Load of one link in space, without joint, drag and pushes: the fast case of SpatialChain."""

from __future__ import annotations

import math

from sim_rig.chain_matrices import ChainMatrices
from sim_rig.link_angles import LinkState, direction, rate, state
from sim_rig.load_params import LinkParams, LoadParams
from sim_rig.pivot import AT_REST, PivotStep, pivot_steps
from sim_rig.spatial_chain import STEP_OF_ONE_LINK_RAD, LoadEvent, slack_text
from sim_rig.vectors import Vector


class SpatialPendulum:
    """One link; equations, steps and error are those of SpatialChain, in plain floats.

    I u'' = lambda u - c (p'' + g z) - d u' with u.u'' = -|u'|^2.
    """

    def __init__(self, link: LinkParams, load: LoadParams) -> None:
        matrices = ChainMatrices([link], load)
        self._is_cable = link.kind == "point"
        self._length_m = link.length_m
        self._mass_kg = matrices.load_mass_kg
        self._centre_m = float(matrices.coupling[0]) / matrices.load_mass_kg
        self._gravity_m_s2 = load.gravity_m_s2
        inertia = float(matrices.mass[0, 0])
        self._per_m = float(matrices.coupling[0]) / inertia  # c / I
        self._drag_1_s = float(matrices.damping[0, 0]) / inertia  # d / I
        self._inertia_kg_m2 = inertia
        self._substep_s = STEP_OF_ONE_LINK_RAD / matrices.fastest_rad_s
        self.run_start_s = 0.0  # start of the run; nothing counts from it here
        self._t_s = 0.0
        self._tension_factor = 0.0  # lambda / I at the start of the last step
        self._u = direction(link.initial_x_rad, link.initial_y_rad)
        self._w = rate(self._u, link)

    @property
    def links(self) -> list[LinkState]:
        """Angles and rates of the link."""
        return [state(self._u, self._w)]

    @property
    def directions(self) -> list[Vector]:
        """Unit vector of the link."""
        return [self._u]

    def set_state(self, u: Vector, w: Vector) -> None:
        """Set the unit vector of the link and its derivative [1/s]."""
        self._u, self._w = u, w

    def force_n(self, acceleration_m_s2: Vector) -> Vector:
        """Compute the force of the load on a pivot that accelerates so [N].

        Tension along the link; the drag acts at the mass, not at the pivot.
        """
        ax, ay, az = acceleration_m_s2
        az += self._gravity_m_s2
        (ux, uy, uz), (wx, wy, wz) = self._u, self._w
        p, k = self._per_m, self._drag_1_s
        fx, fy, fz = -p * ax - k * wx, -p * ay - k * wy, -p * az - k * wz
        factor = -(wx * wx + wy * wy + wz * wz + ux * fx + uy * fy + uz * fz)
        m, c = self._mass_kg, self._mass_kg * self._centre_m
        drag = k * self._inertia_kg_m2 / self._centre_m
        return (
            -m * ax - c * (fx + factor * ux) - drag * wx,
            -m * ay - c * (fy + factor * uy) - drag * wy,
            -m * az - c * (fz + factor * uz) - drag * wz,
        )

    def advance(
        self, step_s: float, vx_m_s: list[float], vy_m_s: list[float], vz_m_s: list[float]
    ) -> None:
        """Integrate (N - 1) / 2 steps of step_s, as SpatialChain.advance. Raises LoadEvent."""
        for step in pivot_steps(step_s, (vx_m_s, vy_m_s, vz_m_s)):
            self._advance_step(step_s, step)

    def _advance_step(self, step_s: float, pivot: PivotStep) -> None:
        """Integrate a step."""
        count = max(1, math.ceil(step_s / self._substep_s))
        for i in range(count):
            shares = (i / count, (i + 0.5) / count, (i + 1) / count)
            self._runge_kutta(step_s / count, *(pivot.at(share) for share in shares))
        self._end_step(step_s)

    def advance_at_rest(self, step_s: float, steps: int) -> None:
        """Integrate steps of step_s with the pivot at rest. Raises LoadEvent."""
        count = max(1, math.ceil(step_s / self._substep_s))
        rest = AT_REST.begin_m_s2
        for _ in range(steps):
            for _ in range(count):
                self._runge_kutta(step_s / count, rest, rest, rest)
            self._end_step(step_s)

    def _end_step(self, step_s: float) -> None:
        self._t_s += step_s
        if self._is_cable and self._tension_factor > 0.0:
            tension_n = -self._tension_factor * self._inertia_kg_m2 / self._length_m
            raise LoadEvent(slack_text(1, self._t_s, tension_n))

    def _runge_kutta(self, h: float, first: Vector, middle: Vector, last: Vector) -> None:
        (x, y, z), (vx, vy, vz) = self._u, self._w
        half, sixth = 0.5 * h, h / 6.0
        a1, b1, c1, self._tension_factor = self._turn(x, y, z, vx, vy, vz, first)
        p2, q2, r2 = vx + half * a1, vy + half * b1, vz + half * c1
        a2, b2, c2, _ = self._turn(x + half * vx, y + half * vy, z + half * vz, p2, q2, r2, middle)
        p3, q3, r3 = vx + half * a2, vy + half * b2, vz + half * c2
        a3, b3, c3, _ = self._turn(x + half * p2, y + half * q2, z + half * r2, p3, q3, r3, middle)
        p4, q4, r4 = vx + h * a3, vy + h * b3, vz + h * c3
        a4, b4, c4, _ = self._turn(x + h * p3, y + h * q3, z + h * r3, p4, q4, r4, last)
        x += sixth * (vx + 2.0 * (p2 + p3) + p4)
        y += sixth * (vy + 2.0 * (q2 + q3) + q4)
        z += sixth * (vz + 2.0 * (r2 + r3) + r4)
        vx += sixth * (a1 + 2.0 * (a2 + a3) + a4)
        vy += sixth * (b1 + 2.0 * (b2 + b3) + b4)
        vz += sixth * (c1 + 2.0 * (c2 + c3) + c4)
        size = 1.0 / math.sqrt(x * x + y * y + z * z)
        x, y, z = x * size, y * size, z * size
        along = x * vx + y * vy + z * vz
        self._u = x, y, z
        self._w = vx - along * x, vy - along * y, vz - along * z

    def _turn(
        self, x: float, y: float, z: float, vx: float, vy: float, vz: float, pivot: Vector
    ) -> tuple[float, float, float, float]:
        """Compute u'' and lambda / I."""
        ax, ay, az = pivot
        p, k = self._per_m, self._drag_1_s
        fx, fy, fz = -p * ax - k * vx, -p * ay - k * vy, -p * (az + self._gravity_m_s2) - k * vz
        along = x * fx + y * fy + z * fz
        factor = -(vx * vx + vy * vy + vz * vz + along) / (x * x + y * y + z * z)
        return fx + factor * x, fy + factor * y, fz + factor * z, factor
