"""What a state-space drive is told ahead: nothing, the torque of a rigid joint, or the one that moves the load by a filter.

The dynamic pair of source 001 makes the load follow n ql = F0 reference:

    C1 = F0 Bm / Bl (what the motor's angle will be),   C2 = F0 chi / Bl,   chi = det(s 1 - (A + B K))

Bm and Bl are the numerators of motor and load angle over torque, so C2 is the nominal torque less K times the nominal states,
and the loop may as well be told these five; that is how it is sampled. The zero of Bl at -Kel / Del is stable in any joint.
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

CORNER_RAD_S = 150.0


@dataclass(frozen=True)
class LoadFilter:
    """F0 = numerator / denominator, highest power first: what the load makes of its setpoint.

    Raises ServoError unless F0 is stable, proper and 1 at rest, else the load would not arrive.
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
                f"F0 = {self.numerator} / {self.denominator}; must be finite, its denominator not led by 0"
            )
        if self.relative_degree < 0:
            raise Improper(
                f"F0 has a relative degree of {self.relative_degree}; must be >= 0: add poles"
            )
        slowest = max((root.real for root in np.roots(self.denominator)), default=-math.inf)
        if not slowest < 0.0:
            raise ServoError(
                f"F0 has a pole with real part {slowest:.6g} 1/s; must be < 0: the load would never settle"
            )
        gain = self.numerator[-1] / self.denominator[-1]
        if not abs(gain - 1.0) < 1e-9:
            raise ServoError(
                f"F0 = {gain:.9g} at rest; must be 1: scale its numerator, else the load stops elsewhere"
            )

    @classmethod
    def binomial(cls, relative_degree: int, corner_rad_s: float = CORNER_RAD_S) -> LoadFilter:
        """1 / (1 + s / corner)^relative_degree. Raises ServoError for a corner out of bounds or a degree not 0 to 12."""
        check_range(
            "relative_degree",
            relative_degree,
            0,
            12,
            "3 suits a joint with a damper, 4 one without",
        )
        check_range("corner_rad_s", corner_rad_s, 1e-6, 1e9, "about the joint's antiresonance")
        powers = range(relative_degree, -1, -1)
        return cls((1.0,), tuple(math.comb(relative_degree, i) / corner_rad_s**i for i in powers))

    @property
    def relative_degree(self) -> int:
        """Poles less zeros."""
        return len(self.denominator) - len(np.trim_zeros(self.numerator, "f"))

    def check_proper(self, joint: TwoMass) -> None:
        """Raises Improper when C2 would have to differentiate the setpoint."""
        least = min_relative_degree(joint)
        if self.relative_degree < least:
            raise Improper(
                f"F0 has a relative degree of {self.relative_degree}; must be >= {least} for elastic_damping_n_m_s_rad = "
                f"{joint.elastic_damping_n_m_s_rad:g}: take LoadFilter.binomial({least})"
            )


class FeedForward(NamedTuple):
    """A sampled block from setpoint (angle, speed, acceleration) to what the loop is told: nominal states (4), nominal torque,
    and the motor angle that the integral compares. Matrices as in x+ = a x + b u, y = c x + d u."""

    a: FloatArray  # (n, n)
    b: FloatArray  # (n, 3)
    c: FloatArray  # (6, n)
    d: FloatArray  # (6, 3)


def min_relative_degree(joint: TwoMass) -> int:
    """Of F0: 3, or 4 without a damper, as chi is of 4th degree and Bl = Del s + Kel."""
    return 3 if joint.elastic_damping_n_m_s_rad else 4


def feed_forward_pair(
    joint: TwoMass, feedback: Feedback, load_filter: LoadFilter
) -> tuple[Any, Any]:
    """C1 and C2 as control.TransferFunction. Raises Improper for a filter of too low a relative degree."""
    import control

    load_filter.check_proper(joint)
    below = np.polymul(load_filter.denominator, joint.load_numerator)
    outcome = [
        control.tf(np.polymul(load_filter.numerator, above), below)
        for above in (joint.motor_numerator, characteristic(joint, feedback))
    ]
    return outcome[0], outcome[1]


