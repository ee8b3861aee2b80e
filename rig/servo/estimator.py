"""What the drive knows of states it does not measure: an observer behind the encoder, by eigenvalues or by noise (Kalman).

    x^' = A x^ + B u + L (qm - C x^)         (source 001, state reconstruction, with A + L C: its L has the other sign)

Coulomb friction is not among the known inputs: it counts as noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from planners.pieces import ComplexArray, FloatArray
from rig.servo.block import check_period
from rig.servo.errors import ServoError, check_range
from rig.servo.reachability import check_observable, own_units
from rig.servo.state_feedback import assign_eigenvalues, check_poles, sampled_joint, sampled_rates
from rig.servo.two_mass import TwoMass

ENCODER = np.array([1.0, 0.0, 0.0, 0.0])  # C


@dataclass(frozen=True, kw_only=True)
class Noise:
    """What a Kalman filter expects: white torques, by two-sided power spectral density, and an encoder's quantisation.

    A torque of standard deviation s held for a period T has the density s^2 T: the default is 0.05 N m at 1 kHz. An encoder of
    step q read every T has q^2 / 12 a sample, so the density q^2 T / 12.
    Raises ServoError for values out of bounds; the load's torque, at the motor's side of the gear, may be 0.
    """

    motor_torque_n2_m2_s: float = 2.5e-6
    load_torque_n2_m2_s: float = 2.5e-6
    encoder_counts_per_rev: float = 8192.0
    encoder_period_s: float = 1e-3

    def __post_init__(self) -> None:
        check_range("motor_torque_n2_m2_s", self.motor_torque_n2_m2_s, 1e-18, 1e12, "0.05 N m held 1 ms make 2.5e-6")
        check_range("load_torque_n2_m2_s", self.load_torque_n2_m2_s, 0.0, 1e12, "0.05 N m held 1 ms make 2.5e-6")
        check_range("encoder_counts_per_rev", self.encoder_counts_per_rev, 1.0, 1e9, "give all edges, four a line")
        check_period(self.encoder_period_s)

    @property
    def torques(self) -> FloatArray:
        """(2, 2) density of motor and load torque."""
        return np.diag([self.motor_torque_n2_m2_s, self.load_torque_n2_m2_s])

    @property
    def angle_rad2(self) -> float:
        """Variance of one reading."""
        return float((2.0 * math.pi / self.encoder_counts_per_rev) ** 2 / 12.0)


@dataclass(frozen=True)
class Estimator:
    """Gains L (4,) on encoder minus estimated angle. Raises ServoError for gains that are not four, or not finite."""

    gains: tuple[float, float, float, float]  # 1/s, 1/s2, 1/s, 1/s2

    def __post_init__(self) -> None:
        if len(self.gains) != 4 or not all(map(math.isfinite, self.gains)):
            raise ServoError(f"gains = {self.gains}; must be four, all finite")

    def poles_1_s(self, joint: TwoMass) -> ComplexArray:
        """The four of A - L C, with which the error of the estimate dies out."""
        return np.asarray(np.linalg.eigvals(joint.state_matrix - np.outer(self.gains, ENCODER)), dtype=np.complex128)

    def sampled(self, joint: TwoMass, period_s: float) -> FloatArray:
        """Gains M (4,) of the filter that predicts exactly, the torque being held, and corrects with the angle of this sample:

            x^ = p + M (qm - C p),   next p = exp(A period) x^ + (effect of the torque held)

        with the error's poles at exp(pole period), so no sample time makes it unstable and no speed makes it lag. Its variance
        is that of the discrete Kalman filter to 1e-6 (harmonic drive, 1 kHz). There M = L period would diverge, and the
        equation above with its angle held would lag by 0.13 rad at 200 rad/s, which costs 3 N m.

        Raises PolesOutOfReach for poles beyond half the sampling, BeyondNyquist for a joint that swings faster than that.
        """
        a, _ = sampled_joint(joint, period_s)
        wanted = check_poles(self.poles_1_s(joint), 4, period_s)
        delta, units = (a - np.eye(4)) / period_s, own_units(joint)
        rates = -assign_eigenvalues(delta.T, ENCODER, sampled_rates(wanted, period_s), units.dual)
        return np.asarray(np.linalg.solve(a, rates * period_s))


def assign(joint: TwoMass, poles_1_s: Sequence[complex] | ComplexArray, period_s: float | None = None) -> Estimator:
    """Gains that give the error of the estimate these four poles.

    Raises NotObservable, and PolesOutOfReach for poles that are not conjugate, not four, not in the left half plane, or, with
    a sample time, beyond half the sampling.
    """
    wanted, units = check_poles(poles_1_s, 4, period_s), own_units(joint)
    check_observable(joint.state_matrix, ENCODER, units)
    return _estimator(-assign_eigenvalues(joint.state_matrix.T, ENCODER, wanted, units.dual))


def kalman(joint: TwoMass, noise: Noise | None = None) -> Estimator:
    """Gains of the least variance of every state (Kalman and Bucy 1961). Raises NotObservable."""
    import control

    noise = noise or Noise()
    check_observable(joint.state_matrix, ENCODER, own_units(joint))
    density = noise.angle_rad2 * noise.encoder_period_s
    gains, _, _ = control.lqe(joint.state_matrix, joint.input_matrix, ENCODER[None], noise.torques, density)
    return _estimator(np.asarray(gains)[:, 0])


def _estimator(column: Any) -> Estimator:
    a, b, c, d = (float(gain) for gain in column)
    return Estimator((a, b, c, d))
