"""Continuous design of a torque disturbance observer.

    torque to add = Q u - Q Pn^-1 y

u the torque applied, y the speed of the motor, Pn its nominal model, Q a low-pass of gain 1 (source
001, disturbance observer). It works for any plant with input u and output y. What the motor does
beyond its nominal model counts as a torque, and is compensated. With the motor alone as nominal
model, the reaction of an elastic load is compensated too; with the model of the joint, only what
deviates from the joint is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from planners.trajectories.pieces import ComplexArray, FloatArray
from rig.drives.servo.errors import Improper, ServoError
from rig.drives.servo.loops import PolePair, pole_pairs
from rig.drives.servo.nominal import LowPass, Nominal, Ratio, coefficients
from rig.drives.servo.two_mass import TwoMass
from rig.drives.servo.wiring import (
    STATES,
    TORQUES,
    ControlLoop,
    input_disturbance,
    interconnect,
    plant,
)

Measured = Literal["speed", "angle", "output"]
Place = Literal["motor", "load"]


@dataclass(frozen=True, kw_only=True)
class ObserverDesign:
    """Filter Q, nominal model and measured signal of an observer.

    measured = "speed": angles are differenced before Q; "angle": Q differentiates the angle itself;
    "output": the nominal model gives the measured signal, whatever it is. Raises Improper if the
    relative degree of Q, its order, is below that of the nominal model from torque to the measured
    signal, which for an angle is larger by 1.
    """

    low_pass: LowPass
    nominal: Nominal
    measured: Measured = "speed"

    def __post_init__(self) -> None:
        pn = self.nominal
        poles = pn.denominator.size - 1 + (self.measured == "angle")
        needed = poles + 1 - pn.numerator.size
        if self.low_pass.order < needed:
            advice = "raise the order"
            if self.measured == "angle" and needed == 2:
                advice += ", or measure the speed"
            raise Improper(
                f"order = {self.low_pass.order} of Q (its relative degree) over a nominal model of "
                f"relative degree {needed} (degrees {poles} - {pn.numerator.size - 1}) from torque "
                f"to {self.measured}; must be >= {needed}: {advice}"
            )

    def characteristic(self, plant: TwoMass | Nominal) -> FloatArray:
        """Compute the characteristic polynomial of a plant with the observer.

        (q - 1) a D + N b with Q = 1 / q, Pn = a / b, P = N / D. Of a joint P is its motor speed:
        the pole at 0 of the angle is left out. With a rigid nominal model it is the denominator of
        G_f H_f / s with

            H_f = (Jlr s^2 + Del s + Kel)(Jm s^2 + Dm s) + G_f (Del s + Kel) Jlr s^2

        (source 001 prints Jm in place of Jlr in the last term).
        """
        a, b = self.nominal.numerator, self.nominal.denominator
        numerator, denominator = coefficients(plant)
        return np.asarray(
            np.polyadd(np.polymul(self._times_q_minus_1(a), denominator), np.polymul(numerator, b))
        )

    def poles_1_s(self, plant: TwoMass | Nominal) -> ComplexArray:
        """Compute the poles that a torque on the motor, or at the input of the plant, excites.

        With the plant itself as nominal model: the poles of the plant and of Q. The poles that its
        inverse adds, of a joint the load oscillating with locked rotor, are cancelled
        (cancelled_poles_1_s).
        """
        if not self.nominal.is_plant(plant):
            return _roots(self.characteristic(plant))
        _, denominator = coefficients(plant)
        return np.concatenate([_roots(self.low_pass.denominator), _roots(denominator)])

    def cancelled_poles_1_s(self, plant: TwoMass | Nominal) -> ComplexArray:
        """Compute the poles of the inverse of a nominal model that is the plant.

        A torque on the motor does not excite them, a torque on the load does.
        """
        if not self.nominal.is_plant(plant):
            return np.zeros(0, dtype=np.complex128)
        return _roots(self.nominal.numerator)

    def rejection(self, plant: Nominal) -> Ratio:
        """Compute the transfer function from a disturbance at the input to the output.

        P (1 - Q) / (1 - Q + Q P / Pn) of any plant P.
        """
        top = np.polymul(self.nominal.numerator, plant.numerator)
        return Ratio(self._times_q_minus_1(np.asarray(top)), self.characteristic(plant))

    def response(self, plant: Nominal) -> Ratio:
        """Compute the transfer function from the input of the controller to the output.

        P / (1 - Q + Q P / Pn) of any plant P: with the nominal model as plant it is P.
        """
        top = np.polymul(self.low_pass.denominator, self.nominal.numerator)
        return Ratio(np.asarray(np.polymul(top, plant.numerator)), self.characteristic(plant))

    def loop(self, joint: TwoMass) -> ControlLoop:
        """Build the continuous loop, opened where the torque of the observer enters the motor.

        Closed from controller_torque, the torque of the controller. Opened it is (Q / (1 - Q)) P /
        Pn: its gain and phase margin bound the deviation of the joint from the nominal model.
        Raises ServoError for measured = "output", which is no signal of a joint.
        """
        import control

        if self.measured == "output":
            raise ServoError(
                "measured = 'output' around a joint; must be 'speed' or 'angle': choose one"
            )
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

    def least_damped(self, plant: TwoMass | Nominal) -> PolePair:
        """Find the least damped pole pair that a torque on the motor excites, Q included.

        Damping ratio 1 without oscillation, < 0 if unstable.
        """
        return min(pole_pairs(self.poles_1_s(plant)), key=lambda mode: mode.damping)

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

        From the torque applied and the motor speed (or angle, or output) to the torque to add.
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
        signal = "output" if self.measured == "output" else f"motor_{self.measured}"
        names = {"inputs": ["torque", signal], "outputs": "added_torque"}
        return control.ss(state * rate, entry * rate, np.eye(1, order), above[:, :1].T, **names)

    def _times_q_minus_1(self, polynomial: FloatArray) -> FloatArray:
        """Multiply a polynomial by q - 1."""
        q = self.low_pass.denominator
        return np.asarray(np.polymul(np.append(q[:-1], 0.0), polynomial))


def _roots(polynomial: FloatArray) -> ComplexArray:
    return np.asarray(np.roots(polynomial), dtype=np.complex128)
