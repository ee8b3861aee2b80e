"""Motion of the elastic joint under constant torques, by Taylor series of variable order.

A step ends where the friction switches. Equations of motion, referred to the motor, with
x = gear_ratio x load angle, twist d = q - x, v = d', J_l = J_load / ratio^2 and
B_l = B_load / ratio^2:

    J_m q'' = torque + A sin(c q + phase) - B_m q' - K d - D v - F
    J_l x'' = load / ratio + K d + D v - B_l x'

Linear part: source 001, two-mass model. Coulomb friction is set-valued: F = F_c sign(q') in motion;
at rest F balances the other torques up to F_c (Filippov). Without ripple the energy of the
difference of two motions never increases.
"""

from __future__ import annotations

import math
import sys
from operator import mul
from typing import NamedTuple

from sim_rig.crossing import first_below, value
from sim_rig.joint_params import Joint

MAX_ORDER = 24  # a series that has not converged is used over a part of its step
NEGLIGIBLE_TERM_REL = 1e-17  # of the largest term: two such terms in a row end a series
STEP_ROUNDING_REL = 2.0 * sys.float_info.epsilon  # error of a step, of its largest term
# tolerance of a switching condition, of the sum of its terms: closer to its limit it is fulfilled
SWITCH_ROUNDING_REL = 16.0 * sys.float_info.epsilon
NO_RIPPLE = [0.0] * MAX_ORDER


class Terms(NamedTuple):
    """Taylor terms over a step.

    After the fraction f of the step, each variable is the sum of its terms[k] f^k.
    """

    angle_rad: list[float]
    speed_rad_s: list[float]
    twist_rad: list[float]
    twist_speed_rad_s: list[float]
    size_rad_s: float  # largest term
    valid: float  # up to this fraction the truncation is negligible


