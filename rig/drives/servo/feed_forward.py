"""Feed-forward of a state-space drive: none, rigid joint, or dynamic by a load filter F0.

The dynamic pair of source 001 makes the load follow n ql = F0 reference:

    C1 = F0 Bm / Bl (reference of the motor angle),   C2 = F0 chi / Bl (torque),
    chi = det(s 1 - (A + B K))

Bm and Bl are the numerators of motor and load angle over torque. C2 is thus the nominal torque
minus K times the nominal states, and the loop may as well receive these five signals; the sampled
form does so. The zero of Bl at -Kel / Del is stable for any joint.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from planners.errors import unknown_name
from planners.trajectories.pieces import FloatArray
from rig.drives.servo.block import check_period
from rig.drives.servo.errors import Improper, ServoError, check_range
from rig.drives.servo.state_feedback import Feedback
from rig.drives.servo.two_mass import TwoMass

CORNER_RAD_S = 150.0  # default corner of F0


@dataclass(frozen=True)
class LoadFilter:
    """Filter F0 = numerator / denominator from the setpoint to the load, highest power first.

    Raises ServoError unless F0 is stable, proper and 1 at frequency 0, as the load would not reach
    its goal otherwise.
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def __post_init__(self) -> None:
        values = (*self.numerator, *self.denominator)
        if not (
            self.numerator
            and self.denominator
            and all(map(math.isfinite, values))
            and self.denominator[0]
        ):
            raise ServoError(
                f"F0 = {self.numerator} / {self.denominator}; "
                "must be finite, its first denominator coefficient not 0: correct the coefficients"
            )
        if self.relative_degree < 0:
            raise Improper(
                f"F0 has a relative degree of {self.relative_degree}; must be >= 0: add poles"
            )
        slowest = max((root.real for root in np.roots(self.denominator)), default=-math.inf)
        if not slowest < 0.0:
            raise ServoError(
                f"F0 has a pole with real part {slowest:.6g} 1/s; must be < 0, otherwise the load "
                "never settles: correct its denominator"
            )
        gain = self.numerator[-1] / self.denominator[-1]
        if not abs(gain - 1.0) < 1e-9:
            raise ServoError(
                f"F0 = {gain:.9g} at rest; must be 1, otherwise the load stops beside its goal: "
                "scale the numerator"
            )

    @classmethod
    def binomial(cls, relative_degree: int, corner_rad_s: float = CORNER_RAD_S) -> LoadFilter:
        """Build 1 / (1 + s / corner)^relative_degree.

        Raises ServoError for a corner out of bounds or a degree that is not 0 to 12.
        """
        check_range(
            "relative_degree",
            relative_degree,
            0,
            12,
            "3 suits a joint with a damper, 4 one without",
        )
        check_range(
            "corner_rad_s", corner_rad_s, 1e-6, 1e9, "use about the antiresonance of the joint"
        )
        powers = range(relative_degree, -1, -1)
        return cls((1.0,), tuple(math.comb(relative_degree, i) / corner_rad_s**i for i in powers))

    @property
    def relative_degree(self) -> int:
        """Number of poles minus number of zeros."""
        return len(self.denominator) - len(np.trim_zeros(self.numerator, "f"))

    def check_proper(self, joint: TwoMass) -> None:
        """Check that C2 is proper; raises Improper if it would differentiate the setpoint."""
        least = min_relative_degree(joint)
        if self.relative_degree < least:
            raise Improper(
                f"F0 has a relative degree of {self.relative_degree}; must be >= {least} for "
                f"elastic_damping_n_m_s_rad = {joint.elastic_damping_n_m_s_rad:g}: "
                f"use LoadFilter.binomial({least})"
            )


class FeedForward(NamedTuple):
    """Sampled feed-forward block, x+ = a x + b u and y = c x + d u.

    Input: angle, speed and acceleration of the setpoint. Output: the four nominal states, the
    nominal torque, and the reference of the motor angle for the integral action.
    """

    a: FloatArray  # (n, n)
    b: FloatArray  # (n, 3)
    c: FloatArray  # (6, n)
    d: FloatArray  # (6, 3)


def min_relative_degree(joint: TwoMass) -> int:
    """Compute the lowest relative degree of F0: 3, or 4 without a damper.

    chi has degree 4, and Bl = Del s + Kel.
    """
    return 3 if joint.elastic_damping_n_m_s_rad else 4


def feed_forward_pair(
    joint: TwoMass, feedback: Feedback, load_filter: LoadFilter
) -> tuple[Any, Any]:
    """Compute C1 and C2 as control.TransferFunction.

    Raises Improper for a filter of too low a relative degree.
    """
    import control

    load_filter.check_proper(joint)
    below = np.polymul(load_filter.denominator, joint.load_numerator)
    c1 = control.tf(np.polymul(load_filter.numerator, joint.motor_numerator), below)
    chi = characteristic(joint, feedback)
    c2 = control.tf(np.polymul(load_filter.numerator, chi), below)
    return c1, c2


