"""Platform: three Cartesian axes, each a second-order position loop in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from comms.messages import Position, Velocity
from sim_rig import params
from sim_rig.vectors import Vector

# an axis closer to its setpoint and slower than this is at rest
REST_M = 1e-15
REST_M_S = 1e-13


Velocities = tuple[list[float], list[float], list[float]]  # along x, y, z


class Propagator(NamedTuple):
    """Matrix exp(A t) for the state (error = position - setpoint, velocity)."""

    ee: float
    ev: float  # error after t per initial velocity
    ve: float
    vv: float


class Substep(NamedTuple):
    """Propagators of an integration step and its first half; the pendulum needs both velocities."""

    whole: Propagator
    half: Propagator


class ServoLoop:
    """Position loop x'' = wn^2 (setpoint - x) - 2 zeta wn x'.

    wn is such that |x / setpoint| falls to -3 dB at bandwidth_hz.
    """

    def __init__(self, robot: params.RobotParams) -> None:
        zeta = robot.damping
        b = 1.0 - 2.0 * zeta * zeta  # from |H|^2 = 1/2
        self.natural_rad_s = 2.0 * math.pi * robot.bandwidth_hz / math.sqrt(b + math.hypot(b, 1.0))
        self._decay_rad_s = zeta * self.natural_rad_s
        self._damped_rad_s = self.natural_rad_s * math.sqrt(abs(1.0 - zeta * zeta))
        self._zeta = zeta

    def propagator(self, t_s: float) -> Propagator:
        """Compute exp(A t) = e^(-mu t) (C I + S (A + mu I)), with mu = zeta wn.

        C = cos(w t), S = sin(w t) / w, w = wn sqrt(1 - zeta^2). Beyond critical damping cosh and
        sinh replace cos and sin; at critical damping C = 1, S = t.
        """
        mu, w = self._decay_rad_s, self._damped_rad_s
        if self._zeta < 1.0:
            c, s = math.cos(w * t_s), math.sin(w * t_s) / w
        elif self._zeta > 1.0:
            c, s = math.cosh(w * t_s), math.sinh(w * t_s) / w
        else:
            c, s = 1.0, t_s
        decay = math.exp(-mu * t_s)
        c, s = decay * c, decay * s
        return Propagator(c + mu * s, s, -self.natural_rad_s * self.natural_rad_s * s, c - mu * s)

    def substep(self, step_s: float) -> Substep:
        """Compute both propagators of a step; the whole one is the square of the half one."""
        half = self.propagator(0.5 * step_s)
        ee, ev, ve, vv = half
        whole = Propagator(ee * ee + ev * ve, ev * (ee + vv), ve * (ee + vv), ve * ev + vv * vv)
        return Substep(whole, half)


class AxisState:
    """Position and velocity of an axis."""

    __slots__ = ("_error_m", "_setpoint_m", "velocity_m_s")

    def __init__(self, position_m: float) -> None:
        self._error_m = 0.0
        self._setpoint_m = position_m
        self.velocity_m_s = 0.0

    @property
    def position_m(self) -> float:
        """Actual position."""
        return self._setpoint_m + self._error_m

    def set_setpoint(self, setpoint_m: float) -> None:
        """Set the setpoint, as a step at the present time."""
        self._error_m += self._setpoint_m - setpoint_m
        self._setpoint_m = setpoint_m

    @property
    def still(self) -> bool:
        """True if the axis is at rest at its setpoint."""
        return abs(self._error_m) < REST_M and abs(self.velocity_m_s) < REST_M_S

    def advance(self, substep: Substep, steps: int) -> list[float]:
        """Integrate steps; return the velocities [m/s], (2 steps + 1,).

        The first is at the start, then one at the middle and one at the end of each step.
        """
        if self.still:
            self._error_m = self.velocity_m_s = 0.0
            return [0.0] * (2 * steps + 1)
        (ee, ev, ve, vv), (_, _, half_ve, half_vv) = substep
        e, v = self._error_m, self.velocity_m_s
        velocities = [v]
        for _ in range(steps):
            velocities.append(half_ve * e + half_vv * v)
            e, v = ee * e + ev * v, ve * e + vv * v
            velocities.append(v)
        self._error_m, self.velocity_m_s = e, v
        return velocities


class Platform:
    """Platform with three axes: x right, y depth, z up."""

    def __init__(self, robot: params.RobotParams, home_m: Position, step_s: float = 1e-3) -> None:
        """step_s: usual step of the integration, computed once."""
        self.loop = ServoLoop(robot)
        self._step_s = step_s
        self._step = self.loop.substep(step_s)
        self.x, self.y, self.z = (AxisState(home) for home in home_m)

    @property
    def position_m(self) -> Position:
        """Actual position (x, y, z)."""
        return self.x.position_m, self.y.position_m, self.z.position_m

    @property
    def velocity_m_s(self) -> Velocity:
        """Actual velocity (x, y, z)."""
        return self.x.velocity_m_s, self.y.velocity_m_s, self.z.velocity_m_s

    @property
    def still(self) -> bool:
        """True if all axes are at rest at their setpoints."""
        return self.x.still and self.z.still and self.y.still

    def advance(self, t_ns: int, step_ns: int, steps: int) -> Velocities:
        """Integrate steps; return the velocities along x, y and z [m/s], each (2 steps + 1,)."""
        step_s = step_ns * 1e-9
        substep = self._step if step_s == self._step_s else self.loop.substep(step_s)
        x, y, z = (axis.advance(substep, steps) for axis in (self.x, self.y, self.z))
        return x, y, z

    def carry(self, force_n: Callable[[Vector], Vector]) -> None:
        """Do nothing: the load does not move these drives."""

    def set_setpoint(self, setpoint_m: Position) -> None:
        """Set the setpoints of all axes, as steps at the present time."""
        self.x.set_setpoint(setpoint_m[0])
        self.y.set_setpoint(setpoint_m[1])
        self.z.set_setpoint(setpoint_m[2])
