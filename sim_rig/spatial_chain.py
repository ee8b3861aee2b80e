"""Load in space: a chain of links under a moving pivot.

Each link is a unit vector u_i from its upper to its lower end, so no direction is singular. With
the place of mass k r_k = p + sum_j a_kj u_j, the kinetic energy is
1/2 sum_ij M_ij u_i'.u_j' + p'.sum_i c_i u_i' + 1/2 m p'^2 and M and c are constant:

    sum_j M_ij u_j'' = lambda_i u_i + F_i - c_i (p'' + g z),    u_i.u_i'' = -|u_i'|^2

(Lagrange, first kind). lambda_i follows from n linear equations; the tension of a cable link is
-lambda_i / l_i. A thin bar has no inertia about its own axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sim_rig.chain_joints import ChainJoints
from sim_rig.chain_matrices import ChainMatrices
from sim_rig.link_angles import LinkState, direction, rate, state
from sim_rig.load_params import LinkParams, LoadParams, Push
from sim_rig.pivot import AT_REST, PivotStep, pivot_steps
from sim_rig.vectors import (
    Vector,
    Vectors,
    added,
    dot,
    moved,
    plus,
    product,
    runge_kutta_sum,
    scaled,
    solve,
)

# longest step over the fastest mode [rad]: one link keeps its energy to 1e-12 in 24 s, others 1e-7
STEP_OF_ONE_LINK_RAD, STEP_RAD = 0.0035, 0.025
MAX_SUBSTEPS = 40  # of a millisecond
PUSH_ROUNDING_S = 1e-9


def slack_text(number: int, t_s: float, tension_n: float) -> str:
    """Say that a cable went slack."""
    return (
        f"cable {number} of the load went slack at {t_s:.3f} s of the bench (tension "
        f"{tension_n:.3g} N; must be >= 0): let motion, pushes and changes of length be slower"
    )


class LoadEvent(ValueError):
    """Event that ends the simulation: a cable went slack."""


class SpatialChain:
    """Chain of any number of links; Runge-Kutta 4 in steps of a part of a millisecond.

    Error: energy of an undamped load drifts by less than 1e-12 of its swing in 24 s with one link,
    1e-7 with several. Raises ValueError for a load too stiff for MAX_SUBSTEPS, and for a push at a
    link that the load does not have.
    """

    def __init__(
        self, links: Sequence[LinkParams], load: LoadParams, pushes: Sequence[Push] = ()
    ) -> None:
        self._matrices = matrices = ChainMatrices(links, load)
        self._links = tuple(links)
        self._n = len(links)
        self._inverse: list[list[float]] = matrices.inverse.tolist()
        self._damping: list[list[float]] = matrices.damping.tolist()
        self._coupling: list[float] = matrices.coupling.tolist()
        # share of a generalised force on each link in the sum of the forces on the masses [1/m]
        self._shares: list[float] = np.linalg.solve(matrices.arms, np.ones(len(links))).tolist()
        self._has_damping = bool(matrices.damping.any())
        self._has_drag = any(link.drag_n_s2_m2 for link in links)
        self._joints = ChainJoints(links, load.pivot_friction_n_m)
        self._weakest_n = min(link.breaking_n for link in links)
        self._has_joints = self._joints.has_any
        self._gravity_m_s2 = load.gravity_m_s2
        self._has_friction = load.pivot_friction_n_m > 0.0
        self._pushes = tuple(pushes)
        for push in pushes:
            if push.link > self._n:
                raise ValueError(
                    f"link = {push.link} in [[bench.pushes]]; must be <= {self._n}, the number of "
                    "links: name a link of the load"
                )
        longest = STEP_OF_ONE_LINK_RAD if self._n == 1 else STEP_RAD
        self._substep_s = longest / matrices.fastest_rad_s
        if self._substep_s * MAX_SUBSTEPS < 1e-3:
            raise ValueError(
                f"the load has a mode of {matrices.fastest_rad_s:.3g} rad/s; must be <= "
                f"{longest * MAX_SUBSTEPS * 1e3:.3g} rad/s, which the step of the simulation "
                "resolves: lower joint_stiffness_n_m_rad or joint_damping_n_m_s_rad"
            )
        self.run_start_s = 0.0  # start of the run, from which pushes count
        self._t_s = 0.0
        self._u = [direction(link.initial_x_rad, link.initial_y_rad) for link in links]
        self._w = [rate(u, link) for u, link in zip(self._u, links, strict=True)]
        self._speed: Vector = (0.0, 0.0, 0.0)  # of the pivot, for the drag of the air
        self._tensions_n = self._accelerations(self._u, self._w, (0.0, 0.0, 0.0))[1]
        self._check_hanging(load.tip_mass_kg)

    @property
    def links(self) -> list[LinkState]:
        """Angles and rates of the links, from the pivot down."""
        return [state(u, w) for u, w in zip(self._u, self._w, strict=True)]

    @property
    def directions(self) -> Vectors:
        """Unit vectors of the links, from the pivot down."""
        return list(self._u)

    @property
    def tensions_n(self) -> list[float]:
        """Tension of each link at the end of the last step; of a bar without meaning."""
        return list(self._tensions_n)

    @property
    def energy_j(self) -> float:
        """Energy of swing under a pivot that stands, 0 for the hanging load at rest."""
        matrices = self._matrices
        w, u = np.array(self._w), np.array(self._u)
        kinetic = 0.5 * float(np.sum(matrices.mass * (w @ w.T)))
        # 1 + u_z from the horizontal part: no cancellation near rest
        flat = u[:, 0] ** 2 + u[:, 1] ** 2
        rise = np.where(u[:, 2] < 0.0, flat / (1.0 - u[:, 2]), 1.0 + u[:, 2])
        potential = self._gravity_m_s2 * float(matrices.coupling @ rise)
        return kinetic + potential + self._joints.energy_j(self._u)

    def set_state(self, directions: Sequence[Vector], rates: Sequence[Vector]) -> None:
        """Set the unit vectors of the links and their derivatives [1/s]."""
        self._u, self._w = list(directions), list(rates)
        self._normalise()

    def force_n(self, acceleration_m_s2: Vector) -> Vector:
        """Compute the force of the load on a pivot that accelerates so [N]."""
        accelerations, _ = self._accelerations(self._u, self._w, acceleration_m_s2)
        ax, ay, az = acceleration_m_s2
        mass_kg = self._matrices.load_mass_kg
        force = [-mass_kg * ax, -mass_kg * ay, -mass_kg * (az + self._gravity_m_s2)]
        for c, acceleration in zip(self._coupling, accelerations, strict=True):
            for axis in range(3):
                force[axis] -= c * acceleration[axis]
        outside = [push.force_n for push in self._acting()]
        air = added(self._viscous(self._w), self._drag(self._w))
        outside += [scaled(one, share) for one, share in zip(air, self._shares, strict=True)]
        for one in outside:
            for axis in range(3):
                force[axis] += one[axis]
        return force[0], force[1], force[2]

    def advance(
        self, step_s: float, vx_m_s: list[float], vy_m_s: list[float], vz_m_s: list[float]
    ) -> None:
        """Integrate (N - 1) / 2 steps of step_s with a moving pivot.

        vx, vy, vz: (N,) velocities of the pivot at the start, the middle and the end of each step;
        its acceleration is the derivative of the parabola through them. Raises LoadEvent.
        """
        for step in pivot_steps(step_s, (vx_m_s, vy_m_s, vz_m_s)):
            self._speed = step.middle_m_s
            self._step(step_s, step)
        self._speed = (vx_m_s[-1], vy_m_s[-1], vz_m_s[-1])

    def advance_at_rest(self, step_s: float, steps: int) -> None:
        """Integrate steps of step_s with the pivot at rest. Raises LoadEvent."""
        self._speed = (0.0, 0.0, 0.0)
        for _ in range(steps):
            self._step(step_s, AT_REST)

    def _step(self, step_s: float, pivot: PivotStep) -> None:
        """Integrate a step."""
        count = max(1, math.ceil(step_s / self._substep_s))
        for k in range(count):
            stages = [pivot.at(share) for share in (k / count, (k + 0.5) / count, (k + 1) / count)]
            self._runge_kutta(step_s / count, *stages)
        self._t_s += step_s
        if min(self._tensions_n) < 0.0 or max(self._tensions_n) > self._weakest_n:
            self._check_tension()

    def _runge_kutta(self, h: float, first: Vector, middle: Vector, last: Vector) -> None:
        u, w = self._u, self._w
        half = 0.5 * h
        f1, self._tensions_n = self._accelerations(u, w, first)
        w2 = moved(w, f1, half)
        f2, _ = self._accelerations(moved(u, w, half), w2, middle)
        w3 = moved(w, f2, half)
        f3, _ = self._accelerations(moved(u, w2, half), w3, middle)
        w4 = moved(w, f3, h)
        f4, _ = self._accelerations(moved(u, w3, h), w4, last)
        self._u = runge_kutta_sum(u, h / 6.0, w, w2, w3, w4)
        self._w = runge_kutta_sum(w, h / 6.0, f1, f2, f3, f4)
        self._normalise()

    def _accelerations(self, u: Vectors, w: Vectors, pivot: Vector) -> tuple[Vectors, list[float]]:
        """Compute u'' and the tensions of the links."""
        n, inverse = self._n, self._inverse
        ax, ay, az = pivot
        az += self._gravity_m_s2
        forces = [(-c * ax, -c * ay, -c * az) for c in self._coupling]
        if self._has_damping:
            forces = added(forces, self._viscous(w))
        if self._has_joints:
            forces = added(forces, self._joints.forces(u, w))
        if self._has_drag:
            forces = added(forces, self._drag(w))
        if self._has_friction:
            forces[0] = plus(forces[0], self._joints.friction(w[0]))
        for push in self._acting():
            for j in range(push.link):
                lever_m = self._links[j].length_m
                fx, fy, fz = push.force_n
                forces[j] = plus(forces[j], (lever_m * fx, lever_m * fy, lever_m * fz))
        if n == 1:
            ((ux, uy, uz),), ((wx, wy, wz),), ((fx, fy, fz),) = u, w, forces
            per_mass = inverse[0][0]
            size = ux * ux + uy * uy + uz * uz
            push_along = ux * fx + uy * fy + uz * fz
            factor = -((wx * wx + wy * wy + wz * wz) / per_mass + push_along) / size
            acceleration = (
                per_mass * (fx + factor * ux),
                per_mass * (fy + factor * uy),
                per_mass * (fz + factor * uz),
            )
            return [acceleration], [-factor / self._links[0].length_m]
        free = product(inverse, forces)
        rows = [
            [inverse[i][j] * dot(u[i], u[j]) for j in range(n)]
            + [-dot(w[i], w[i]) - dot(u[i], free[i])]
            for i in range(n)
        ]
        factors = solve(rows)
        along = [(f * x, f * y, f * z) for f, (x, y, z) in zip(factors, u, strict=True)]
        accelerations = added(free, product(inverse, along))
        tensions = [-f / link.length_m for f, link in zip(factors, self._links, strict=True)]
        return accelerations, tensions

    def _viscous(self, w: Vectors) -> Vectors:
        return [(-x, -y, -z) for x, y, z in product(self._damping, w)]

    def _drag(self, w: Vectors) -> Vectors:
        """Compute the drag of the air on the masses, -b |v| v at the speed v of each."""
        arms = self._matrices.arms
        forces: Vectors = [(0.0, 0.0, 0.0)] * self._n
        for k, link in enumerate(self._links):
            velocity = self._speed
            for j in range(k + 1):
                velocity = plus(velocity, scaled(w[j], float(arms[k, j])))
            drag = scaled(velocity, -link.drag_n_s2_m2 * math.hypot(*velocity))
            for j in range(k + 1):
                forces[j] = plus(forces[j], scaled(drag, float(arms[k, j])))
        return forces

    def _acting(self) -> list[Push]:
        if not self._pushes:
            return []
        t_s = self._t_s - self.run_start_s + PUSH_ROUNDING_S
        return [push for push in self._pushes if push.at_s <= t_s < push.at_s + push.duration_s]

    def _check_hanging(self, tip_mass_kg: float) -> None:
        """Raise ValueError for a cable that tears under the load that hangs at rest."""
        below_kg = tip_mass_kg
        for number in range(self._n, 0, -1):
            link = self._links[number - 1]
            below_kg += link.mass_kg
            weight_n = below_kg * self._gravity_m_s2
            if weight_n > link.breaking_n:
                raise ValueError(
                    f"breaking_n = {link.breaking_n:g} of link {number} in [[bench.links]]; must "
                    f"be > {weight_n:.3g} N, what hangs on it at rest: take a stronger cable"
                )

    def _check_tension(self) -> None:
        for i, (tension_n, link) in enumerate(zip(self._tensions_n, self._links, strict=True)):
            if link.kind != "point":
                continue
            if tension_n > link.breaking_n:
                raise LoadEvent(
                    f"cable {i + 1} of the load tore at {self._t_s:.3f} s of the bench (tension "
                    f"{tension_n:.3g} N; must be <= breaking_n = {link.breaking_n:g} N): let "
                    "motion and pushes be slower, or take a stronger cable"
                )
            if tension_n < 0.0:
                raise LoadEvent(slack_text(i + 1, self._t_s, tension_n))

    def _normalise(self) -> None:
        """Remove the rounding: unit vectors, and rates across them."""
        for i in range(self._n):
            size = math.hypot(*self._u[i])
            ux, uy, uz = self._u[i] = scaled(self._u[i], 1.0 / size)
            wx, wy, wz = self._w[i]
            along = ux * wx + uy * wy + uz * wz
            self._w[i] = wx - along * ux, wy - along * uy, wz - along * uz
