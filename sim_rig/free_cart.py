"""Cart on a level rail that a force moves along x, with a chain of links below it.

No outside force but the given one acts along the rail, so momentum and centre of mass of cart and
load follow from it alone:

    m x' + sum_i c_i u_i' = p,    m x + sum_i c_i u_i = s,    p' = F,    s' = p

m is the mass of cart and load; x-components of u_i. Only the links are integrated. Their equations
are affine in x'', hence it follows from the accelerations of the links under a pivot that stands
and from their change with x''.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim_rig.link_angles import LinkState
from sim_rig.load_params import LinkParams, LoadParams
from sim_rig.spatial_chain import MAX_SUBSTEPS, SpatialChain
from sim_rig.vectors import Vector, Vectors, added, dot, moved, product, scaled, solve

# longest step over the fastest mode [rad]: at 10 Hz that mode loses 5e-6 of its energy in 10 s,
# slower ones less by the fifth power of the frequency
STEP_RAD = 0.05
AT_REST: Vector = (0.0, 0.0, 0.0)


class FreeCart:
    """Free cart with a chain of links; Runge-Kutta 4 in steps of a part of a millisecond.

    The cart starts at rest at position 0. Joints may have springs and dampers. Raises ValueError
    for a mass <= 0, for forces of the air, and for a load too stiff for MAX_SUBSTEPS.
    """

    def __init__(self, cart_mass_kg: float, links: Sequence[LinkParams], load: LoadParams) -> None:
        if not cart_mass_kg > 0.0:
            raise ValueError(
                f"cart_mass_kg = {cart_mass_kg}; must be > 0: weigh the cart, and add the "
                "inertia of its drive"
            )
        if load.damping_ratio or any(link.drag_n_s2_m2 for link in links):
            raise ValueError(
                "damping_ratio or drag_n_s2_m2 of a load under a free cart; must be 0, the air "
                "takes momentum: use joint_damping_n_m_s_rad"
            )
        self._chain = _ChainUnderCart(cart_mass_kg, links, load)
        self._momentum_n_s = self._chain.coupled(self._chain.rates)
        self._moment_kg_m = self._chain.coupled(self._chain.directions)

    @property
    def position_m(self) -> float:
        """Position of the cart, 0 at the start."""
        swung = self._chain.coupled(self._chain.directions)
        return (self._moment_kg_m - swung) / self._chain.total_mass_kg

    @property
    def velocity_m_s(self) -> float:
        """Velocity of the cart."""
        swung = self._chain.coupled(self._chain.rates)
        return (self._momentum_n_s - swung) / self._chain.total_mass_kg

    @property
    def links(self) -> list[LinkState]:
        """Angles and rates of the links, from the cart down."""
        return self._chain.links

    @property
    def energy_j(self) -> float:
        """Energy of cart and load; 0 for the hanging load at rest."""
        velocity_m_s = self.velocity_m_s
        swung = self._chain.coupled(self._chain.rates)
        moving_j = (0.5 * self._chain.total_mass_kg * velocity_m_s + swung) * velocity_m_s
        return moving_j + self._chain.energy_j

    def advance(self, step_s: float, steps: int, force_n: float = 0.0) -> None:
        """Integrate steps of step_s under a constant force along x. Raises LoadEvent."""
        self._chain.under_force(force_n)
        self._chain.advance_at_rest(step_s, steps)
        time_s = steps * step_s
        self._moment_kg_m += time_s * (self._momentum_n_s + 0.5 * time_s * force_n)
        self._momentum_n_s += time_s * force_n


class _ChainUnderCart(SpatialChain):
    """Chain whose pivot is a cart under a constant force."""

    def __init__(self, cart_mass_kg: float, links: Sequence[LinkParams], load: LoadParams) -> None:
        self._force_n = 0.0
        self.total_mass_kg = cart_mass_kg + sum(link.mass_kg for link in links) + load.tip_mass_kg
        super().__init__(links, load)
        self._resolve_modes()

    @property
    def rates(self) -> Vectors:
        """Derivatives of the unit vectors of the links [1/s]."""
        return list(self._w)

    def coupled(self, vectors: Vectors) -> float:
        """Compute sum_i c_i v_i of the x-components of one vector a link."""
        return sum(c * vector[0] for c, vector in zip(self._coupling, vectors, strict=True))

    def under_force(self, force_n: float) -> None:
        """Set the force on the cart along x."""
        self._force_n = force_n

    def _accelerations(self, u: Vectors, w: Vectors, pivot: Vector) -> tuple[Vectors, list[float]]:
        """Compute u'' and the tensions of the links; the pivot is the cart, not the argument."""
        held, held_n = super()._accelerations(u, w, AT_REST)
        per_m_s2, per_m_s2_kg = self._driven_accelerations(u)
        mass_kg = self.total_mass_kg + self.coupled(per_m_s2)  # that the force accelerates
        cart_m_s2 = (self._force_n - self.coupled(held)) / mass_kg
        tensions = [a + cart_m_s2 * b for a, b in zip(held_n, per_m_s2_kg, strict=True)]
        return moved(held, per_m_s2, cart_m_s2), tensions

    def _driven_accelerations(self, u: Vectors) -> tuple[Vectors, list[float]]:
        """Compute the parts of u'' and of the tensions that are linear in x'', for x'' = 1 m/s^2.

        sum_j M_ij u_j'' = lambda_i u_i - c_i e_x,    u_i.u_i'' = 0
        """
        n = self._n
        push: Vectors = [(-c, 0.0, 0.0) for c in self._coupling]
        free = product(self._inverse, push)
        rows = []
        for i in range(n):
            row = [self._inverse[i][j] * dot(u[i], u[j]) for j in range(n)]
            rows.append([*row, -dot(u[i], free[i])])
        factors = solve(rows)
        along = [scaled(one, factor) for one, factor in zip(u, factors, strict=True)]
        tensions = [-f / link.length_m for f, link in zip(factors, self._links, strict=True)]
        return added(free, product(self._inverse, along)), tensions

    def _resolve_modes(self) -> None:
        """Set the step for the fastest mode, which a light cart raises."""
        matrices = self._matrices
        c = matrices.coupling
        free = matrices.mass - np.outer(c, c) / self.total_mass_kg
        # no eigenvalue grows by more than the kinetic energy under a held over a free cart
        ratio = float(np.abs(np.linalg.eigvals(np.linalg.solve(free, matrices.mass))).max())
        fastest_rad_s = ratio * matrices.fastest_rad_s
        self._substep_s = STEP_RAD / fastest_rad_s
        if self._substep_s * MAX_SUBSTEPS < 1e-3:
            raise ValueError(
                f"load and cart have a mode of up to {fastest_rad_s:.3g} rad/s; must be <= "
                f"{STEP_RAD * MAX_SUBSTEPS * 1e3:.3g} rad/s, which the step of the simulation "
                "resolves: lower joint_stiffness_n_m_rad, or take a heavier cart"
            )
