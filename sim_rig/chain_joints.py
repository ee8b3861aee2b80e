"""Joints of a chain of links: springs, dampers, and friction at the pivot."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sim_rig.load_params import LinkParams
from sim_rig.vectors import Vector, Vectors, angle_over_sine, cross, dot, minus, plus, scaled

STICTION_RAD_S = 1e-4  # below, the friction of the pivot is viscous


class ChainJoints:
    """Joints of the links; forces are those on the unit vectors of the links [N m]."""

    def __init__(self, links: Sequence[LinkParams], friction_n_m: float) -> None:
        """friction_n_m: Coulomb torque at the pivot."""
        self._links = tuple(links)
        self._friction_n_m = friction_n_m

    @property
    def has_any(self) -> bool:
        """True if a joint has a spring or a damper."""
        return any(
            link.joint_stiffness_n_m_rad or link.joint_damping_n_m_s_rad for link in self._links
        )

    def forces(self, u: Vectors, w: Vectors) -> Vectors:
        """Compute the forces of springs and dampers, each between a link and what it hangs on.

        Spring: 1/2 k phi^2 of the angle phi between them. Damper: 1/2 d |relative turn rate|^2.
        """
        forces: Vectors = [(0.0, 0.0, 0.0)] * len(self._links)
        above: Vector = (0.0, 0.0, -1.0)
        above_turn: Vector = (0.0, 0.0, 0.0)
        for i, link in enumerate(self._links):
            turn = cross(u[i], w[i])
            if link.joint_stiffness_n_m_rad:
                spring = link.joint_stiffness_n_m_rad * angle_over_sine(u[i], above)
                forces[i] = plus(forces[i], scaled(above, spring))
                if i:
                    forces[i - 1] = plus(forces[i - 1], scaled(u[i], spring))
            if link.joint_damping_n_m_s_rad:
                torque = scaled(minus(turn, above_turn), link.joint_damping_n_m_s_rad)
                forces[i] = minus(forces[i], cross(torque, u[i]))
                if i:
                    forces[i - 1] = plus(forces[i - 1], cross(torque, above))
            above, above_turn = u[i], turn
        return forces

    def friction(self, w: Vector) -> Vector:
        """Compute the force of the friction at the pivot on the first link."""
        return scaled(w, -self._friction_n_m / math.hypot(*w, STICTION_RAD_S))

    def energy_j(self, directions: Vectors) -> float:
        """Compute the energy of the springs."""
        energy_j = 0.0
        above: Vector = (0.0, 0.0, -1.0)
        for u, link in zip(directions, self._links, strict=True):
            angle = math.atan2(math.hypot(*cross(u, above)), dot(u, above))
            energy_j += 0.5 * link.joint_stiffness_n_m_rad * angle**2
            above = u
        return energy_j
