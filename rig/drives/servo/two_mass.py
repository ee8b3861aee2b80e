"""Linear model of an elastic joint: two masses, a spring and a damper.

    Jm qm'' + Dm qm' = tau - (Del s + Kel)(qm - n ql)
    Jlr n ql'' + Dlr n ql' = (Del s + Kel)(qm - n ql) + tau_l / n

seen from the motor: Jlr = Jl / n^2, Dlr = Dl / n^2 (source 001, elastic joint; its input matrix
lacks 1 / Jm).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from planners.trajectories.pieces import ComplexArray, FloatArray
from rig.drives.servo.errors import ServoError, check_datum, check_range

MAY_BE_ZERO = ("motor_friction_n_m_s_rad", "load_friction_n_m_s_rad", "elastic_damping_n_m_s_rad")


@dataclass(frozen=True, kw_only=True)
class TwoMass:
    """Parameters as catalogues give them.

    Load at the output shaft; spring and damper at the motor side of the gear. Raises ServoError for
    values that are not 1e-12 to 1e12 (frictions and the damper may be 0).
    """

    motor_inertia_kg_m2: float
    load_inertia_kg_m2: float
    stiffness_n_m_rad: float
    gear_ratio: float = 1.0  # turns of the motor per turn of the load
    motor_friction_n_m_s_rad: float = 0.0
    load_friction_n_m_s_rad: float = 0.0
    elastic_damping_n_m_s_rad: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            check_datum(field.name, getattr(self, field.name), zero=field.name in MAY_BE_ZERO)

    @classmethod
    def normalised(
        cls,
        antiresonance_rad_s: float,
        inertia_ratio: float,
        antiresonance_damping: float,
        inertia_kg_m2: float = 1.0,
    ) -> TwoMass:
        """Build a joint from omega_z, rho = Jlr / Jm, zeta_z and Jm + Jlr.

        Without gear and friction (source 001, its simulations). Raises ServoError for values out of
        bounds; zeta_z is 0 to 1.
        """
        check_datum("antiresonance_rad_s", antiresonance_rad_s)
        check_datum("inertia_ratio", inertia_ratio)
        check_range(
            "antiresonance_damping",
            antiresonance_damping,
            0.0,
            1.0,
            "choose at most critical damping",
        )
        load = inertia_kg_m2 * inertia_ratio / (1.0 + inertia_ratio)
        return cls(
            motor_inertia_kg_m2=inertia_kg_m2 / (1.0 + inertia_ratio),
            load_inertia_kg_m2=load,
            stiffness_n_m_rad=load * antiresonance_rad_s**2,
            elastic_damping_n_m_s_rad=2.0 * antiresonance_damping * antiresonance_rad_s * load,
        )

    @property
    def reflected_inertia_kg_m2(self) -> float:
        """Jlr, inertia of the load seen at the motor."""
        return self.load_inertia_kg_m2 / self.gear_ratio**2

    @property
    def reflected_friction_n_m_s_rad(self) -> float:
        """Dlr, friction of the load seen at the motor."""
        return self.load_friction_n_m_s_rad / self.gear_ratio**2

    @property
    def rigid_inertia_kg_m2(self) -> float:
        """Inertia Jm + Jlr of the rigid joint."""
        return self.motor_inertia_kg_m2 + self.reflected_inertia_kg_m2

    @property
    def rigid_friction_n_m_s_rad(self) -> float:
        """Friction Dm + Dlr of the rigid joint."""
        return self.motor_friction_n_m_s_rad + self.reflected_friction_n_m_s_rad

    @property
    def antiresonance_rad_s(self) -> float:
        """Antiresonance omega_z = sqrt(Kel / Jlr).

        Natural frequency of the load with locked rotor.
        """
        return math.sqrt(self.stiffness_n_m_rad / self.reflected_inertia_kg_m2)

    @property
    def state_matrix(self) -> FloatArray:
        """Matrix A (4, 4) of x = [qm, qm', n ql, n ql']."""
        jm, jl, k = self.motor_inertia_kg_m2, self.reflected_inertia_kg_m2, self.stiffness_n_m_rad
        d, dm, dl = (
            self.elastic_damping_n_m_s_rad,
            self.motor_friction_n_m_s_rad,
            self.reflected_friction_n_m_s_rad,
        )
        return np.array(
            [
                [0.0, 1.0, 0.0, 0.0],
                [-k / jm, -(d + dm) / jm, k / jm, d / jm],
                [0.0, 0.0, 0.0, 1.0],
                [k / jl, d / jl, -k / jl, -(d + dl) / jl],
            ]
        )

    @property
    def input_matrix(self) -> FloatArray:
        """Matrix B (4, 2): torque of the motor, and torque on the load divided by n."""
        b = np.zeros((4, 2))
        b[1, 0], b[3, 1] = 1.0 / self.motor_inertia_kg_m2, 1.0 / self.reflected_inertia_kg_m2
        return b

    @cached_property
    def plant(self) -> Any:
        """Joint as control.StateSpace.

        Inputs motor_torque and load_torque (at the motor side of the gear); outputs are the four
        states motor_angle, motor_speed, load_angle, load_speed (those of the load times n). Select
        by name, e.g. plant["motor_speed", "motor_torque"].
        """
        import control

        return control.ss(
            self.state_matrix,
            self.input_matrix,
            np.eye(4),
            np.zeros((4, 2)),
            inputs=["motor_torque", "load_torque"],
            outputs=["motor_angle", "motor_speed", "load_angle", "load_speed"],
        )

    @property
    def motor_numerator(self) -> FloatArray:
        """Numerator of motor angle over motor torque, with `denominator`.

        Jlr s^2 + (Del + Dlr) s + Kel, highest power first.
        """
        d = self.elastic_damping_n_m_s_rad + self.reflected_friction_n_m_s_rad
        return np.array([self.reflected_inertia_kg_m2, d, self.stiffness_n_m_rad])

    @property
    def load_numerator(self) -> FloatArray:
        """Numerator of n times the load angle over motor torque, with `denominator`.

        Del s + Kel, highest power first.
        """
        return np.array([self.elastic_damping_n_m_s_rad, self.stiffness_n_m_rad])

    @property
    def denominator(self) -> FloatArray:
        """Denominator of the angles, degree 4, highest power first.

        (Jm s^2 + Dm s)(Jlr s^2 + (Del + Dlr) s + Kel) + (Jlr s^2 + Dlr s)(Del s + Kel).
        """
        motor = np.array([self.motor_inertia_kg_m2, self.motor_friction_n_m_s_rad, 0.0])
        load = np.array([self.reflected_inertia_kg_m2, self.reflected_friction_n_m_s_rad, 0.0])
        return np.asarray(
            np.polyadd(
                np.polymul(motor, self.motor_numerator), np.polymul(load, self.load_numerator)
            )
        )

    @property
    def poles_1_s(self) -> ComplexArray:
        """Poles of the speeds.

        The pole at 0 of the angle is left out (one more is at 0 without any friction).
        """
        return np.asarray(np.roots(self.denominator[:-1]), dtype=np.complex128)

    def check_elastic(self) -> None:
        """Check that the joint oscillates; raises ServoError without a complex pole pair."""
        if not np.any(np.abs(self.poles_1_s.imag) > 0.0):
            raise ServoError(
                f"elastic_damping_n_m_s_rad = {self.elastic_damping_n_m_s_rad} makes a joint that "
                "does not oscillate; must leave a complex pole pair: lower it, or model the joint "
                "as rigid"
            )
