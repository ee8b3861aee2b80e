"""Motion of the elastic joint under constant torques: Taylor series of the order it takes, stopped where friction switches.

Referred to the motor, with x = gear_ratio x load angle, twist d = q - x, v = d', J_l = J_load / ratio^2, B_l likewise:

    J_m q'' = torque + A sin(c q + phase) - B_m q' - K d - D v - F      J_l x'' = load / ratio + K d + D v - B_l x'

Linear part: source 001, two-mass model. Coulomb friction is set-valued: F = F_c sign(q') in motion, and whatever balances the
other torques up to F_c at rest (Filippov). Without ripple the energy of the difference of two motions never grows.
"""

from __future__ import annotations

import math
import sys
from operator import mul
from typing import NamedTuple

from sim_rig.crossing import first_below, value
from sim_rig.joint_params import Joint

ORDER = 24  # terms at most; a series that still has not died out is used over a part of its step
NEGLIGIBLE = 1e-17  # of the largest term: two such terms in a row end a series
STEP_ROUNDING_REL = (
    2.0 * sys.float_info.epsilon
)  # what a step may be wrong by, relative to its largest term
GUARD = (
    16.0 * sys.float_info.epsilon
)  # relative to what a guard is made of: closer to its limit it is on it
NONE = [0.0] * ORDER


class Terms(NamedTuple):
    """Taylor terms over a step: each is the sum of its terms[k] f^k after the fraction f of the step; size = largest term."""

    angle_rad: list[float]
    speed_rad_s: list[float]
    twist_rad: list[float]
    twist_speed_rad_s: list[float]
    size_rad_s: float
    valid: float  # up to this fraction what is left out is negligible


