"""State feedback with integral action for an elastic joint: by eigenvalues that are asked for, or by a quadratic cost.

    z = [qm, qm', n ql, n ql', xI],  xI' = reference - qm,  z' = F z + G u,  u = +K x + kI xI     (source 001, integral action)

One input leaves no freedom: the eigenvalues decide the gains. Ackermann's formula serves, in units in which it is well
conditioned; it assigns repeated eigenvalues as well, which the robust methods for several inputs refuse.
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

MIN_DECAY_REL = (
    1e-9  # real part of the slowest pole to be had, as a share of the fastest: below it is rounding
)
MAX_SAMPLED_ENTRY = 1e9  # of A period in sample units: the exponential of a larger one is rounding in its seventh digit


@dataclass(frozen=True)
class Feedback:
    """Gains with the source's sign, u = +K x + kI xI; lqr routines return them for u = -K z, so the source's
    `K = lqr(...)` lacks a minus (erratum of its LQ slide).

    Raises ServoError for gains that are not four, or not finite.
    """

    gains: tuple[float, float, float, float]  # K: N m/rad, N m s/rad, N m/rad, N m s/rad
    integral_gain_n_m_rad_s: float  # kI

    def __post_init__(self) -> None:
        if len(self.gains) != 4 or not all(
            map(math.isfinite, (*self.gains, self.integral_gain_n_m_rad_s))
        ):
            raise ServoError(
                f"gains = {self.gains}, {self.integral_gain_n_m_rad_s}; must be four and one, all finite"
            )

    @property
    def row(self) -> FloatArray:
        """[K, kI] (5,)."""
        return np.array([*self.gains, self.integral_gain_n_m_rad_s])

    def poles_1_s(self, joint: TwoMass) -> ComplexArray:
        """The five of F + G [K, kI]."""
        f, g = augmented(joint)
        return np.asarray(np.linalg.eigvals(f + np.outer(g, self.row)), dtype=np.complex128)

    def analyse(self, joint: TwoMass) -> LoopAnalysis:
        """With every state measured: opened at the motor's torque, closed from reference to motor angle."""
        import control

        f, g = augmented(joint)
        opened = control.ss(f, g[:, None], -self.row, 0.0)
        closed = control.ss(f + np.outer(g, self.row), np.eye(5)[:, 4:], np.eye(5)[:1], 0.0)
        return analyse_loop(opened, closed)

    def sampled(self, joint: TwoMass, period_s: float) -> Feedback:
        """The gains that give the sampled joint, its torque held, the same poles, at exp(pole period), with
        xI += period (reference - qm): no sample time makes it unstable. They tend to these as the period shrinks.

        Raises PolesNotAssignable for poles beyond half the sampling, BeyondNyquist for a joint that swings faster than that.
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
    """F (5, 5) and G (5,) of the joint with the integral of reference - qm as fifth state."""
    f = np.zeros((5, 5))
    f[:4, :4] = joint.state_matrix
    f[4, 0] = -1.0
    return f, np.append(joint.input_matrix[:, 0], 0.0)


def augmented_units(joint: TwoMass) -> Units:
    """The joint's own units, and rad times the unit of time for the integral."""
    units = joint_units(joint)
    return Units(np.append(units.states, 1.0 / units.rate_1_s), units.rate_1_s)


def sampled_joint(joint: TwoMass, period_s: float) -> tuple[FloatArray, FloatArray]:
    """exp(A period) (4, 4) and the effect (4,) of a motor torque held for a period.

    Raises ServoError for a sample time out of bounds or too long for the joint in floating point, BeyondNyquist when the joint
    swings faster than half the sampling.
    """
    from scipy.linalg import expm

    check_period(period_s)
    fastest_rad_s = float(np.max(np.abs(joint.poles_1_s.imag)))
    check_below_nyquist(
        "the joint's resonance",
        fastest_rad_s,
        period_s,
        "sample faster, or treat the joint as rigid",
    )
    units, whole = sample_units(period_s), np.zeros((5, 5))
    whole[:4, :4] = units.matrix(joint.state_matrix)
    whole[:4, 4] = joint.input_matrix[:, 0] / units.states / units.rate_1_s
    largest = float(np.max(np.abs(whole[:4, :4])))
    if not largest <= MAX_SAMPLED_ENTRY:
        fastest_1_s = float(np.max(np.abs(joint.poles_1_s)))
        raise ServoError(
            f"period_s = {period_s:g} for a joint with a pole at -{fastest_1_s:.3g} 1/s: the largest entry of its sampled "
            f"equations is {largest:.3g}; must be <= {MAX_SAMPLED_ENTRY:g} to hold in floating point: "
            "sample faster, lower its damping, or treat it as rigid"
        )
    after = np.asarray(expm(whole))[:4]
    return after[:, :4] * units.states[:, None] / units.states, after[:, 4] * units.states


