"""Low-pass filter Q and nominal model of a disturbance observer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from planners.trajectories.pieces import ComplexArray, FloatArray
from rig.drives.servo.errors import Improper, ServoError, check_datum, check_range
from rig.drives.servo.two_mass import TwoMass

MAX_FILTER_ORDER = 8
Kind = Literal["binomial", "butterworth"]
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
    """Nominal model Pn of the plant, any proper transfer function; highest power first.

    Of a motor, its speed over its torque; of any other plant, the measured signal over its input.
    Leading zeros are removed. Raises ServoError for coefficients that are not finite, a numerator
    or denominator of 0, and a zero that is not in the left half plane, as the observer inverts the
    model; Improper for more zeros than poles.
    """

    numerator: FloatArray
    denominator: FloatArray

    def __post_init__(self) -> None:
        for name in ("numerator", "denominator"):
            object.__setattr__(self, name, _coefficients(name, getattr(self, name)))
        if self.relative_degree < 0:
            raise Improper(
                f"a nominal model with a numerator of degree {self.numerator.size - 1} and a "
                f"denominator of degree {self.denominator.size - 1}; must be proper: add poles"
            )
        for zero_1_s in np.roots(self.numerator):
            if not zero_1_s.real < 0.0:
                raise ServoError(
                    f"a nominal model with a zero at {complex(zero_1_s):.6g} 1/s; every zero must "
                    "have a real part < 0, otherwise the inverse never settles: leave the zero "
                    "out of the model"
                )

    @classmethod
    def of(cls, system: Any) -> Nominal:
        """Take a continuous control.TransferFunction with one input and one output.

        Raises ServoError for another system, and as the class does.
        """
        import control

        if not isinstance(system, control.TransferFunction):
            raise ServoError(
                f"a nominal model of type {type(system).__name__}; must be a "
                "control.TransferFunction: convert it with control.tf"
            )
        if system.ninputs != 1 or system.noutputs != 1 or system.dt:
            raise ServoError(
                f"a nominal model of {system.ninputs} inputs and {system.noutputs} outputs with "
                f"sample time {system.dt}; must have one of each and be continuous: select one "
                "channel of the continuous model"
            )
        return cls(np.asarray(system.num[0][0]), np.asarray(system.den[0][0]))

    @property
    def relative_degree(self) -> int:
        """Degree of the denominator minus that of the numerator."""
        return self.denominator.size - self.numerator.size

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

    def is_plant(self, plant: TwoMass | Nominal) -> bool:
        """Compare with a plant, with the elastic model of a joint; True if they are equal."""
        numerator, denominator = coefficients(plant)
        pairs = ((self.numerator, numerator), (self.denominator, denominator))
        return all(
            a.shape == b.shape and np.allclose(a, b, rtol=SAME_COEFFICIENT_REL, atol=0.0)
            for a, b in pairs
        )


def coefficients(plant: TwoMass | Nominal) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator of a plant.

    Of a joint those of the motor speed: the pole at 0 of the angle is left out.
    """
    if isinstance(plant, TwoMass):
        return plant.motor_numerator, plant.denominator[:-1]
    return plant.numerator, plant.denominator


def _coefficients(name: str, values: Any) -> FloatArray:
    """Check a polynomial and remove its leading zeros."""
    found = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if found.ndim != 1 or not np.all(np.isfinite(found)):
        raise ServoError(
            f"{name} = {values} of a nominal model; must be finite numbers, highest power first: "
            "correct it"
        )
    trimmed = np.trim_zeros(found, "f")
    if not trimmed.size:
        raise ServoError(f"{name} = {values} of a nominal model; must not be 0: correct it")
    return trimmed