class JointMotion:
    """Where the joint is and how fast. A nudged one is pushed, after each step, by as much as that step may be wrong."""

    def __init__(self, joint: Joint, *, nudged: bool = False) -> None:
        self.angle_rad = self.speed_rad_s = self.twist_rad = self.twist_speed_rad_s = (
            0.0  # of the motor, and d, v
        )
        self.direction = 0  # of sliding: -1, 1; 0 = stuck, where there is friction
        self._joint, self._load_inertia = joint, joint.reflected_inertia_kg_m2
        self._load_friction = joint.load_friction_n_m_s_rad / joint.gear_ratio**2
        self._longest_s = 1.0 / joint.fastest_rad_s
        self._nudged = nudged

    @property
    def stuck(self) -> bool:
        """Whether dry friction holds the motor."""
        return self.direction == 0 and self._joint.coulomb_torque_n_m > 0.0

    @property
    def load_speed_rad_s(self) -> float:
        """x', of the load but referred to the motor."""
        return self.speed_rad_s - self.twist_speed_rad_s

    def load_acceleration_rad_s2(self, load_n_m: float) -> float:
        """x'' under a load torque, both referred to the motor."""
        return (
            load_n_m + self._spring_n_m() - self._load_friction * self.load_speed_rad_s
        ) / self._load_inertia

    def carry(self, motor_n_m: float, load_n_m: float, duration_s: float) -> None:
        """Move on under constant torques, both referred to the motor."""
        left_s = duration_s
        while left_s > 0.0:
            left_s -= self._step(motor_n_m, load_n_m, min(left_s, self._longest_s))

    def _step(self, motor_n_m: float, load_n_m: float, step_s: float) -> float:
        """One series, up to the first switch of the friction if there is one; gives the time gone by."""
        terms = self._series(motor_n_m, load_n_m, step_s)
        switch = self._switch(terms, motor_n_m) if self._joint.coulomb_torque_n_m else None
        part = terms.valid if switch is None else switch
        self.angle_rad += value(terms.angle_rad, part)
        self.speed_rad_s = value(terms.speed_rad_s, part)
        self.twist_rad = value(terms.twist_rad, part)
        self.twist_speed_rad_s = value(terms.twist_speed_rad_s, part)
        if switch is not None:
            self._turn(motor_n_m)
        if self._nudged:
            self._nudge(terms.size_rad_s, switch is not None)
        return part * step_s

    def _series(self, motor_n_m: float, load_n_m: float, step_s: float) -> Terms:
        """Each term from the one before; sine and cosine of the ripple by their own recursion (Jorba & Zou 2005, section 2)."""
        joint, held = self._joint, self.stuck
        stiffness, damping, friction = (
            joint.stiffness_n_m_rad,
            joint.elastic_damping_n_m_s_rad,
            joint.motor_friction_n_m_s_rad,
        )
        motor_n_m -= self.direction * joint.coulomb_torque_n_m
        angle, speed, twist, twist_speed = (
            [0.0],
            [self.speed_rad_s],
            [self.twist_rad],
            [self.twist_speed_rad_s],
        )
        ripple, quadrature = self._ripple() if joint.torque_ripple_n_m else (NONE, NONE)
        before = size = abs(speed[0]) + abs(twist_speed[0])
        for k in range(ORDER):
            dt = step_s / (k + 1)
            w, v = speed[k], twist_speed[k]
            spring = stiffness * twist[k] + damping * v
            gain = (
                0.0
                if held
                else dt
                * (motor_n_m + ripple[k] - friction * w - spring)
                / joint.motor_inertia_kg_m2
            )
            gain_twist = (
                gain - dt * (load_n_m + spring - self._load_friction * (w - v)) / self._load_inertia
            )
            motor_n_m = load_n_m = 0.0  # constant: in the first term only
            if ripple is not NONE:
                turn = joint.torque_ripple_cycles_per_rev * dt
                rise = turn * sum(map(mul, quadrature, reversed(speed)))
                quadrature.append(-turn * sum(map(mul, ripple, reversed(speed))))
                ripple.append(rise)
            angle.append(dt * w)
            twist.append(dt * v)
            speed.append(gain)
            twist_speed.append(gain_twist)
            now = abs(gain) + abs(gain_twist)
            size = max(size, now)
            if before + now <= NEGLIGIBLE * size:
                return Terms(angle, speed, twist, twist_speed, size, 1.0)
            before = now
        return Terms(
            angle,
            speed,
            twist,
            twist_speed,
            size,
            min(1.0, (NEGLIGIBLE * size / (before + now)) ** (1.0 / ORDER)),
        )

    def _ripple(self) -> tuple[list[float], list[float]]:
        """The ripple's torque and its quadrature now, as first terms."""
        at = (
            self._joint.torque_ripple_cycles_per_rev * self.angle_rad
            + self._joint.torque_ripple_phase_rad
        )
        return [self._joint.torque_ripple_n_m * math.sin(at)], [
            self._joint.torque_ripple_n_m * math.cos(at)
        ]

    def _spring_n_m(self) -> float:
        return (
            self._joint.stiffness_n_m_rad * self.twist_rad
            + self._joint.elastic_damping_n_m_s_rad * self.twist_speed_rad_s
        )

    def _breakaway_n_m(self, motor_n_m: float) -> float:
        """The friction, and what is lost in the sum of the torques that it is compared with."""
        joint = self._joint
        friction_n_m, twist_n_m = (
            joint.coulomb_torque_n_m,
            joint.stiffness_n_m_rad * abs(self.twist_rad),
        )
        damping_n_m = joint.elastic_damping_n_m_s_rad * abs(self.twist_speed_rad_s)
        return friction_n_m + GUARD * (
            friction_n_m + abs(motor_n_m) + joint.torque_ripple_n_m + twist_n_m + damping_n_m
        )

    def _switch(self, terms: Terms, motor_n_m: float) -> float | None:
        """The fraction of a step at which sliding ends or the friction lets go."""
        if self.direction:
            margins = [[self.direction * term for term in terms.speed_rad_s]]
            floor = -GUARD * terms.size_rad_s
        else:
            joint, floor = self._joint, 0.0
            pull = [
                -joint.stiffness_n_m_rad * d - joint.elastic_damping_n_m_s_rad * v
                for d, v in zip(terms.twist_rad, terms.twist_speed_rad_s, strict=True)
            ]
            pull[0] += motor_n_m + self._ripple()[0][0]
            limit = self._breakaway_n_m(motor_n_m)
            margins = [
                [limit - pull[0], *(-term for term in pull[1:])],
                [limit + pull[0], *pull[1:]],
            ]
        found = [first_below(_over(terms.valid, margin), floor) for margin in margins]
        return min((terms.valid * part for part in found if part is not None), default=None)

    def _turn(self, motor_n_m: float) -> None:
        """The friction switches here: a sliding motor has come to rest, and sticks or slides on; a stuck one sets off."""
        came_to_rest = self.direction != 0
        if came_to_rest:
            self.twist_speed_rad_s -= self.speed_rad_s
            self.speed_rad_s = 0.0
        pull_n_m = motor_n_m + self._ripple()[0][0] - self._spring_n_m()
        sticks = came_to_rest and abs(pull_n_m) <= self._breakaway_n_m(motor_n_m)
        self.direction = 0 if sticks else int(math.copysign(1.0, pull_n_m))

    def _nudge(self, size_rad_s: float, switched: bool) -> None:
        """Motor and load together, one way; what is stuck stays stuck, and what has just switched is pushed on its new way."""
        slip_rad_s = (4.0 * GUARD if switched else STEP_ROUNDING_REL) * size_rad_s
        if self.stuck:
            self.twist_speed_rad_s += slip_rad_s
        else:
            self.speed_rad_s += self.direction * slip_rad_s if switched else slip_rad_s
            self.angle_rad += STEP_ROUNDING_REL * abs(self.angle_rad)


def _over(part: float, terms: list[float]) -> list[float]:
    """The same polynomial with that part of the step for its whole."""
    return terms if part == 1.0 else [term * part**k for k, term in enumerate(terms)]
