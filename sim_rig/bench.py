"""Bench: simulation of platform and load to exact times, without sockets, clock or randomness."""

from __future__ import annotations

from comms.messages import Position, Velocity
from sim_rig.params import BenchParams
from sim_rig.pendulum import Pendulum
from sim_rig.robot import Platform

# Runge-Kutta at 1 ms: error 4e-8 rad after 24 s of setpoint steps, energy drift 3e-13
STEP_NS = 1_000_000
MAX_BATCH_STEPS = 1000  # steps whose velocities are in memory at the same time


class Bench:
    """Simulated plant at time `t_ns`; equal calls give equal floats."""

    def __init__(self, params: BenchParams, t_ns: int = 0) -> None:
        self.t_ns = t_ns
        self._platform = Platform(params.robot, params.start_m)
        self._load = Pendulum(params.pendulum)
        self._step = self._platform.loop.substep(STEP_NS * 1e-9)

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

    def set_setpoint(self, position_m: Position) -> None:
        """Set the setpoint of the drives, as a step at the present time."""
        self._platform.set_setpoint(position_m)

    def advance(self, t_ns: int) -> None:
        """Integrate to exactly t_ns, in steps that end on whole milliseconds.

        Raises ValueError if t_ns is in the past.
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
            platform = self._platform
            substep = self._step if step_ns == STEP_NS else platform.loop.substep(step_s)
            vx_m_s = platform.x.advance(substep, steps)
            vz_m_s = platform.z.advance(substep, steps)
            self._load.advance(step_s, vx_m_s, vz_m_s)
            platform.y.advance(substep, steps)  # depth: normal to the plane of the swing
        self.t_ns += steps * step_ns
