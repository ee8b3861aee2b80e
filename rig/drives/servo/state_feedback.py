"""State feedback with integral action for an elastic joint: pole placement or LQ.

    z = [qm, qm', n ql, n ql', xI],  xI' = reference - qm,  z' = F z + G u,  u = +K x + kI xI

(source 001, integral action). With one input the eigenvalues determine the gains. Ackermann's
formula is used, in units in which it is well conditioned; it also assigns repeated eigenvalues,
which the robust methods for several inputs refuse.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from planners.trajectories.pieces import ComplexArray, FloatArray
from rig.drives.servo.block import check_period
from rig.drives.servo.controllability import Units, check_controllable, joint_units
from rig.drives.servo.errors import PolesNotAssignable, ServoError, check_below_nyquist, check_range
from rig.drives.servo.loops import LoopAnalysis, analyse_loop
from rig.drives.servo.riccati import lq_gains
from rig.drives.servo.two_mass import TwoMass

MIN_DECAY_REL = 1e-9  # real part of the slowest over the fastest pole; below it is rounding
# entry of A period in sample units; above it the exponential is wrong in its seventh digit
MAX_SAMPLED_ENTRY = 1e9


@dataclass(frozen=True)
class Feedback:
    """Gains with the sign of source 001, u = +K x + kI xI.

    lqr routines return gains for u = -K z, so the `K = lqr(...)` of the source lacks a minus
    (erratum of its LQ slide). Raises ServoError for gains that are not four, or not finite.
    """

    gains: tuple[float, float, float, float]  # K: N m/rad, N m s/rad, N m/rad, N m s/rad
    integral_gain_n_m_rad_s: float  # kI

    def __post_init__(self) -> None:
        if len(self.gains) != 4 or not all(
            map(math.isfinite, (*self.gains, self.integral_gain_n_m_rad_s))
        ):
            raise ServoError(
                f"gains = {self.gains}, {self.integral_gain_n_m_rad_s}; "
                "must be four and one, all finite"
            )

    @property
    def row(self) -> FloatArray:
        """Row [K, kI] (5,)."""
        return np.array([*self.gains, self.integral_gain_n_m_rad_s])

    def poles_1_s(self, joint: TwoMass) -> ComplexArray:
        """Compute the five poles of F + G [K, kI]."""
        f, g = augmented(joint)
        return np.asarray(np.linalg.eigvals(f + np.outer(g, self.row)), dtype=np.complex128)

    def analyse(self, joint: TwoMass) -> LoopAnalysis:
        """Analyse the loop with every state measured.

        Opened at the motor torque, closed from reference to motor angle.
        """
        import control

        f, g = augmented(joint)
        opened = control.ss(f, g[:, None], -self.row, 0.0)
        closed = control.ss(f + np.outer(g, self.row), np.eye(5)[:, 4:], np.eye(5)[:1], 0.0)
        return analyse_loop(opened, closed)

    def sampled(self, joint: TwoMass, period_s: float) -> Feedback:
        """Compute the gains that give the sampled joint the same poles, at exp(pole period).

        The torque is held, and xI += period (reference - qm). The loop is stable at any sample
        time. The gains tend to the continuous ones as the period tends to 0.

        Raises PolesNotAssignable for poles at or above the Nyquist frequency, BeyondNyquist for a
        joint with such a resonance.
        """
        f, g = sampled_joint(joint, period_s)
        delta, column = np.zeros((5, 5)), np.append(g / period_s, 0.0)
        delta[:4, :4] = (f - np.eye(4)) / period_s
        delta[4, 0] = -1.0
        wanted = check_poles(self.poles_1_s(joint), 5, period_s)
        return _feedback(
            assign_eigenvalues(
                delta, column, sampled_rates(wanted, period_s), augmented_units(joint)
            )
        )


def augmented(joint: TwoMass) -> tuple[FloatArray, FloatArray]:
    """Build F (5, 5) and G (5,): the joint with the integral of reference - qm as fifth state."""
    f = np.zeros((5, 5))
    f[:4, :4] = joint.state_matrix
    f[4, 0] = -1.0
    return f, np.append(joint.input_matrix[:, 0], 0.0)


def augmented_units(joint: TwoMass) -> Units:
    """Choose the units of the joint, and rad times the unit of time for the integral."""
    units = joint_units(joint)
    return Units(np.append(units.states, 1.0 / units.rate_1_s), units.rate_1_s)


def sampled_joint(joint: TwoMass, period_s: float) -> tuple[FloatArray, FloatArray]:
    """Compute exp(A period) (4, 4) and the effect (4,) of a motor torque held for a period.

    Raises ServoError for a sample time out of bounds or too long for the joint in floating point,
    BeyondNyquist for a joint with a resonance at or above the Nyquist frequency.
    """
    from scipy.linalg import expm

    check_period(period_s)
    fastest_rad_s = float(np.max(np.abs(joint.poles_1_s.imag)))
    check_below_nyquist(
        "resonance of the joint",
        fastest_rad_s,
        period_s,
        "reduce the sample time, or model the joint as rigid",
    )
    units, extended = sample_units(period_s), np.zeros((5, 5))
    extended[:4, :4] = units.matrix(joint.state_matrix)
    extended[:4, 4] = joint.input_matrix[:, 0] / units.states / units.rate_1_s
    largest = float(np.max(np.abs(extended[:4, :4])))
    if not largest <= MAX_SAMPLED_ENTRY:
        fastest_1_s = float(np.max(np.abs(joint.poles_1_s)))
        raise ServoError(
            f"period_s = {period_s:g} for a joint with a pole at -{fastest_1_s:.3g} 1/s: the "
            f"largest entry of its sampled equations is {largest:.3g}; must be <= "
            f"{MAX_SAMPLED_ENTRY:g} for floating point: reduce the sample time, lower the damping, "
            "or model the joint as rigid"
        )
    after = np.asarray(expm(extended))[:4]
    return after[:, :4] * units.states[:, None] / units.states, after[:, 4] * units.states


def sample_units(period_s: float) -> Units:
    """Choose angles in rad, speeds in rad per sample, time in samples."""
    return Units(np.array([1.0, 1.0 / period_s, 1.0, 1.0 / period_s]), 1.0 / period_s)


def assign(
    joint: TwoMass, poles_1_s: Sequence[complex] | ComplexArray, period_s: float | None = None
) -> Feedback:
    """Design the gains that give the joint with integral action these five poles.

    Raises NotControllable. Raises PolesNotAssignable for poles that are not conjugate, not five,
    not in the left half plane, or, with a sample time, at or above the Nyquist frequency.
    """
    f, g = augmented(joint)
    wanted, units = check_poles(poles_1_s, 5, period_s), augmented_units(joint)
    check_controllable(f, g, units)
    return _feedback(assign_eigenvalues(f, g, wanted, units))


def lq(
    joint: TwoMass, weights: Sequence[float] | FloatArray, torque_weight: float = 1.0
) -> Feedback:
    """Design the gains that minimise the integral of sum_i weights_i z_i^2 + torque_weight u^2.

    Source 001, optimal LQ control. Raises NotControllable. Raises ServoError unless weights (5,)
    are >= 0 and finite with that of the integral > 0 (without it the integral state would not
    decay), and for weights so far apart that rounding decides the gains.
    """
    q = np.asarray(weights, dtype=np.float64)
    if q.shape != (5,) or not (np.all(np.isfinite(q)) and np.all(q >= 0.0) and q[4] > 0.0):
        raise ServoError(
            f"weights = {q.tolist()}; must be five for qm, qm', n ql, n ql' and the integral, "
            "all >= 0 and the last > 0: start with those of the angles and of the integral"
        )
    check_range("torque_weight", torque_weight, 1e-12, 1e12, "use 1 and scale the weights")
    f, g = augmented(joint)
    units = augmented_units(joint)
    check_controllable(f, g, units)
    given = f"weights = {q.tolist()}, torque_weight = {torque_weight}"
    return _feedback(
        -lq_gains(
            f, g, np.diag(q), torque_weight, units, given, "bring the weights closer together"
        )
    )


def check_poles(
    poles_1_s: Sequence[complex] | ComplexArray, count: int, period_s: float | None = None
) -> ComplexArray:
    """Convert poles to an array and check them.

    Raises PolesNotAssignable for poles that no real gains assign, that are unstable, or that are
    too fast for the sample time.
    """
    wanted = np.asarray(poles_1_s, dtype=np.complex128)
    if wanted.shape != (count,):
        raise PolesNotAssignable(
            f"poles of shape {wanted.shape}; must be ({count},), one per state: add or remove some"
        )
    least_1_s = -MIN_DECAY_REL * float(np.max(np.abs(wanted)))
    for pole in wanted.tolist():
        if not (math.isfinite(abs(pole)) and pole.real < least_1_s):
            raise PolesNotAssignable(
                f"a pole at {pole:.6g} 1/s; must be finite, its real part < {least_1_s:.3g}: "
                "choose a pole that decays"
            )
        if _count(wanted, pole.conjugate()) != _count(wanted, pole):
            raise PolesNotAssignable(
                f"a pole at {pole:.6g} 1/s without its conjugate; complex poles must be conjugate "
                "pairs: add the conjugate pole"
            )
        if period_s is not None and not abs(pole) < math.pi / period_s:
            raise PolesNotAssignable(
                f"a pole at {pole:.6g} 1/s with a sample time of {period_s:g} s; its absolute "
                f"value must be < {math.pi / period_s:.6g}, the Nyquist frequency: choose slower "
                "poles or reduce the sample time"
            )
    return wanted


def sampled_rates(poles_1_s: ComplexArray, period_s: float) -> ComplexArray:
    """Compute (exp(p period) - 1) / period, eigenvalues of (sampled state matrix - 1) / period.

    That matrix tends to the continuous one as the period tends to 0.
    """
    return np.asarray(np.expm1(poles_1_s * period_s) / period_s, dtype=np.complex128)


def assign_eigenvalues(
    a: FloatArray, b: FloatArray, eigenvalues: ComplexArray, units: Units
) -> FloatArray:
    """Compute k (n,) such that a + b k has these eigenvalues (Ackermann 1972).

    Computed in the units given.
    """
    scaled, column = units.matrix(a), b / units.states / units.rate_1_s
    krylov = [column]
    for _ in range(len(a) - 1):
        krylov.append(scaled @ krylov[-1])
    wanted = np.zeros_like(scaled)
    for coefficient in np.real(np.poly(eigenvalues / units.rate_1_s)):
        wanted = wanted @ scaled + coefficient * np.eye(len(a))
    # last row of the inverse of the controllability matrix
    last = np.linalg.solve(np.array(krylov), np.eye(len(a))[-1])
    return np.asarray(-(last @ wanted) / units.states)


def _count(poles_1_s: ComplexArray, pole: complex) -> int:
    return int(np.sum(np.abs(poles_1_s - pole) <= MIN_DECAY_REL * abs(pole)))


def _feedback(row: Any) -> Feedback:
    k = [float(gain) for gain in row]
    return Feedback((k[0], k[1], k[2], k[3]), k[4])
