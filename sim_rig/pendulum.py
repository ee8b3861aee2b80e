"""Load: damped nonlinear pendulum in the X-Z plane with a moving pivot."""

from __future__ import annotations

import math

from sim_rig import params
from sim_rig.vectors import Vector


class Pendulum:
    """Pendulum; angle 0 = hanging, positive = load ahead in +X.

    Equation of motion (Lagrange): l theta'' = -g sin - ax cos - az sin - 2 zeta w l theta'. With
    q = l theta' + vx cos + vz sin, the speed of the load normal to the cable, the input is the
    velocity (vx, vz) of the pivot:

        theta' = (q - vx cos - vz sin) / l
        q' = theta' (vz cos - vx sin - 2 zeta w l) - g sin

    A new setpoint is a step of the acceleration but not of the velocity, so RK4 keeps its order.
    """

    __slots__ = ("_drag_m_s", "_gravity_m_s2", "_length_m", "angle_rad", "angular_velocity_rad_s")

    def __init__(self, pendulum: params.PendulumParams) -> None:
        self.angle_rad = pendulum.initial_swing_rad
        self.angular_velocity_rad_s = 0.0
        self._length_m = pendulum.length_m
        self._gravity_m_s2 = pendulum.gravity_m_s2
        # 2 zeta w l
        self._drag_m_s = (
            2.0 * pendulum.damping_ratio * math.sqrt(pendulum.gravity_m_s2 * pendulum.length_m)
        )

    def force_n(self, mass_kg: float, acceleration_m_s2: Vector) -> Vector:
        """Compute the force of the load on its pivot [N]: the tension along the cable.

        m ((g + az) cos + l theta'^2 - ax sin) for a pivot that accelerates so; across the plane the
        load stays behind.
        """
        ax, _, az = acceleration_m_s2
        tension_n = mass_kg * self.tension_m_s2(ax, az)
        return tension_n * math.sin(self.angle_rad), 0.0, -tension_n * math.cos(self.angle_rad)

    def tension_m_s2(self, ax_m_s2: float, az_m_s2: float) -> float:
        """Compute the tension over the mass, of a pivot that accelerates so."""
        s, c = math.sin(self.angle_rad), math.cos(self.angle_rad)
        central_m_s2 = self._length_m * self.angular_velocity_rad_s**2
        return (self._gravity_m_s2 + az_m_s2) * c + central_m_s2 - ax_m_s2 * s

    def advance(self, step_s: float, vx_m_s: list[float], vz_m_s: list[float]) -> None:
        """Integrate (N - 1) / 2 steps of step_s with a moving pivot (Runge-Kutta 4).

        vx_m_s, vz_m_s: (N,) pivot velocities at the start, the middle and the end of each step.
        Plain floats and stages written out, as it runs a thousand times a simulated second.
        """
        sin = math.sin
        cos = math.cos
        g = self._gravity_m_s2
        drag = self._drag_m_s
        per_length = 1.0 / self._length_m
        half, sixth = 0.5 * step_s, step_s / 6.0
        each_vx, each_vz = iter(vx_m_s), iter(vz_m_s)
        theta, vx, vz = self.angle_rad, next(each_vx), next(each_vz)
        s, c = sin(theta), cos(theta)
        q = self.angular_velocity_rad_s * self._length_m + vx * c + vz * s
        w1 = (q - vx * c - vz * s) * per_length
        f1 = w1 * (vz * c - vx * s - drag) - g * s
        for vx, vz, vx_end, vz_end in zip(each_vx, each_vz, each_vx, each_vz, strict=False):
            angle = theta + half * w1
            s, c = sin(angle), cos(angle)
            w2 = (q + half * f1 - vx * c - vz * s) * per_length
            f2 = w2 * (vz * c - vx * s - drag) - g * s
            angle = theta + half * w2
            s, c = sin(angle), cos(angle)
            w3 = (q + half * f2 - vx * c - vz * s) * per_length
            f3 = w3 * (vz * c - vx * s - drag) - g * s
            angle = theta + step_s * w3
            s, c = sin(angle), cos(angle)
            w4 = (q + step_s * f3 - vx_end * c - vz_end * s) * per_length
            f4 = w4 * (vz_end * c - vx_end * s - drag) - g * s
            theta += sixth * (w1 + 2.0 * (w2 + w3) + w4)
            q += sixth * (f1 + 2.0 * (f2 + f3) + f4)
            s, c = sin(theta), cos(theta)
            w1 = (q - vx_end * c - vz_end * s) * per_length
            f1 = w1 * (vz_end * c - vx_end * s - drag) - g * s
        self.angle_rad, self.angular_velocity_rad_s = theta, w1

    def advance_at_rest(self, step_s: float, steps: int) -> None:
        """Integrate steps of step_s with the pivot at rest, in half the computing time.

        The pivot is at rest for most of an experiment.
        """
        sin = math.sin
        stiffness = self._gravity_m_s2 / self._length_m
        drag = self._drag_m_s / self._length_m
        half, sixth = 0.5 * step_s, step_s / 6.0
        theta, w1 = self.angle_rad, self.angular_velocity_rad_s
        for _ in range(steps):
            f1 = -stiffness * sin(theta) - drag * w1
            w2 = w1 + half * f1
            f2 = -stiffness * sin(theta + half * w1) - drag * w2
            w3 = w1 + half * f2
            f3 = -stiffness * sin(theta + half * w2) - drag * w3
            w4 = w1 + step_s * f3
            f4 = -stiffness * sin(theta + step_s * w3) - drag * w4
            theta += sixth * (w1 + 2.0 * (w2 + w3) + w4)
            w1 += sixth * (f1 + 2.0 * (f2 + f3) + f4)
        self.angle_rad, self.angular_velocity_rad_s = theta, w1
