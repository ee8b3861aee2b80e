"""Load of the bench: a planar pendulum where that is enough, else a chain in space."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sim_rig.hoisted_pendulum import HoistedPendulum
from sim_rig.link_angles import LinkState
from sim_rig.load_params import LinkParams, LoadParams
from sim_rig.params import BenchParams, PendulumParams
from sim_rig.pendulum import Pendulum
from sim_rig.spatial_chain import LoadEvent, SpatialChain, slack_text
from sim_rig.spatial_pendulum import SpatialPendulum
from sim_rig.vectors import Vector
from sim_rig.vibrating_pendulum import VibratingPendulum

# speed across the plane that is neglected: a swing of at most 10 urad of a load of 1 m
PLANE_SPEED_M_S = 3e-5


class Load:
    """Load under a moving pivot.

    `[bench.pendulum]` swings in the plane X-Z until the pivot first moves along y; from then on,
    and with `[[bench.links]]` or pushes from the start, it is a chain in space.
    """

    def __init__(self, params: BenchParams) -> None:
        self._pendulum = params.pendulum
        self._plane: Pendulum | None = None
        self._elapsed_s = 0.0
        self._lengths_m = [link.length_m for link in params.links] or [params.pendulum.length_m]
        if params.links:
            self._space = _in_space(params.links, params.load, params)
        elif params.pushes or params.length_changes or params.cable:
            link, load = _as_link(params.pendulum)
            self._space = _in_space([link], load, params)
        else:
            self._plane = Pendulum(params.pendulum)

    @property
    def links(self) -> list[LinkState]:
        """Angles and rates of the links, from the platform down."""
        plane = self._plane
        if plane is None:
            return self._space.links
        return [LinkState(plane.angle_rad, 0.0, plane.angular_velocity_rad_s, 0.0)]

    @property
    def lengths_m(self) -> list[float]:
        """Present lengths of the links."""
        if self._plane is None and isinstance(self._space, HoistedPendulum):
            return [self._space.length_m]
        return self._lengths_m

    @property
    def points_m(self) -> list[Vector]:
        """Points of a cable that vibrates, relative to the platform; [] of a straight one."""
        if self._plane is None and isinstance(self._space, VibratingPendulum):
            return self._space.points_m
        return []

    @property
    def angle_rad(self) -> float:
        """Angle of the first link in the plane x."""
        return self.links[0].angle_x_rad if self._plane is None else self._plane.angle_rad

    @property
    def angular_velocity_rad_s(self) -> float:
        """Rate of the first link in the plane x."""
        plane = self._plane
        return self.links[0].rate_x_rad_s if plane is None else plane.angular_velocity_rad_s

    def await_run(self) -> None:
        """Let pushes and changes of length wait for the start of the run."""
        self._set_run_start(math.inf)

    def start_run(self, in_s: float) -> None:
        """Set the start of the run, so many seconds from now."""
        self._set_run_start(self._elapsed_s + in_s)

    def _set_run_start(self, at_s: float) -> None:
        if self._plane is None:
            self._space.run_start_s = at_s

    def force_n(self, acceleration_m_s2: Vector) -> Vector:
        """Compute the force of the load on a pivot that accelerates so [N]."""
        if self._plane is None:
            return self._space.force_n(acceleration_m_s2)
        return self._plane.force_n(self._pendulum.mass_kg, acceleration_m_s2)

    def advance(
        self, step_s: float, vx_m_s: list[float], vy_m_s: list[float], vz_m_s: list[float]
    ) -> None:
        """Integrate (N - 1) / 2 steps of step_s; velocities (N,) as SpatialChain.advance.

        Raises LoadEvent.
        """
        self._elapsed_s += step_s * (len(vx_m_s) // 2)
        if self._plane is not None:
            if max(map(abs, vy_m_s)) <= PLANE_SPEED_M_S:
                self._plane.advance(step_s, vx_m_s, vz_m_s)
                self._check_height()
                self._check_plane_tension(step_s, vx_m_s, vz_m_s)
                return
            self._space = _leave_plane(self._plane, self._pendulum)
            self._plane = None
        self._space.advance(step_s, vx_m_s, vy_m_s, vz_m_s)
        self._check_height()

    def advance_at_rest(self, step_s: float, steps: int) -> None:
        """Integrate steps of step_s with the pivot at rest. Raises LoadEvent."""
        self._elapsed_s += step_s * steps
        load = self._space if self._plane is None else self._plane
        load.advance_at_rest(step_s, steps)
        self._check_height()

    def _check_plane_tension(self, step_s: float, vx_m_s: list[float], vz_m_s: list[float]) -> None:
        """Raise LoadEvent where the planar cable is slack at the end of the last step."""
        ax, az = ((v[-1] - v[-2]) / (0.5 * step_s) for v in (vx_m_s, vz_m_s))
        if self._plane is not None and self._plane.tension_m_s2(ax, az) < 0.0:
            tension_n = self._pendulum.mass_kg * self._plane.tension_m_s2(ax, az)
            raise LoadEvent(slack_text(1, self._elapsed_s, tension_n))

    def _check_height(self) -> None:
        """Raise LoadEvent where an end of a link is as high as the platform."""
        if self._plane is not None:
            is_below = math.cos(self._plane.angle_rad) > 0.0
            number = 1
        else:
            down_m, number, is_below = 0.0, 0, True
            for number, length_m in enumerate(self._lengths_m, start=1):
                down_m -= length_m * self._space.directions[number - 1][2]
                is_below = down_m > 0.0
                if not is_below:
                    break
        if not is_below:
            raise LoadEvent(
                f"the load swung up to the robot {self._elapsed_s:.3f} s after the start of the "
                f"bench: the lower end of link {number} must stay below the platform: let "
                "motion and pushes be slower"
            )


def _in_space(
    links: Sequence[LinkParams], load: LoadParams, params: BenchParams
) -> SpatialChain | SpatialPendulum:
    """Make a load in space, in its fast form where that is enough.

    Raises ValueError for a change of length, or a vibration, of another load than one plain cable.
    """
    plain = LinkParams(length_m=1.0, mass_kg=1.0)
    keys = (
        "joint_stiffness_n_m_rad",
        "joint_damping_n_m_s_rad",
        "drag_n_s2_m2",
        "breaking_n",
    )
    has_joint = any(getattr(links[0], key) != getattr(plain, key) for key in keys)
    pushes, changes, cable = params.pushes, params.length_changes, params.cable
    is_plain = len(links) == 1 and not (pushes or has_joint or load.pivot_friction_n_m)
    if cable is not None:
        if not is_plain or changes:
            raise ValueError(
                "[bench.cable] of this load; must be one cable without joint, drag, friction, "
                "pushes and changes of length: simplify the load, or leave the vibration out"
            )
        return VibratingPendulum(links[0], load, cable)
    if changes:
        if not is_plain or links[0].kind != "point":
            raise ValueError(
                "[[bench.length_changes]] of this load; must be one cable without joint, drag, "
                "friction and pushes: simplify the load, or leave the changes out"
            )
        return HoistedPendulum(links[0], load, changes)
    if not is_plain:
        return SpatialChain(links, load, pushes)
    return SpatialPendulum(links[0], load)


def _as_link(pendulum: PendulumParams) -> tuple[LinkParams, LoadParams]:
    link = LinkParams(
        length_m=pendulum.length_m,
        mass_kg=pendulum.mass_kg,
        initial_x_rad=pendulum.initial_swing_rad,
    )
    load = LoadParams(gravity_m_s2=pendulum.gravity_m_s2, damping_ratio=pendulum.damping_ratio)
    return link, load


def _leave_plane(plane: Pendulum, pendulum: PendulumParams) -> SpatialPendulum:
    """Continue a planar swing in space."""
    space = SpatialPendulum(*_as_link(pendulum))
    s, c = math.sin(plane.angle_rad), math.cos(plane.angle_rad)
    rate = plane.angular_velocity_rad_s
    space.set_state((s, 0.0, -c), (rate * c, 0.0, rate * s))
    return space