def characteristic(joint: TwoMass, feedback: Feedback) -> FloatArray:
    """Jm Jlr det(s 1 - (A + B K)), highest power first: `denominator` less what K makes of motor and load."""
    k = feedback.gains
    motor = np.polymul([k[1], k[0]], joint.motor_numerator)
    load = np.polymul([k[3], k[2]], joint.load_numerator)
    return np.asarray(np.polysub(np.polysub(joint.denominator, motor), load))


def nominal_system(joint: TwoMass, load_filter: LoadFilter) -> Any:
    """control.StateSpace from setpoint angle to the five that move the load by F0: the four states and the torque.

    Raises Improper for a filter of too low a relative degree.
    """
    import control

    load_filter.check_proper(joint)
    below = np.polymul(load_filter.denominator, np.trim_zeros(joint.load_numerator, "f"))
    n, rate_1_s = len(below) - 1, float(np.max(np.abs(np.roots(below))))
    powers = rate_1_s ** np.arange(
        n, -1, -1.0
    )  # in time of the fastest pole, where the companion form is well conditioned
    below = below * powers
    motor, load, s = joint.motor_numerator, joint.load_numerator, (1.0, 0.0)
    above = [motor, np.polymul(motor, s), load, np.polymul(load, s), joint.denominator]
    rows = (
        _padded([np.polymul(load_filter.numerator, poly) for poly in above], n + 1)
        * powers
        / below[0]
    )
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
    """The setpoint's angle to the integral, and no more."""
    d = np.zeros((6, 3))
    d[5, 0] = 1.0
    return _static(d)


def rigid_feed_forward(joint: TwoMass, period_s: float, load_filter: LoadFilter) -> FeedForward:
    """States [q, q', q, q'] and the torque (Jm + Jlr) q'' + (Dm + Dlr) q' of a joint that does not yield."""
    d = np.zeros((6, 3))
    d[[0, 2, 5], 0] = 1.0
    d[[1, 3], 1] = 1.0
    d[4] = 0.0, joint.rigid_friction_n_m_s_rad, joint.rigid_inertia_kg_m2
    return _static(d)


def dynamic_feed_forward(joint: TwoMass, period_s: float, load_filter: LoadFilter) -> FeedForward:
    """The nominal states now and the mean of the nominal torque until the next sample, as the torque is held; between samples
    the setpoint goes on with its speed and acceleration. Raises Improper for a filter of too low a relative degree."""
    from scipy.linalg import expm

    check_period(period_s)
    system = nominal_system(joint, load_filter)
    n = system.nstates
    whole = np.zeros(
        (n + 4, n + 4)
    )  # d/dt of [filter; angle, speed, acceleration; integral of the torque]
    whole[:n, : n + 1] = np.hstack([system.A, system.B])
    whole[n, n + 1] = whole[n + 1, n + 2] = 1.0
    whole[n + 3, : n + 1] = np.append(system.C[4], system.D[4])
    after = np.asarray(expm(whole * period_s))
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
    """By name; without a filter the binomial one of the least degree. Raises ServoError for an unknown name, Improper."""
    if name not in FEED_FORWARD:
        raise ServoError(str(unknown_name("feed_forward", name, FEED_FORWARD)))
    return FEED_FORWARD[name](
        joint, period_s, load_filter or LoadFilter.binomial(min_relative_degree(joint))
    )


def _padded(polynomials: list[FloatArray], length: int) -> FloatArray:
    """(len(polynomials), length) of their coefficients, highest power first."""
    rows = np.zeros((len(polynomials), length))
    for row, polynomial in zip(rows, polynomials, strict=True):
        kept = np.trim_zeros(polynomial, "f")
        row[length - len(kept) :] = kept
    return rows


def _static(d: FloatArray) -> FeedForward:
    return FeedForward(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((6, 0)), d)
