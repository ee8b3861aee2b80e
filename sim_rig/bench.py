"""The bench: platform and load, stepped to exact instants. No sockets, no clock, no randomness."""

from __future__ import annotations

from comms.messages import Position, Velocity
from sim_rig.params import BenchParams
from sim_rig.pendulum import Pendulum
from sim_rig.robot import Platform

STEP_NS = (
    1_000_000  # Runge-Kutta at 1 ms: 4e-8 rad after 24 s of jerky setpoints, energy drift 3e-13
)
STRETCH_STEPS = 1000  # most steps whose velocities are held in memory at once


class Bench:
    """The simulated world at `t_ns`; equal calls give equal floats."""

    def __init__(self, params: BenchParams, t_ns: int = 0) -> None:
        self.t_ns = t_ns
        self._platform = Platform(params.robot, params.start_m)
        self._load = Pendulum(params.pendulum)
        self._step = self._platform.loop.substep(STEP_NS * 1e-9)

    @property
    def position_m(self) -> Position:
        """Where the platform is."""
        return self._platform.position_m

    @property
    def velocity_m_s(self) -> Velocity:
        """How the platform moves."""
        return self._platform.velocity_m_s

    @property
    def angle_rad(self) -> float:
        """Cable angle: 0 = hanging, positive = load ahead in +X."""
        return self._load.angle_rad

    @property
    def angular_velocity_rad_s(self) -> float:
        """Rate of the cable angle."""
        return self._load.angular_velocity_rad_s

    def setpoint(self, position_m: Position) -> None:
        """The servos aim at position_m from the present instant on."""
        self._platform.aim(position_m)

    def advance(self, t_ns: int) -> None:
        """Let time run to exactly t_ns, in steps that end on whole milliseconds; raises ValueError when t_ns is past."""
        if t_ns < self.t_ns:
            raise ValueError(
                f"t_ns = {t_ns} is before the bench's {self.t_ns}: advance in the order of time"
            )
        while (left_ns := t_ns - self.t_ns) > 0:
            part_ns = -self.t_ns % STEP_NS or STEP_NS
            if part_ns > left_ns or part_ns < STEP_NS:
                self._run(min(part_ns, left_ns), 1)
            else:
                self._run(STEP_NS, min(left_ns // STEP_NS, STRETCH_STEPS))

    def _run(self, step_ns: int, steps: int) -> None:
        step_s = step_ns * 1e-9
        if self._platform.still:
            self._load.hang(step_s, steps)
        else:
            x, y, z = self._platform.x, self._platform.y, self._platform.z
            substep = self._step if step_ns == STEP_NS else self._platform.loop.substep(step_s)
            self._load.carry(step_s, x.advance(substep, steps), z.advance(substep, steps))
            y.advance(substep, steps)  # depth: across the plane of the swing
        self.t_ns += steps * step_ns