def characteristic(joint: TwoMass, feedback: Feedback) -> FloatArray:
    """Compute Jm Jlr det(s 1 - (A + B K)), highest power first.

    It is `denominator` minus K times the numerators of motor and load.
    """
    k = feedback.gains
    motor = np.polymul([k[1], k[0]], joint.motor_numerator)
    load = np.polymul([k[3], k[2]], joint.load_numerator)
    return np.asarray(np.polysub(np.polysub(joint.denominator, motor), load))


def nominal_system(joint: TwoMass, load_filter: LoadFilter) -> Any:
    """Build control.StateSpace from the setpoint angle to nominal states (4) and torque.

    With these the load follows F0. Raises Improper for a filter of too low a relative degree.
    """
    import control

    load_filter.check_proper(joint)
    below = np.polymul(load_filter.denominator, np.trim_zeros(joint.load_numerator, "f"))
    n, rate_1_s = len(below) - 1, float(np.max(np.abs(np.roots(below))))
    # unit of time by the fastest pole, which makes the companion form well conditioned
    powers = rate_1_s ** np.arange(n, -1, -1.0)
    below = below * powers
    motor, load, s = joint.motor_numerator, joint.load_numerator, (1.0, 0.0)
    above = [motor, np.polymul(motor, s), load, np.polymul(load, s), joint.denominator]
    numerators = [np.polymul(load_filter.numerator, polynomial) for polynomial in above]
    rows = _padded(numerators, n + 1) * powers / below[0]
    companion = np.eye(n, k=-1)
    companion[0] = -below[1:] / below[0]
    first = np.zeros((n, 1))
    first[0] = 1.0
    through = rows[:, :1]
    return control.ss(
        companion * rate_1_s,
        first * rate_1_s,
        rows[:, 1:] + through * companion[0],
        through,
        inputs=["setpoint_angle"],
        outputs=["motor_angle", "motor_speed", "load_angle", "load_speed", "motor_torque"],
    )


def no_feed_forward(joint: TwoMass, period_s: float, load_filter: LoadFilter) -> FeedForward:
    """Pass the angle of the setpoint to the integral action, and nothing else."""
    d = np.zeros((6, 3))
    d[5, 0] = 1.0
    return _static(d)


def rigid_feed_forward(joint: TwoMass, period_s: float, load_filter: LoadFilter) -> FeedForward:
    """Build the feed-forward of a rigid joint.

    States [q, q', q, q'] and torque (Jm + Jlr) q'' + (Dm + Dlr) q'.
    """
    d = np.zeros((6, 3))
    d[[0, 2, 5], 0] = 1.0
    d[[1, 3], 1] = 1.0
    d[4] = 0.0, joint.rigid_friction_n_m_s_rad, joint.rigid_inertia_kg_m2
    return _static(d)


def dynamic_feed_forward(joint: TwoMass, period_s: float, load_filter: LoadFilter) -> FeedForward:
    """Build the feed-forward pair C1, C2 at a sample time.

    Outputs of nominal_system(): the nominal states now, and the mean of the nominal torque until
    the next sample, as the torque is held. Between samples the setpoint continues with its speed
    and acceleration. Raises Improper for a filter of too low a relative degree.
    """
    from scipy.linalg import expm

    check_period(period_s)
    system = nominal_system(joint, load_filter)
    n = system.nstates
    # d/dt of [filter; angle, speed, acceleration; integral of the torque]
    extended = np.zeros((n + 4, n + 4))
    extended[:n, : n + 1] = np.hstack([system.A, system.B])
    extended[n, n + 1] = extended[n + 1, n + 2] = 1.0
    extended[n + 3, : n + 1] = np.append(system.C[4], system.D[4])
    after = np.asarray(expm(extended * period_s))
    c, d = np.zeros((6, n)), np.zeros((6, 3))
    c[:4], c[5] = system.C[:4], system.C[0]
    c[4], d[4] = after[n + 3, :n] / period_s, after[n + 3, n : n + 3] / period_s
    return FeedForward(after[:n, :n], after[:n, n : n + 3], c, d)


FEED_FORWARD: dict[str, Callable[[TwoMass, float, LoadFilter], FeedForward]] = {
    "none": no_feed_forward,
    "rigid": rigid_feed_forward,
    "dynamic": dynamic_feed_forward,
}


def feed_forward_block(
    name: str, joint: TwoMass, period_s: float, load_filter: LoadFilter | None = None
) -> FeedForward:
    """Build the sampled block of a feed-forward by name.

    Without a filter F0 is the binomial one of the lowest relative degree. Raises ServoError for an
    unknown name, Improper.
    """
    if name not in FEED_FORWARD:
        raise ServoError(str(unknown_name("feed_forward", name, FEED_FORWARD)))
    return FEED_FORWARD[name](
        joint, period_s, load_filter or LoadFilter.binomial(min_relative_degree(joint))
    )


def _padded(polynomials: list[FloatArray], length: int) -> FloatArray:
    """Align coefficients, highest power first, in an array (len(polynomials), length)."""
    rows = np.zeros((len(polynomials), length))
    for row, polynomial in zip(rows, polynomials, strict=True):
        kept = np.trim_zeros(polynomial, "f")
        row[length - len(kept) :] = kept
    return rows


def _static(d: FloatArray) -> FeedForward:
    return FeedForward(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((6, 0)), d)
