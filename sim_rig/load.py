"""Load of the bench: a planar pendulum where that is enough, else a chain in space."""

from __future__ import annotations

import math

from sim_rig.link_angles import LinkState
from sim_rig.load_params import LinkParams, LoadParams
from sim_rig.params import BenchParams, PendulumParams
from sim_rig.pendulum import Pendulum
from sim_rig.spatial_chain import SpatialChain
from sim_rig.vectors import Vector


class Load:
    """Load under a moving pivot.

    `[bench.pendulum]` swings in the plane X-Z until the pivot first moves along y; from then on,
    and with `[[bench.links]]` or pushes from the start, it is a chain in space.
    """

    def __init__(self, params: BenchParams) -> None:
        self._pendulum = params.pendulum
        self._plane: Pendulum | None = None
        if params.links:
            self._chain = SpatialChain(params.links, params.load, params.pushes)
        elif params.pushes:
            self._chain = SpatialChain(*_as_link(params.pendulum), params.pushes)
        else:
            self._plane = Pendulum(params.pendulum)

    @property
    def links(self) -> list[LinkState]:
        """Angles and rates of the links, from the platform down."""
        plane = self._plane
        if plane is None:
            return self._chain.links
        return [LinkState(plane.angle_rad, 0.0, plane.angular_velocity_rad_s, 0.0)]

    @property
    def angle_rad(self) -> float:
        """Angle of the first link in the plane x."""
        return self.links[0].angle_x_rad if self._plane is None else self._plane.angle_rad

    @property
    def angular_velocity_rad_s(self) -> float:
        """Rate of the first link in the plane x."""
        plane = self._plane
        return self.links[0].rate_x_rad_s if plane is None else plane.angular_velocity_rad_s

    def pull_n(self, acceleration_m_s2: float) -> float:
        """Compute the force along +X on a pivot that accelerates so along +X [N]."""
        if self._plane is None:
            return self._chain.force_n((acceleration_m_s2, 0.0, 0.0))[0]
        return self._plane.pull_n(self._pendulum.mass_kg, acceleration_m_s2)

    def advance(
        self, step_s: float, vx_m_s: list[float], vy_m_s: list[float], vz_m_s: list[float]
    ) -> None:
        """Integrate (N - 1) / 2 steps of step_s; velocities (N,) as SpatialChain.advance.

        Raises LoadEvent.
        """
        if self._plane is not None:
            if not any(vy_m_s):
                self._plane.advance(step_s, vx_m_s, vz_m_s)
                return
            self._chain = _leave_plane(self._plane, self._pendulum)
            self._plane = None
        self._chain.advance(step_s, vx_m_s, vy_m_s, vz_m_s)

    def advance_at_rest(self, step_s: float, steps: int) -> None:
        """Integrate steps of step_s with the pivot at rest. Raises LoadEvent."""
        load = self._chain if self._plane is None else self._plane
        load.advance_at_rest(step_s, steps)


def _as_link(pendulum: PendulumParams) -> tuple[list[LinkParams], LoadParams]:
    link = LinkParams(
        length_m=pendulum.length_m,
        mass_kg=pendulum.mass_kg,
        initial_x_rad=pendulum.initial_swing_rad,
    )
    load = LoadParams(gravity_m_s2=pendulum.gravity_m_s2, damping_ratio=pendulum.damping_ratio)
    return [link], load


def _leave_plane(plane: Pendulum, pendulum: PendulumParams) -> SpatialChain:
    """Continue a planar swing in space."""
    chain = SpatialChain(*_as_link(pendulum))
    s, c = math.sin(plane.angle_rad), math.cos(plane.angle_rad)
    rate = plane.angular_velocity_rad_s
    direction: Vector = (s, 0.0, -c)
    chain.set_state([direction], [(rate * c, 0.0, rate * s)])
    return chain
