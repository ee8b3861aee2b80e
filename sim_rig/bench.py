"""Bench: simulation of platform and load to exact times, without sockets, clock or randomness."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from comms.messages import Position, Velocity
from sim_rig.link_angles import LinkState
from sim_rig.load import Load
from sim_rig.params import BenchParams
from sim_rig.robot import Platform, Velocities
from sim_rig.run_time_load import LoadInRunTime
from sim_rig.vectors import Vector

# Runge-Kutta at 1 ms: error 4e-8 rad after 24 s of setpoint steps, energy drift 3e-13
STEP_NS = 1_000_000
MAX_BATCH_STEPS = 1000  # steps whose velocities are in memory at the same time


# force of the load [N] on a platform of that acceleration [m/s^2], each along x, y, z
ForceInSpace = Callable[[Vector], Vector]


class SimulatedPlant(Protocol):
    """Plant of a run at time `t_ns`: what moves, and what it carries."""

    t_ns: int

    @property
    def position_m(self) -> Position:
        """Position of the platform."""

    @property
    def velocity_m_s(self) -> Velocity:
        """Velocity of the platform."""

    @property
    def angle_rad(self) -> float:
        """Angle of the load."""

    @property
    def angular_velocity_rad_s(self) -> float:
        """Angular velocity of the load."""

    @property
    def cable_points_m(self) -> list[Vector]:
        """Points of a cable that vibrates, from the platform down; [] of a straight one."""

    @property
    def link_lengths_m(self) -> list[float]:
        """Present lengths of the links."""

    @property
    def links(self) -> list[LinkState]:
        """Angles and rates of the links of the load."""

    def await_run(self) -> None:
        """Let the events of the load wait for the start of the run."""

    def start_run(self, t_ns: int) -> None:
        """Set the start of the run, from which the events of the load count."""

    def set_setpoint(self, position_m: Position) -> None:
        """Set the setpoint of the drives, where they take one of position."""

    def advance(self, t_ns: int) -> None:
        """Integrate to exactly t_ns; raises ValueError if it is in the past."""


class MovingPlatform(Protocol):
    """Platform that carries the load."""

    @property
    def position_m(self) -> Position:
        """Actual position (x, y, z)."""

    @property
    def velocity_m_s(self) -> Velocity:
        """Actual velocity (x, y, z)."""

    @property
    def still(self) -> bool:
        """True if the platform is at rest and stays there until it is told to move."""

    def set_setpoint(self, setpoint_m: Position) -> None:
        """Set the setpoint of the drives, as a step at the present time."""

    def carry(self, force_n: ForceInSpace) -> None:
        """Take the load, whose force depends on the acceleration of the platform."""

    def advance(self, t_ns: int, step_ns: int, steps: int) -> Velocities:
        """Integrate steps from t_ns; return the velocities along x, y, z [m/s], (2 steps + 1,).

        The first is at the start, then one at the middle and one at the end of each step.
        """


class Bench:
    """Simulated plant at time `t_ns`; equal calls give equal floats."""

    def __init__(
        self, params: BenchParams, t_ns: int = 0, platform: MovingPlatform | None = None
    ) -> None:
        """platform: in place of the Cartesian one; it starts at t_ns."""
        self.t_ns = t_ns
        self._platform = platform or Platform(params.robot, params.start_m, STEP_NS * 1e-9)
        self._load = LoadInRunTime(params) if params.clock_ppm else Load(params)
        self._platform.carry(self._load.force_n)

    @property
    def position_m(self) -> Position:
        """Position of the platform."""
        return self._platform.position_m

    @property
    def velocity_m_s(self) -> Velocity:
        """Velocity of the platform."""
        return self._platform.velocity_m_s

    @property
    def angle_rad(self) -> float:
        """Cable angle: 0 = hanging, positive = load ahead in +X."""
        return self._load.angle_rad

    @property
    def angular_velocity_rad_s(self) -> float:
        """Angular velocity of the cable."""
        return self._load.angular_velocity_rad_s

    @property
    def cable_points_m(self) -> list[Vector]:
        """Points of a cable that vibrates, from the platform down; [] of a straight one."""
        return self._load.points_m

    @property
    def link_lengths_m(self) -> list[float]:
        """Present lengths of the links, from the platform down."""
        return self._load.lengths_m

    @property
    def links(self) -> list[LinkState]:
        """Angles and rates of the links of the load, from the platform down."""
        return self._load.links

    def await_run(self) -> None:
        """Let the events of the load wait for the start of the run."""
        self._load.await_run()

    def start_run(self, t_ns: int) -> None:
        """Set the start of the run, from which the events of the load count."""
        self._load.start_run((t_ns - self.t_ns) * 1e-9)

    def set_setpoint(self, position_m: Position) -> None:
        """Set the setpoint of the drives, as a step at the present time."""
        self._platform.set_setpoint(position_m)

    def advance(self, t_ns: int) -> None:
        """Integrate to exactly t_ns, in steps that end on whole milliseconds.

        Raises ValueError if t_ns is in the past, and LoadEvent.
        """
        if t_ns < self.t_ns:
            raise ValueError(
                f"t_ns = {t_ns}; must be >= {self.t_ns}, the time of the bench: "
                "advance in the order of time"
            )
        while (left_ns := t_ns - self.t_ns) > 0:
            part_ns = -self.t_ns % STEP_NS or STEP_NS
            if part_ns > left_ns or part_ns < STEP_NS:
                self._integrate(min(part_ns, left_ns), 1)
            else:
                self._integrate(STEP_NS, min(left_ns // STEP_NS, MAX_BATCH_STEPS))

    def _integrate(self, step_ns: int, steps: int) -> None:
        step_s = step_ns * 1e-9
        if self._platform.still:
            self._load.advance_at_rest(step_s, steps)
        else:
            self._load.advance(step_s, *self._platform.advance(self.t_ns, step_ns, steps))
        self.t_ns += steps * step_ns
