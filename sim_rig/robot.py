"""The platform: three Cartesian axes, each a second-order position loop integrated in closed form."""

from __future__ import annotations

import math
from typing import NamedTuple

from comms.messages import Position, Velocity
from sim_rig import params

REST_M = 1e-15  # closer to its setpoint and slower than REST_M_S an axis stands still
REST_M_S = 1e-13


class Propagator(NamedTuple):
    """exp(A t) for the state (position - setpoint, velocity): entry `ev` is what velocity adds to the error."""

    ee: float
    ev: float
    ve: float
    vv: float


class Substep(NamedTuple):
    """One integration step and its first half, for the pendulum needs the velocity there too."""

    whole: Propagator
    half: Propagator


class ServoLoop:
    """x'' = wn^2 (setpoint - x) - 2 zeta wn x', with wn such that |x/setpoint| falls to -3 dB at bandwidth_hz."""

    def __init__(self, robot: params.RobotParams) -> None:
        zeta = robot.damping
        spread = 1.0 - 2.0 * zeta * zeta
        self.natural_rad_s = (
            2.0 * math.pi * robot.bandwidth_hz / math.sqrt(spread + math.hypot(spread, 1.0))
        )  # |H|^2 = 1/2
        self._decay_rad_s = zeta * self.natural_rad_s
        self._wave_rad_s = self.natural_rad_s * math.sqrt(abs(1.0 - zeta * zeta))
        self._zeta = zeta

    def propagator(self, t_s: float) -> Propagator:
        """exp(A t) = e^(-mu t) (C I + S (A + mu I)), mu = zeta wn; C = cos(w t), S = sin(w t) / w, w = wn sqrt(1 - zeta^2).

        Beyond critical damping cosh and sinh take the place of cos and sin; at it C = 1, S = t.
        """
        mu, w = self._decay_rad_s, self._wave_rad_s
        if self._zeta < 1.0:
            c, s = math.cos(w * t_s), math.sin(w * t_s) / w
        elif self._zeta > 1.0:
            c, s = math.cosh(w * t_s), math.sinh(w * t_s) / w
        else:
            c, s = 1.0, t_s
        fade = math.exp(-mu * t_s)
        c, s = fade * c, fade * s
        return Propagator(c + mu * s, s, -self.natural_rad_s * self.natural_rad_s * s, c - mu * s)

    def substep(self, step_s: float) -> Substep:
        """Both propagators of a step; the whole one is the half one applied twice."""
        half = ee, ev, ve, vv = self.propagator(0.5 * step_s)
        return Substep(
            Propagator(ee * ee + ev * ve, ev * (ee + vv), ve * (ee + vv), ve * ev + vv * vv), half
        )


class AxisState:
    """Position and velocity of one axis on its way to a setpoint."""

    __slots__ = ("_error_m", "_setpoint_m", "velocity_m_s")

    def __init__(self, position_m: float) -> None:
        self._error_m, self._setpoint_m, self.velocity_m_s = 0.0, position_m, 0.0

    @property
    def position_m(self) -> float:
        """Where the axis is now."""
        return self._setpoint_m + self._error_m

    def aim(self, setpoint_m: float) -> None:
        """A new setpoint, as a step at the present instant."""
        self._error_m += self._setpoint_m - setpoint_m
        self._setpoint_m = setpoint_m

    @property
    def still(self) -> bool:
        """At rest at the setpoint."""
        return abs(self._error_m) < REST_M and abs(self.velocity_m_s) < REST_M_S

    def advance(self, substep: Substep, steps: int) -> list[float]:
        """Velocities [m/s] at the beginning, then at the middle and the end of each step: (2 steps + 1,)."""
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
    """The three axes together: x right, y depth, z up."""

    def __init__(self, robot: params.RobotParams, home_m: Position) -> None:
        self.loop = ServoLoop(robot)
        self.x, self.y, self.z = (AxisState(home) for home in home_m)

    @property
    def position_m(self) -> Position:
        """(x, y, z)."""
        return self.x.position_m, self.y.position_m, self.z.position_m

    @property
    def velocity_m_s(self) -> Velocity:
        """(x, y, z)."""
        return self.x.velocity_m_s, self.y.velocity_m_s, self.z.velocity_m_s

    @property
    def still(self) -> bool:
        """At rest at its setpoints."""
        return self.x.still and self.z.still and self.y.still

    def aim(self, setpoint_m: Position) -> None:
        """New setpoints for all axes, as steps at the present instant."""
        self.x.aim(setpoint_m[0])
        self.y.aim(setpoint_m[1])
        self.z.aim(setpoint_m[2])
