"""A torque disturbance observer on paper: what the motor does beyond its nominal model is taken for a torque, and cancelled.

    torque to add = Q u - Q Pn^-1 y,   u the torque applied, y the motor's speed, Pn its nominal model, Q a low-pass of gain 1

(source 001, disturbance observer). With the motor alone as nominal an elastic load's reaction is taken for a disturbance as
well; with the joint's own model only what is not the joint's is.
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
SAME_COEFFICIENT_REL = 1e-9  # relative: a nominal this close to the joint is the joint


class Ratio(NamedTuple):
    """A transfer function, highest power first."""

    numerator: FloatArray
    denominator: FloatArray

    def at(self, omega_rad_s: FloatArray) -> ComplexArray:
        """Response at j omega."""
        s = 1j * np.asarray(omega_rad_s)
        return np.asarray(
            np.polyval(self.numerator, s) / np.polyval(self.denominator, s), dtype=np.complex128
        )


@dataclass(frozen=True, kw_only=True)
class LowPass:
    """Q = 1 / (1 + s T)^order, or Butterworth's with its corner at 1 / T. Raises ServoError for values out of bounds."""

    time_constant_s: float
    order: int = 1
    kind: Kind = "binomial"

    def __post_init__(self) -> None:
        check_datum("time_constant_s", self.time_constant_s)
        check_range("order", self.order, 1, MAX_FILTER_ORDER, "1 or 2 is usual")

    @property
    def denominator(self) -> FloatArray:
        """q of Q = 1 / q, highest power first; its last coefficient is 1."""
        t, order = self.time_constant_s, self.order
        if self.kind == "binomial":
            return np.array(
                [math.comb(order, power) * t**power for power in range(order, -1, -1)],
                dtype=np.float64,
            )
        turns = (2.0 * np.arange(1, order + 1) + order - 1.0) / (
            2.0 * order
        )  # of the poles, in half turns
        scaled = np.poly(np.exp(1j * math.pi * turns)).real
        return np.asarray(scaled * t ** np.arange(order, -1, -1), dtype=np.float64)