def sample_units(period_s: float) -> Units:
    """Angles in rad, speeds in rad a sample, time in samples."""
    return Units(np.array([1.0, 1.0 / period_s, 1.0, 1.0 / period_s]), 1.0 / period_s)


def assign(
    joint: TwoMass, poles_1_s: Sequence[complex] | ComplexArray, period_s: float | None = None
) -> Feedback:
    """Gains that give the joint with its integrator these five poles.

    Raises NotControllable, and PolesNotAssignable for poles that are not conjugate, not five, not in the left half plane, or, with a
    sample time, beyond half the sampling.
    """
    f, g = augmented(joint)
    wanted, units = check_poles(poles_1_s, 5, period_s), augmented_units(joint)
    check_controllable(f, g, units)
    return _feedback(assign_eigenvalues(f, g, wanted, units))


def lq(
    joint: TwoMass, weights: Sequence[float] | FloatArray, torque_weight: float = 1.0
) -> Feedback:
    """Gains that minimise the integral of sum_i weights_i z_i^2 + torque_weight u^2 (source 001, optimal LQ control).

    Raises NotControllable; ServoError unless weights (5,) are >= 0 and finite with that of the integral > 0, else the integral
    costs nothing and nothing would bring it home, and for weights so far apart that rounding decides the gains.
    """
    q = np.asarray(weights, dtype=np.float64)
    if q.shape != (5,) or not (np.all(np.isfinite(q)) and np.all(q >= 0.0) and q[4] > 0.0):
        raise ServoError(
            f"weights = {q.tolist()}; must be five for qm, qm', n ql, n ql' and the integral, all >= 0 and the last > 0: "
            "start with the error's and the integral's"
        )
    check_range("torque_weight", torque_weight, 1e-12, 1e12, "1 leaves the scale to the weights")
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
    """The poles as an array. Raises PolesNotAssignable for those that no real gains assign, that are unstable, or that are too
    fast for a sample time."""
    wanted = np.asarray(poles_1_s, dtype=np.complex128)
    if wanted.shape != (count,):
        raise PolesNotAssignable(
            f"poles of shape {wanted.shape}; must be ({count},), one a state: add or leave out some"
        )
    least_1_s = -MIN_DECAY_REL * float(np.max(np.abs(wanted)))
    for pole in wanted.tolist():
        if not (math.isfinite(abs(pole)) and pole.real < least_1_s):
            raise PolesNotAssignable(
                f"a pole at {pole:.6g} 1/s; must be finite, its real part < {least_1_s:.3g}: it would not settle"
            )
        if _count(wanted, pole.conjugate()) != _count(wanted, pole):
            raise PolesNotAssignable(
                f"a pole at {pole:.6g} 1/s without its conjugate; must come in pairs: real gains know no others"
            )
        if period_s is not None and not abs(pole) < math.pi / period_s:
            raise PolesNotAssignable(
                f"a pole at {pole:.6g} 1/s with a sample time of {period_s:g} s; its size must be < {math.pi / period_s:.6g}, "
                "half the sampling: ask for slower ones or sample faster"
            )
    return wanted


def sampled_rates(poles_1_s: ComplexArray, period_s: float) -> ComplexArray:
    """(exp(p period) - 1) / period: eigenvalues of (sampled state matrix - 1) / period, which tends to the continuous one."""
    return np.asarray(np.expm1(poles_1_s * period_s) / period_s, dtype=np.complex128)


def assign_eigenvalues(
    a: FloatArray, b: FloatArray, eigenvalues: ComplexArray, units: Units
) -> FloatArray:
    """k (n,) such that a + b k has these eigenvalues (Ackermann 1972), worked out in the units given."""
    scaled, column = units.matrix(a), b / units.states / units.rate_1_s
    krylov = [column]
    for _ in range(len(a) - 1):
        krylov.append(scaled @ krylov[-1])
    wanted = np.zeros_like(scaled)
    for coefficient in np.real(np.poly(eigenvalues / units.rate_1_s)):
        wanted = wanted @ scaled + coefficient * np.eye(len(a))
    last = np.linalg.solve(
        np.array(krylov), np.eye(len(a))[-1]
    )  # of the inverse of the reachability matrix
    return np.asarray(-(last @ wanted) / units.states)


def _count(poles_1_s: ComplexArray, pole: complex) -> int:
    return int(np.sum(np.abs(poles_1_s - pole) <= MIN_DECAY_REL * abs(pole)))


def _feedback(row: Any) -> Feedback:
    k = [float(gain) for gain in row]
    return Feedback((k[0], k[1], k[2], k[3]), k[4])
