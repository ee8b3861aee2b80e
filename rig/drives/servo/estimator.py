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

from planners.trajectories.pieces import ComplexArray, FloatArray
from rig.drives.servo.block import check_period
from rig.drives.servo.controllability import check_observable, joint_units
from rig.drives.servo.errors import ServoError, check_range
from rig.drives.servo.loops import continuous_equivalents
from rig.drives.servo.riccati import lq_gains, solve_riccati_by_doubling
from rig.drives.servo.state_feedback import (
    MIN_DECAY_REL,
    assign_eigenvalues,
    check_poles,
    sample_units,
    sampled_joint,
    sampled_rates,
)
from rig.drives.servo.two_mass import TwoMass

ENCODER = np.array([1.0, 0.0, 0.0, 0.0])  # C
NOISE_ADVICE = "give the torques more noise, above all the load's, or the encoder fewer counts"


@dataclass(frozen=True, kw_only=True)
class Noise:
    """What a Kalman filter expects: white torques, by two-sided power spectral density, and an encoder's quantisation.

    A torque of standard deviation s held for a period T has the density s^2 T: the default is 0.05 N m at 1 kHz. An encoder of
    step q read every T has q^2 / 12 a sample, so the density q^2 T / 12; that T is for kalman() alone.
    Raises ServoError for values out of bounds; the load's torque, at the motor's side of the gear, may be 0.
    """

    motor_torque_n2_m2_s: float = 2.5e-6
    load_torque_n2_m2_s: float = 2.5e-6
    encoder_counts_per_rev: float = 8192.0
    encoder_period_s: float = 1e-3

    def __post_init__(self) -> None:
        check_range(
            "motor_torque_n2_m2_s",
            self.motor_torque_n2_m2_s,
            1e-18,
            1e12,
            "0.05 N m held 1 ms make 2.5e-6",
        )
        check_range(
            "load_torque_n2_m2_s",
            self.load_torque_n2_m2_s,
            0.0,
            1e12,
            "0.05 N m held 1 ms make 2.5e-6",
        )
        check_range(
            "encoder_counts_per_rev",
            self.encoder_counts_per_rev,
            1.0,
            2.0**40,
            "give all edges, four a line",
        )
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
        _check_gains(self.gains)

    def poles_1_s(self, joint: TwoMass) -> ComplexArray:
        """The four of A - L C, with which the error of the estimate dies out."""
        return np.asarray(
            np.linalg.eigvals(joint.state_matrix - np.outer(self.gains, ENCODER)),
            dtype=np.complex128,
        )

    def sampled(self, joint: TwoMass, period_s: float) -> FloatArray:
        """Gains M (4,) of the filter that predicts exactly, the torque being held, and corrects with the angle of this sample:

            x^ = p + M (qm - C p),   next p = exp(A period) x^ + (effect of the torque held)

        with the error's poles at exp(pole period), so no sample time makes it unstable and no speed makes it lag. Of the
        harmonic drive at 1 kHz M = L period would diverge, and the equation above with its angle held would lag by 0.13 rad at
        200 rad/s, which costs 3 N m. Kalman's gains L estimate to 4e-7 as well (standard deviations) as sampled_kalman(), at
        3 ms to 7e-4; at 1 ms an encoder of 16 bits makes them poles that are out of reach.

        Raises PolesNotAssignable for poles beyond half the sampling, BeyondNyquist for a joint that swings faster than that.
        """
        a, _ = sampled_joint(joint, period_s)
        wanted = check_poles(self.poles_1_s(joint), 4, period_s)
        delta, units = (a - np.eye(4)) / period_s, joint_units(joint)
        rates = -assign_eigenvalues(delta.T, ENCODER, sampled_rates(wanted, period_s), units.dual)
        return np.asarray(np.linalg.solve(a, rates * period_s))


@dataclass(frozen=True)
class SampledEstimator:
    """Gains M (4,) that correct a prediction with the angle of this sample: x^ = p + M (qm - C p), as Estimator.sampled().

    Raises ServoError for gains that are not four, or not finite, and a sample time out of bounds.
    """

    gains: tuple[float, float, float, float]  # 1, 1/s, 1, 1/s
    period_s: float
    deviations: tuple[
        float, float, float, float
    ]  # standard, of x^ under the noise it was designed for: rad, rad/s, rad, rad/s

    def __post_init__(self) -> None:
        _check_gains(self.gains)
        check_period(self.period_s)

    def poles_1_s(self, joint: TwoMass) -> ComplexArray:
        """log(z) / period of exp(A period) (1 - M C), with which the error of the estimate dies out; a pole at z = 0, of an
        encoder that is believed at once, is left out."""
        units = sample_units(self.period_s)
        left = sampled_joint(joint, self.period_s)[0] @ (np.eye(4) - np.outer(self.gains, ENCODER))
        return continuous_equivalents(
            np.linalg.eigvals(left * units.states / units.states[:, None]), self.period_s
        )

    def sampled(self, joint: TwoMass, period_s: float) -> FloatArray:
        """M (4,). Raises ServoError for another sample time than it was designed for."""
        if period_s != self.period_s:
            raise ServoError(
                f"period_s = {period_s:g} for an estimator of {self.period_s:g} s; must be the same: design it for this one"
            )
        return np.array(self.gains)