@dataclass(frozen=True)
class Nominal:
    """Motor speed over motor torque as the observer believes it: polynomials, highest power first."""

    numerator: FloatArray
    denominator: FloatArray

    @classmethod
    def rigid(cls, inertia_kg_m2: float, friction_n_m_s_rad: float = 0.0) -> Nominal:
        """1 / (J s + D). Raises ServoError for values out of bounds."""
        check_datum("inertia_kg_m2", inertia_kg_m2)
        check_datum("friction_n_m_s_rad", friction_n_m_s_rad, zero=True)
        return cls(np.array([1.0]), np.array([inertia_kg_m2, friction_n_m_s_rad]))

    @classmethod
    def motor_alone(cls, joint: TwoMass) -> Nominal:
        """1 / (Jm s + Dm), the lecture's: all that the load does is a disturbance."""
        return cls.rigid(joint.motor_inertia_kg_m2, joint.motor_friction_n_m_s_rad)

    @classmethod
    def rigid_joint(cls, joint: TwoMass) -> Nominal:
        """1 / ((Jm + Jlr) s + Dm + Dlr): the joint as if it were stiff."""
        return cls.rigid(joint.rigid_inertia_kg_m2, joint.rigid_friction_n_m_s_rad)

    @classmethod
    def elastic(cls, joint: TwoMass) -> Nominal:
        """The joint itself. Raises ServoError for one whose load would ring on for ever while the motor stands."""
        if not joint.motor_numerator[1] > 0.0:
            raise ServoError(
                "elastic_damping_n_m_s_rad = 0 without friction of the load; must be > 0, or the inverse of the joint never "
                "settles: measure it, or take a rigid nominal"
            )
        return cls(joint.motor_numerator, joint.denominator[:-1])

    def is_joint(self, joint: TwoMass) -> bool:
        """Whether this is the elastic model of that very joint."""
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
    """Q and nominal, and whether the speed is a difference of angles before Q, or Q differentiates the angle itself.

    Raises Improper for a Q that cannot: its order must be that of the differentiation, 1 for a speed, 2 for an angle.
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
                f"order = {self.low_pass.order} of Q over a nominal with {needed} more poles than zeros from torque to "
                f"{self.measured}; must be >= {needed}: raise the order"
                + (", or measure the speed" if needed == 2 else "")
            )

    def characteristic(self, joint: TwoMass) -> FloatArray:
        """Of a joint with the observer around it, whole: (q - 1) a D3 + Nm b with Q = 1 / q, Pn = a / b, P = Nm / D3.

        With one pole at 0 left out: the angle's. Rigid nominal: the denominator of G_f H_f / s with H_f = (Jlr s^2 + Del s +
        Kel)(Jm s^2 + Dm s) + G_f (Del s + Kel) Jlr s^2 (source 001 prints Jm in place of Jlr in the last term).
        """
        a, b = self.nominal.numerator, self.nominal.denominator
        return np.asarray(
            np.polyadd(
                np.polymul(self._high(a), joint.denominator[:-1]),
                np.polymul(joint.motor_numerator, b),
            )
        )

    def poles_1_s(self, joint: TwoMass) -> ComplexArray:
        """Those that a torque on the motor moves. The elastic nominal of the joint itself leaves the joint's own and Q's: what
        its inverse adds, the load swinging while the motor stands, is not among them (cancelled_poles_1_s).
        """
        if not self.nominal.is_joint(joint):
            return _roots(self.characteristic(joint))
        return np.concatenate([_roots(self.low_pass.denominator), joint.poles_1_s])

    def cancelled_poles_1_s(self, joint: TwoMass) -> ComplexArray:
        """Of the elastic nominal's inverse; no torque on the motor moves them, a torque on the load does."""
        return (
            _roots(joint.motor_numerator)
            if self.nominal.is_joint(joint)
            else np.zeros(0, dtype=np.complex128)
        )

    def loop(self, joint: TwoMass) -> ControlLoop:
        """Continuous, opened where the observer's torque enters the motor; closed from the controller's torque, wanted_torque.

        Opened it is (Q / (1 - Q)) P / Pn, so that gain and phase margin tell what the joint may differ from the nominal.
        """
        import control

        own = self.estimator()
        own = control.ss(own, inputs=["drive_torque", own.input_labels[1]], outputs="added_torque")
        blocks = [
            plant(joint),
            own,
            control.summing_junction(["wanted_torque", "added_torque"], "drive_torque"),
        ]
        closed = interconnect([*blocks, input_disturbance()], ["wanted_torque", *TORQUES], STATES)
        forward = interconnect(blocks, ["wanted_torque", "torque"], ["drive_torque"])
        return ControlLoop(
            -control.ss(forward["drive_torque", "torque"]), closed, "wanted_torque", "motor_speed"
        )

    def least_damped(self, joint: TwoMass) -> PolePair:
        """Of the poles that a torque on the motor moves, Q's included; damping 1 where nothing swings, < 0 if unstable."""
        return min(pole_pairs(self.poles_1_s(joint)), key=lambda mode: mode.damping)

    def disturbance(self, joint: TwoMass, torque: Place, speed: Place) -> Ratio:
        """From a torque that is not the controller's to a speed [rad/s per N m], both at the motor's side of the gear."""
        a, b = self.nominal.numerator, self.nominal.denominator
        if torque == "motor" or speed == "motor":
            through = joint.motor_numerator if torque == speed else joint.load_numerator
            top = self._high(np.asarray(np.polymul(a, through)))
        else:
            own = np.polyadd(
                [joint.motor_inertia_kg_m2, joint.motor_friction_n_m_s_rad, 0.0],
                joint.load_numerator,
            )
            top = np.asarray(
                np.polyadd(self._high(np.asarray(np.polymul(a, own))), np.append(b, 0.0))
            )
        return Ratio(top, self.characteristic(joint))

    def command(self, joint: TwoMass, speed: Place) -> Ratio:
        """From the controller's torque to a speed [rad/s per N m], at the motor's side."""
        top = joint.motor_numerator if speed == "motor" else joint.load_numerator
        top = np.polymul(np.polymul(self.low_pass.denominator, self.nominal.numerator), top)
        return Ratio(np.asarray(top), self.characteristic(joint))

    def estimator(self, lead_s: float = 0.0) -> Any:
        """control.StateSpace from torque applied and motor speed (or angle) to the torque to add: [Q (1 + s lead), -Q / Pn]."""
        import control

        a, b = self.nominal.numerator, self.nominal.denominator
        b = np.append(b, 0.0) if self.measured == "angle" else b
        below = np.polymul(self.low_pass.denominator, a)
        order = below.size - 1
        powers = self.low_pass.time_constant_s ** -np.arange(
            order, -1.0, -1.0
        )  # s T in place of s: coefficients near 1
        ahead = np.polymul([lead_s, 1.0], a) if lead_s else a
        above = np.array(
            [np.pad(top, (order + 1 - top.size, 0)) for top in (ahead, -b)]
        )  # (2, order + 1)
        above, below = (
            above * powers / (below[0] * powers[0]),
            below * powers / (below[0] * powers[0]),
        )
        state = np.eye(order, k=1)
        state[:, 0] = -below[1:]
        push = above[:, 1:].T - np.outer(below[1:], above[:, 0])
        rate = 1.0 / self.low_pass.time_constant_s
        names = {"inputs": ["torque", f"motor_{self.measured}"], "outputs": "added_torque"}
        return control.ss(state * rate, push * rate, np.eye(1, order), above[:, :1].T, **names)

    def _high(self, polynomial: FloatArray) -> FloatArray:
        """(q - 1) times it."""
        q = self.low_pass.denominator
        return np.asarray(np.polymul(np.append(q[:-1], 0.0), polynomial))


def _roots(polynomial: FloatArray) -> ComplexArray:
    return np.asarray(np.roots(polynomial), dtype=np.complex128)
