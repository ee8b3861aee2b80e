"""State observer on the encoder: Luenberger by assigned poles, or Kalman filter by noise.

    x^' = A x^ + B u + L (qm - C x^)

Source 001 (state reconstruction) writes A + L C: its L has the other sign. Coulomb friction is not
a known input: it counts as noise.
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

ENCODER = np.array([1.0, 0.0, 0.0, 0.0])  # C of qm = C x
NOISE_ADVICE = "raise the noise of the torques, first that on the load, or lower the encoder counts"


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Noise model of a Kalman filter: white torques and the quantisation of an encoder.

    Torques by two-sided power spectral density. A torque of standard deviation s held for a period
    T has the density s^2 T: the default is 0.05 N m at 1 kHz. An encoder of step q read every T has
    the variance q^2 / 12 per sample, so the density q^2 T / 12; that T is for kalman() alone.
    Raises ServoError for values out of bounds; the torque on the load, at the motor side of the
    gear, may be 0.
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
            "count all edges, four per line",
        )
        check_period(self.encoder_period_s)

    @property
    def torques(self) -> FloatArray:
        """Density (2, 2) of the torques on motor and load."""
        return np.diag([self.motor_torque_n2_m2_s, self.load_torque_n2_m2_s])

    @property
    def angle_rad2(self) -> float:
        """Variance of one encoder reading."""
        return float((2.0 * math.pi / self.encoder_counts_per_rev) ** 2 / 12.0)


@dataclass(frozen=True)
class Estimator:
    """Gains L (4,) on encoder angle minus estimated angle.

    Raises ServoError for gains that are not four, or not finite.
    """

    gains: tuple[float, float, float, float]  # 1/s, 1/s2, 1/s, 1/s2

    def __post_init__(self) -> None:
        _check_gains(self.gains)

    def poles_1_s(self, joint: TwoMass) -> ComplexArray:
        """Compute the four poles of A - L C, those of the estimation error."""
        return np.asarray(
            np.linalg.eigvals(joint.state_matrix - np.outer(self.gains, ENCODER)),
            dtype=np.complex128,
        )

    def sampled(self, joint: TwoMass, period_s: float) -> FloatArray:
        """Compute the gains M (4,) of the equivalent sampled filter.

        It predicts exactly, the torque being held, and corrects with the angle of this sample:

            x^ = p + M (qm - C p),   next p = exp(A period) x^ + (effect of the torque held)

        The poles of the error are at exp(pole period), so the filter is stable at any sample time
        and has no lag at constant speed. For comparison, with the harmonic drive at 1 kHz, M = L
        period diverges, and the equation of the module with its angle held lags by 0.13 rad at 200
        rad/s, which costs 3 N m. With the gains L of a Kalman filter the standard deviations of the
        estimate exceed those of sampled_kalman() by 4e-7, at 3 ms by 7e-4 (relative). At 1 ms an
        encoder of 16 bits makes their poles too fast to assign.

        Raises PolesNotAssignable for poles at or above the Nyquist frequency, BeyondNyquist for a
        joint with such a resonance.
        """
        a, _ = sampled_joint(joint, period_s)
        wanted = check_poles(self.poles_1_s(joint), 4, period_s)
        delta, units = (a - np.eye(4)) / period_s, joint_units(joint)
        rates = -assign_eigenvalues(delta.T, ENCODER, sampled_rates(wanted, period_s), units.dual)
        return np.asarray(np.linalg.solve(a, rates * period_s))


@dataclass(frozen=True)
class SampledEstimator:
    """Gains M (4,) that correct a prediction with the angle of this sample.

    x^ = p + M (qm - C p), see Estimator.sampled(). Raises ServoError for gains that are not four,
    or not finite, and for a sample time out of bounds.
    """

    gains: tuple[float, float, float, float]  # 1, 1/s, 1, 1/s
    period_s: float
    # standard deviations of x^ under the noise of the design: rad, rad/s, rad, rad/s
    deviations: tuple[float, float, float, float]

    def __post_init__(self) -> None:
        _check_gains(self.gains)
        check_period(self.period_s)

    def poles_1_s(self, joint: TwoMass) -> ComplexArray:
        """Compute the poles log(z) / period of the estimation error, exp(A period) (1 - M C).

        A pole at z = 0 (a gain of 1 on the encoder angle) is left out.
        """
        units = sample_units(self.period_s)
        a, _ = sampled_joint(joint, self.period_s)
        error_matrix = a @ (np.eye(4) - np.outer(self.gains, ENCODER))
        return continuous_equivalents(
            np.linalg.eigvals(error_matrix * units.states / units.states[:, None]), self.period_s
        )

    def sampled(self, joint: TwoMass, period_s: float) -> FloatArray:
        """Return the gains M (4,).

        Raises ServoError for another sample time than that of the design.
        """
        if period_s != self.period_s:
            raise ServoError(
                f"period_s = {period_s:g} for an estimator of {self.period_s:g} s; must be the "
                "same: design the estimator for this sample time"
            )
        return np.array(self.gains)


def assign(
    joint: TwoMass, poles_1_s: Sequence[complex] | ComplexArray, period_s: float | None = None
) -> Estimator:
    """Design an Estimator by the four poles of the estimation error.

    Raises NotObservable. Raises PolesNotAssignable for poles that are not conjugate, not four, not
    in the left half plane, or, with a sample time, at or above the Nyquist frequency.
    """
    wanted, units = check_poles(poles_1_s, 4, period_s), joint_units(joint)
    check_observable(joint.state_matrix, ENCODER, units)
    return _estimator(-assign_eigenvalues(joint.state_matrix.T, ENCODER, wanted, units.dual))


def kalman(joint: TwoMass, noise: Noise | None = None) -> Estimator:
    """Design the Estimator with the least variance of every state (Kalman and Bucy 1961).

    Raises NotObservable; ServoError for noise of torques and encoder so far apart that rounding
    decides the gains.
    """
    noise, units = noise or Noise(), joint_units(joint)
    check_observable(joint.state_matrix, ENCODER, units)
    torque_noise = joint.input_matrix @ noise.torques @ joint.input_matrix.T
    density = noise.angle_rad2 * noise.encoder_period_s
    return _estimator(
        lq_gains(
            joint.state_matrix.T,
            ENCODER,
            torque_noise,
            density,
            units.dual,
            str(noise),
            NOISE_ADVICE,
        )
    )


def sampled_kalman(joint: TwoMass, noise: Noise, period_s: float) -> SampledEstimator:
    """Design the sampled filter of least variance, one reading per sample (Kalman 1960).

    For an encoder of any resolution. Raises NotObservable; BeyondNyquist for a joint with a
    resonance at or above the Nyquist frequency; ServoError for a sample time out of bounds and for
    an estimation error that would not decay.
    """
    check_observable(joint.state_matrix, ENCODER, joint_units(joint))
    a, _ = sampled_joint(joint, period_s)
    units, angle = sample_units(period_s), noise.angle_rad2
    a = a * units.states / units.states[:, None]
    refusal = f"{noise} has no gains within floating point: {NOISE_ADVICE}"
    try:
        with np.errstate(all="ignore"):
            prior = solve_riccati_by_doubling(
                a.T, np.outer(ENCODER, ENCODER) / angle, _process_noise(joint, noise, period_s)
            )
            gains = prior[:, 0] / (prior[0, 0] + angle)
            keep = np.eye(4) - np.outer(gains, ENCODER)
            variance = np.diag(keep @ prior @ keep.T + angle * np.outer(gains, gains))
            largest = float(np.max(np.abs(np.linalg.eigvals(a @ keep))))
    except np.linalg.LinAlgError:
        raise ServoError(refusal) from None
    if not np.all(variance >= 0.0):
        raise ServoError(refusal)
    if not largest < 1.0 - MIN_DECAY_REL:
        raise ServoError(
            f"{noise} leaves {largest:.12g} of an error after a sample; "
            f"must be < 1 - {MIN_DECAY_REL:g}: {NOISE_ADVICE}"
        )
    return SampledEstimator(
        _four_floats(gains * units.states), period_s, _four_floats(np.sqrt(variance) * units.states)
    )


def _process_noise(joint: TwoMass, noise: Noise, period_s: float) -> FloatArray:
    """Compute the variance (4, 4) that the noise of the torques adds in a sample, in sample units.

    The integral over the sample of exp(A t) B N B^T exp(A^T t), as one linear system. The method of
    Van Loan (1978) would grow with the fastest pole.
    """
    from scipy.linalg import expm

    units, one = sample_units(period_s), np.eye(4)
    a, b = units.matrix(joint.state_matrix), joint.input_matrix / units.states[:, None]
    system = np.zeros((17, 17))
    system[:-1, :-1] = np.kron(a, one) + np.kron(one, a)
    system[:-1, -1] = (b @ noise.torques @ b.T * period_s).ravel()
    return np.asarray(expm(system))[:-1, -1].reshape(4, 4)


def _estimator(column: Any) -> Estimator:
    return Estimator(_four_floats(column))


def _four_floats(column: Any) -> tuple[float, float, float, float]:
    a, b, c, d = (float(value) for value in column)
    return a, b, c, d


def _check_gains(gains: tuple[float, ...]) -> None:
    if len(gains) != 4 or not all(map(math.isfinite, gains)):
        raise ServoError(f"gains = {gains}; must be four, all finite")