def assign(
    joint: TwoMass, poles_1_s: Sequence[complex] | ComplexArray, period_s: float | None = None
) -> Estimator:
    """Gains that give the error of the estimate these four poles.

    Raises NotObservable, and PolesNotAssignable for poles that are not conjugate, not four, not in the left half plane, or, with
    a sample time, beyond half the sampling.
    """
    wanted, units = check_poles(poles_1_s, 4, period_s), joint_units(joint)
    check_observable(joint.state_matrix, ENCODER, units)
    return _estimator(-assign_eigenvalues(joint.state_matrix.T, ENCODER, wanted, units.dual))


def kalman(joint: TwoMass, noise: Noise | None = None) -> Estimator:
    """Gains of the least variance of every state (Kalman and Bucy 1961).

    Raises NotObservable; ServoError for torques and readings so unlike in noise that rounding decides the gains.
    """
    noise, units = noise or Noise(), joint_units(joint)
    check_observable(joint.state_matrix, ENCODER, units)
    spread = joint.input_matrix @ noise.torques @ joint.input_matrix.T
    density = noise.angle_rad2 * noise.encoder_period_s
    return _estimator(
        lq_gains(
            joint.state_matrix.T, ENCODER, spread, density, units.dual, str(noise), NOISE_ADVICE
        )
    )


def sampled_kalman(joint: TwoMass, noise: Noise, period_s: float) -> SampledEstimator:
    """Gains of the least variance at the samples, with one reading a sample (Kalman 1960). For an encoder of any resolution.

    Raises NotObservable, BeyondNyquist for a joint that swings faster than half the sampling, ServoError for a sample time out
    of bounds and when an error of the estimate would not die out.
    """
    check_observable(joint.state_matrix, ENCODER, joint_units(joint))
    a, _ = sampled_joint(joint, period_s)
    units, angle = sample_units(period_s), noise.angle_rad2
    a, lost = (
        a * units.states / units.states[:, None],
        f"{noise} leaves no gains within floating point: {NOISE_ADVICE}",
    )
    try:
        with np.errstate(all="ignore"):
            prior = solve_riccati_by_doubling(
                a.T, np.outer(ENCODER, ENCODER) / angle, _added(joint, noise, period_s)
            )
            gains = prior[:, 0] / (prior[0, 0] + angle)
            keep = np.eye(4) - np.outer(gains, ENCODER)
            variance = np.diag(keep @ prior @ keep.T + angle * np.outer(gains, gains))
            largest = float(np.max(np.abs(np.linalg.eigvals(a @ keep))))
    except np.linalg.LinAlgError:
        raise ServoError(lost) from None
    if not np.all(variance >= 0.0):
        raise ServoError(lost)
    if not largest < 1.0 - MIN_DECAY_REL:
        raise ServoError(
            f"{noise} leaves {largest:.12g} of an error after a sample; must be < 1 - {MIN_DECAY_REL:g}: {NOISE_ADVICE}"
        )
    return SampledEstimator(
        _four(gains * units.states), period_s, _four(np.sqrt(variance) * units.states)
    )


def _added(joint: TwoMass, noise: Noise, period_s: float) -> FloatArray:
    """(4, 4) what the torques' noise adds to the variance in a sample, in sample units: the integral over it of
    exp(A t) B N B^T exp(A^T t), as one linear system. Van Loan's (1978) would grow with the fastest pole."""
    from scipy.linalg import expm

    units, one = sample_units(period_s), np.eye(4)
    a, b = units.matrix(joint.state_matrix), joint.input_matrix / units.states[:, None]
    whole = np.zeros((17, 17))
    whole[:-1, :-1] = np.kron(a, one) + np.kron(one, a)
    whole[:-1, -1] = (b @ noise.torques @ b.T * period_s).ravel()
    return np.asarray(expm(whole))[:-1, -1].reshape(4, 4)


def _estimator(column: Any) -> Estimator:
    return Estimator(_four(column))


def _four(column: Any) -> tuple[float, float, float, float]:
    a, b, c, d = (float(value) for value in column)
    return a, b, c, d


def _check_gains(gains: tuple[float, ...]) -> None:
    if len(gains) != 4 or not all(map(math.isfinite, gains)):
        raise ServoError(f"gains = {gains}; must be four, all finite")