class JointMotion:
    """State of the joint; a perturbed one is displaced after each step by the rounding error."""

    def __init__(self, joint: Joint, *, perturbed: bool = False) -> None:
        self.angle_rad = 0.0  # of the motor
        self.speed_rad_s = 0.0
        self.twist_rad = 0.0  # d
        self.twist_speed_rad_s = 0.0  # v
        self.direction = 0  # of sliding: -1, 1; 0 = stuck, if there is friction
        self._joint = joint
        self._load_inertia = joint.reflected_inertia_kg_m2
        self._load_friction = joint.load_friction_n_m_s_rad / joint.gear_ratio**2
        self._max_step_s = 1.0 / joint.max_rate_rad_s
        self._perturbed = perturbed

    @property
    def stuck(self) -> bool:
        """True if dry friction holds the motor."""
        return self.direction == 0 and self._joint.coulomb_torque_n_m > 0.0

    @property
    def load_speed_rad_s(self) -> float:
        """Speed x' of the load, referred to the motor."""
        return self.speed_rad_s - self.twist_speed_rad_s

    def load_acceleration_rad_s2(self, load_n_m: float) -> float:
        """Compute the acceleration x'' of the load under a load torque, referred to the motor."""
        return (
            load_n_m + self._spring_n_m() - self._load_friction * self.load_speed_rad_s
        ) / self._load_inertia

    def advance(self, motor_n_m: float, load_n_m: float, duration_s: float) -> None:
        """Integrate over a duration with constant torques, both referred to the motor."""
        left_s = duration_s
        while left_s > 0.0:
            left_s -= self._step(motor_n_m, load_n_m, min(left_s, self._max_step_s))

    def _step(self, motor_n_m: float, load_n_m: float, step_s: float) -> float:
        """Take one step, up to the first switch of the friction if any; return its duration [s]."""
        terms = self._series(motor_n_m, load_n_m, step_s)
        switch = self._find_switch(terms, motor_n_m) if self._joint.coulomb_torque_n_m else None
        fraction = terms.valid if switch is None else switch
        self.angle_rad += value(terms.angle_rad, fraction)
        self.speed_rad_s = value(terms.speed_rad_s, fraction)
        self.twist_rad = value(terms.twist_rad, fraction)
        self.twist_speed_rad_s = value(terms.twist_speed_rad_s, fraction)
        if switch is not None:
            self._switch_friction(motor_n_m)
        if self._perturbed:
            self._perturb(terms.size_rad_s, switch is not None)
        return fraction * step_s

    def _series(self, motor_n_m: float, load_n_m: float, step_s: float) -> Terms:
        """Compute the Taylor terms by recursion.

        Sine and cosine of the ripple have their own recursion (Jorba & Zou 2005, section 2).
        """
        joint = self._joint
        held = self.stuck
        stiffness = joint.stiffness_n_m_rad
        damping = joint.elastic_damping_n_m_s_rad
        friction = joint.motor_friction_n_m_s_rad
        motor_n_m -= self.direction * joint.coulomb_torque_n_m
        angle = [0.0]
        speed = [self.speed_rad_s]
        twist = [self.twist_rad]
        twist_speed = [self.twist_speed_rad_s]
        ripple = quadrature = NO_RIPPLE
        if joint.torque_ripple_n_m:
            sine_n_m, cosine_n_m = self._ripple_n_m()
            ripple = [sine_n_m]
            quadrature = [cosine_n_m]
        before = size = abs(speed[0]) + abs(twist_speed[0])
        for k in range(MAX_ORDER):
            dt = step_s / (k + 1)
            w, v = speed[k], twist_speed[k]
            spring = stiffness * twist[k] + damping * v
            if held:
                next_speed = 0.0
            else:
                torque = motor_n_m + ripple[k] - friction * w - spring
                next_speed = dt * torque / joint.motor_inertia_kg_m2
            load_torque = load_n_m + spring - self._load_friction * (w - v)
            next_twist_speed = next_speed - dt * load_torque / self._load_inertia
            motor_n_m = load_n_m = 0.0  # constant: in the first term only
            if ripple is not NO_RIPPLE:
                scale = joint.torque_ripple_cycles_per_rev * dt
                next_ripple = scale * sum(map(mul, quadrature, reversed(speed)))
                quadrature.append(-scale * sum(map(mul, ripple, reversed(speed))))
                ripple.append(next_ripple)
            angle.append(dt * w)
            twist.append(dt * v)
            speed.append(next_speed)
            twist_speed.append(next_twist_speed)
            now = abs(next_speed) + abs(next_twist_speed)
            size = max(size, now)
            if before + now <= NEGLIGIBLE_TERM_REL * size:
                return Terms(angle, speed, twist, twist_speed, size, 1.0)
            before = now
        valid = min(1.0, (NEGLIGIBLE_TERM_REL * size / (before + now)) ** (1.0 / MAX_ORDER))
        return Terms(angle, speed, twist, twist_speed, size, valid)

    def _ripple_n_m(self) -> tuple[float, float]:
        """Compute the ripple torque and its quadrature: A sin and A cos of (c q + phase)."""
        joint = self._joint
        phase = joint.torque_ripple_cycles_per_rev * self.angle_rad + joint.torque_ripple_phase_rad
        amplitude = joint.torque_ripple_n_m
        return amplitude * math.sin(phase), amplitude * math.cos(phase)

    def _spring_n_m(self) -> float:
        return (
            self._joint.stiffness_n_m_rad * self.twist_rad
            + self._joint.elastic_damping_n_m_s_rad * self.twist_speed_rad_s
        )

    def _breakaway_n_m(self, motor_n_m: float) -> float:
        """Compute the breakaway torque: friction plus rounding of the torques compared with it."""
        joint = self._joint
        friction_n_m = joint.coulomb_torque_n_m
        twist_n_m = joint.stiffness_n_m_rad * abs(self.twist_rad)
        damping_n_m = joint.elastic_damping_n_m_s_rad * abs(self.twist_speed_rad_s)
        return friction_n_m + SWITCH_ROUNDING_REL * (
            friction_n_m + abs(motor_n_m) + joint.torque_ripple_n_m + twist_n_m + damping_n_m
        )

    def _find_switch(self, terms: Terms, motor_n_m: float) -> float | None:
        """Find the fraction of a step at which sliding ends or the motor breaks away, if any."""
        if self.direction:
            margins = [[self.direction * term for term in terms.speed_rad_s]]
            bound = -SWITCH_ROUNDING_REL * terms.size_rad_s
        else:
            margins = self._breakaway_margins(terms, motor_n_m)
            bound = 0.0
        found = [first_below(_rescale(margin, terms.valid), bound) for margin in margins]
        return min((terms.valid * part for part in found if part is not None), default=None)

    def _breakaway_margins(self, terms: Terms, motor_n_m: float) -> list[list[float]]:
        """Compute breakaway torque minus torque on the stuck motor, in both directions.

        Returns the Taylor terms of the two margins.
        """
        joint = self._joint
        torque = [
            -joint.stiffness_n_m_rad * d - joint.elastic_damping_n_m_s_rad * v
            for d, v in zip(terms.twist_rad, terms.twist_speed_rad_s, strict=True)
        ]
        torque[0] += motor_n_m + self._ripple_n_m()[0]
        limit = self._breakaway_n_m(motor_n_m)
        return [
            [limit - torque[0], *(-term for term in torque[1:])],
            [limit + torque[0], *torque[1:]],
        ]

    def _switch_friction(self, motor_n_m: float) -> None:
        """Switch the friction: a sliding motor at rest sticks or slides on, a stuck one slides."""
        came_to_rest = self.direction != 0
        if came_to_rest:
            self.twist_speed_rad_s -= self.speed_rad_s
            self.speed_rad_s = 0.0
        torque_n_m = motor_n_m + self._ripple_n_m()[0] - self._spring_n_m()
        sticks = came_to_rest and abs(torque_n_m) <= self._breakaway_n_m(motor_n_m)
        self.direction = 0 if sticks else int(math.copysign(1.0, torque_n_m))

    def _perturb(self, size_rad_s: float, switched: bool) -> None:
        """Displace motor and load together, in one direction.

        A stuck motor stays stuck; after a switch the displacement is in the new direction.
        """
        rounding_rel = 4.0 * SWITCH_ROUNDING_REL if switched else STEP_ROUNDING_REL
        error_rad_s = rounding_rel * size_rad_s
        if self.stuck:
            self.twist_speed_rad_s += error_rad_s
        else:
            self.speed_rad_s += self.direction * error_rad_s if switched else error_rad_s
            self.angle_rad += STEP_ROUNDING_REL * abs(self.angle_rad)


def _rescale(terms: list[float], fraction: float) -> list[float]:
    """Rescale the terms of a polynomial to a fraction of its interval."""
    return terms if fraction == 1.0 else [term * fraction**k for k, term in enumerate(terms)]
