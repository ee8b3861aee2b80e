"""Continuous design of a torque disturbance observer.

    torque to add = Q u - Q Pn^-1 y

u the torque applied, y the speed of the motor, Pn its nominal model, Q a low-pass of gain 1 (source
001, disturbance observer). What the motor does beyond its nominal model counts as a torque, and is
compensated. With the motor alone as nominal model, the reaction of an elastic load is compensated
too; with the model of the joint, only what deviates from the joint is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from planners.trajectories.pieces import ComplexArray, FloatArray
from rig.drives.servo.errors import Improper, ServoError, check_datum, check_range
from rig.drives.servo.loops import PolePair, pole_pairs
from rig.drives.servo.two_mass import TwoMass
from rig.drives.servo.wiring import (
    STATES,
    TORQUES,
    ControlLoop,
    input_disturbance,
    interconnect,
    plant,
)

MAX_FILTER_ORDER = 8
Kind = Literal["binomial", "butterworth"]
Measured = Literal["speed", "angle"]
Place = Literal["motor", "load"]
SAME_COEFFICIENT_REL = 1e-9  # relative difference of coefficients that count as equal


class Ratio(NamedTuple):
    """Transfer function as two polynomials, highest power first."""

    numerator: FloatArray
    denominator: FloatArray

    def at(self, omega_rad_s: FloatArray) -> ComplexArray:
        """Compute the frequency response at j omega."""
        s = 1j * np.asarray(omega_rad_s)
        return np.asarray(
            np.polyval(self.numerator, s) / np.polyval(self.denominator, s), dtype=np.complex128
        )


@dataclass(frozen=True, kw_only=True)
class LowPass:
    """Low-pass filter Q = 1 / (1 + s T)^order, or Butterworth with its corner at 1 / T.

    Raises ServoError for values out of bounds.
    """

    time_constant_s: float
    order: int = 1
    kind: Kind = "binomial"

    def __post_init__(self) -> None:
        check_datum("time_constant_s", self.time_constant_s)
        check_range("order", self.order, 1, MAX_FILTER_ORDER, "1 or 2 is usual")

    @property
    def denominator(self) -> FloatArray:
        """Denominator q of Q = 1 / q, highest power first; its last coefficient is 1."""
        t, order = self.time_constant_s, self.order
        if self.kind == "binomial":
            return np.array(
                [math.comb(order, power) * t**power for power in range(order, -1, -1)],
                dtype=np.float64,
            )
        half_turns = (2.0 * np.arange(1, order + 1) + order - 1.0) / (2.0 * order)  # of the poles
        scaled = np.poly(np.exp(1j * math.pi * half_turns)).real
        return np.asarray(scaled * t ** np.arange(order, -1, -1), dtype=np.float64)


@dataclass(frozen=True)
class Nominal:
    """Nominal model of the observer, motor speed over motor torque; highest power first."""

    numerator: FloatArray
    denominator: FloatArray

    @classmethod
    def rigid(cls, inertia_kg_m2: float, friction_n_m_s_rad: float = 0.0) -> Nominal:
        """Build 1 / (J s + D); raises ServoError for values out of bounds."""
        check_datum("inertia_kg_m2", inertia_kg_m2)
        check_datum("friction_n_m_s_rad", friction_n_m_s_rad, zero=True)
        return cls(np.array([1.0]), np.array([inertia_kg_m2, friction_n_m_s_rad]))

    @classmethod
    def motor_alone(cls, joint: TwoMass) -> Nominal:
        """Build 1 / (Jm s + Dm), the nominal model of source 001.

        Every effect of the load then counts as a disturbance.
        """
        return cls.rigid(joint.motor_inertia_kg_m2, joint.motor_friction_n_m_s_rad)

    @classmethod
    def rigid_joint(cls, joint: TwoMass) -> Nominal:
        """Build 1 / ((Jm + Jlr) s + Dm + Dlr): the joint with infinite stiffness."""
        return cls.rigid(joint.rigid_inertia_kg_m2, joint.rigid_friction_n_m_s_rad)

    @classmethod
    def elastic(cls, joint: TwoMass) -> Nominal:
        """Build the model of the elastic joint.

        Raises ServoError for a joint whose load oscillates undamped with locked rotor.
        """
        if not joint.motor_numerator[1] > 0.0:
            raise ServoError(
                "elastic_damping_n_m_s_rad = 0 without friction of the load; must be > 0, "
                "otherwise the inverse of the joint never settles: measure it, or use a rigid "
                "nominal model"
            )
        return cls(joint.motor_numerator, joint.denominator[:-1])

    def is_joint(self, joint: TwoMass) -> bool:
        """Compare with the elastic model of a joint; True if they are equal."""
        pairs = (
            (self.numerator, joint.motor_numerator),
            (self.denominator, joint.denominator[:-1]),
        )
        return all(
            a.shape == b.shape and np.allclose(a, b, rtol=SAME_COEFFICIENT_REL, atol=0.0)
            for a, b in pairs
        )


@dataclass(frozen=True, kw_only=True)
class ObserverDesign:
    """Filter Q, nominal model and measured signal of an observer.

    measured = "speed": angles are differenced before Q; "angle": Q differentiates the angle itself.
    Raises Improper if the order of Q is below that of the differentiation: 1 for a speed, 2 for an
    angle.
    """

    low_pass: LowPass
    nominal: Nominal
    measured: Measured = "speed"

    def __post_init__(self) -> None:
        needed = (
            self.nominal.denominator.size - self.nominal.numerator.size + (self.measured == "angle")
        )
        if self.low_pass.order < needed:
            raise Improper(
                f"order = {self.low_pass.order} of Q over a nominal model with {needed} more poles "
                f"than zeros from torque to {self.measured}; must be >= {needed}: raise the order"
                + (", or measure the speed" if needed == 2 else "")
            )

    def characteristic(self, joint: TwoMass) -> FloatArray:
        """Compute the characteristic polynomial of a joint with the observer.

        (q - 1) a D3 + Nm b with Q = 1 / q, Pn = a / b, P = Nm / D3. The pole at 0 of the angle is
        left out. With a rigid nominal model it is the denominator of G_f H_f / s with

            H_f = (Jlr s^2 + Del s + Kel)(Jm s^2 + Dm s) + G_f (Del s + Kel) Jlr s^2

        (source 001 prints Jm in place of Jlr in the last term).
        """
        a, b = self.nominal.numerator, self.nominal.denominator
        return np.asarray(
            np.polyadd(
                np.polymul(self._times_q_minus_1(a), joint.denominator[:-1]),
                np.polymul(joint.motor_numerator, b),
            )
        )

    def poles_1_s(self, joint: TwoMass) -> ComplexArray:
        """Compute the poles that a torque on the motor excites.

        With the elastic nominal model of the joint itself: the poles of the joint and of Q. The
        poles that its inverse adds, the load oscillating with locked rotor, are cancelled
        (cancelled_poles_1_s).
        """
        if not self.nominal.is_joint(joint):
            return _roots(self.characteristic(joint))
        return np.concatenate([_roots(self.low_pass.denominator), joint.poles_1_s])

    def cancelled_poles_1_s(self, joint: TwoMass) -> ComplexArray:
        """Compute the poles of the inverse of the elastic nominal model.

        A torque on the motor does not excite them, a torque on the load does.
        """
        return (
            _roots(joint.motor_numerator)
            if self.nominal.is_joint(joint)
            else np.zeros(0, dtype=np.complex128)
        )

    def loop(self, joint: TwoMass) -> ControlLoop:
        """Build the continuous loop, opened where the torque of the observer enters the motor.

        Closed from controller_torque, the torque of the controller. Opened it is (Q / (1 - Q)) P /
        Pn: its gain and phase margin bound the deviation of the joint from the nominal model.
        """
        import control

        estimator = self.estimator()
        inputs = ["drive_torque", estimator.input_labels[1]]
        blocks = [
            plant(joint),
            control.ss(estimator, inputs=inputs, outputs="added_torque"),
            control.summing_junction(["controller_torque", "added_torque"], "drive_torque"),
        ]
        closed = interconnect(
            [*blocks, input_disturbance()], ["controller_torque", *TORQUES], STATES
        )
        forward = interconnect(blocks, ["controller_torque", "torque"], ["drive_torque"])
        return ControlLoop(
            -control.ss(forward["drive_torque", "torque"]),
            closed,
            "controller_torque",
            "motor_speed",
        )

    def least_damped(self, joint: TwoMass) -> PolePair:
        """Find the least damped pole pair that a torque on the motor excites, Q included.

        Damping ratio 1 without oscillation, < 0 if unstable.
        """
        return min(pole_pairs(self.poles_1_s(joint)), key=lambda mode: mode.damping)

    def disturbance(self, joint: TwoMass, torque: Place, speed: Place) -> Ratio:
        """Compute the transfer function from a disturbance torque to a speed.

        In rad/s per N m, both at the motor side of the gear.
        """
        a, b = self.nominal.numerator, self.nominal.denominator
        if torque == "motor" or speed == "motor":
            through = joint.motor_numerator if torque == speed else joint.load_numerator
            top = self._times_q_minus_1(np.asarray(np.polymul(a, through)))
        else:
            motor_side = np.polyadd(
                [joint.motor_inertia_kg_m2, joint.motor_friction_n_m_s_rad, 0.0],
                joint.load_numerator,
            )
            top = np.asarray(
                np.polyadd(
                    self._times_q_minus_1(np.asarray(np.polymul(a, motor_side))), np.append(b, 0.0)
                )
            )
        return Ratio(top, self.characteristic(joint))

    def command(self, joint: TwoMass, speed: Place) -> Ratio:
        """Compute the transfer function from the torque of the controller to a speed.

        In rad/s per N m, at the motor side of the gear.
        """
        top = joint.motor_numerator if speed == "motor" else joint.load_numerator
        top = np.polymul(np.polymul(self.low_pass.denominator, self.nominal.numerator), top)
        return Ratio(np.asarray(top), self.characteristic(joint))

    def estimator(self, lead_s: float = 0.0) -> Any:
        """Build the observer as control.StateSpace: [Q (1 + s lead), -Q / Pn].

        From the torque applied and the motor speed (or angle) to the torque to add.
        """
        import control

        a, b = self.nominal.numerator, self.nominal.denominator
        b = np.append(b, 0.0) if self.measured == "angle" else b
        below = np.polymul(self.low_pass.denominator, a)
        order = below.size - 1
        # powers of 1 / T: s T in place of s gives coefficients near 1
        powers = self.low_pass.time_constant_s ** -np.arange(order, -1.0, -1.0)
        lead = np.polymul([lead_s, 1.0], a) if lead_s else a
        # (2, order + 1)
        above = np.array([np.pad(top, (order + 1 - top.size, 0)) for top in (lead, -b)])
        leading = below[0] * powers[0]
        above = above * powers / leading
        below = below * powers / leading
        state = np.eye(order, k=1)
        state[:, 0] = -below[1:]
        entry = above[:, 1:].T - np.outer(below[1:], above[:, 0])
        rate = 1.0 / self.low_pass.time_constant_s
        names = {"inputs": ["torque", f"motor_{self.measured}"], "outputs": "added_torque"}
        return control.ss(state * rate, entry * rate, np.eye(1, order), above[:, :1].T, **names)

    def _times_q_minus_1(self, polynomial: FloatArray) -> FloatArray:
        """Multiply a polynomial by q - 1."""
        q = self.low_pass.denominator
        return np.asarray(np.polymul(np.append(q[:-1], 0.0), polynomial))


def _roots(polynomial: FloatArray) -> ComplexArray:
    return np.asarray(np.roots(polynomial), dtype=np.complex128)
