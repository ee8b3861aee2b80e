"""What a torque disturbance observer does to an elastic joint, over the time constant of its filter (source 001, TDO).

Q = 1 / (1 + s T_f), or Butterworth's of a higher order with its corner at 1 / T_f; with the motor alone or the whole elastic
joint as nominal model, before a stiff and an elastic load.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from planners.trajectories.pieces import ComplexArray, FloatArray
from rig.drives.servo.disturbance_design import LowPass, Nominal, ObserverDesign, Place, Ratio
from rig.drives.servo.errors import ServoError, check_datum
from rig.drives.servo.loops import PolePair, oscillatory_pairs, pole_pairs
from rig.drives.servo.two_mass import TwoMass

TIME_CONSTANTS_S = (1e-9, 1e-4, 5e-4, 1e-3, 2e-3, 5e-3, 2e-2, 1e9)
LOW_FREQUENCY_SHARE = 0.01  # times omega_z: a frequency that counts as low
RESPONSE_PERIODS = 12.0  # of omega_z: how long a response is watched
RESPONSE_POINTS = 6001  # of a response
TIME_CONSTANT_SPREAD = 1e4  # a filter this much faster or slower than the joint is at its limit
GRID_POINTS = 800  # time constants tried between those limits
UNCHANGED_REL = 1e-3  # of its damping: a change that is none
Effect = Literal["excites", "leaves", "damps", "unstable"]
Interval = tuple[float, float]  # of time constants [s], from 0 or to inf at the limits
INFERRED_NOTES = {
    "fitted": "Fitted: the constants that have all five printed modes of source 001's rig; they are inferred, not published.",
    "listed": "Source 001 lists the joint's constants; the time constants are ours, as the numbers of its simulation are lost.",
}


@dataclass(frozen=True, kw_only=True)
class ObserverTask:
    """A joint, the time constants, the rigid nominal (the motor alone unless given), and the order of Q.

    Raises ServoError for no such task.
    """

    joint: TwoMass
    time_constants_s: tuple[float, ...] = TIME_CONSTANTS_S
    nominal_inertia_kg_m2: float | None = None
    order: int = 1

    def __post_init__(self) -> None:
        self.joint.check_elastic()
        if not self.time_constants_s:
            raise ServoError("time_constants_s = (); must be one or more: give them in s")
        for value in self.time_constants_s:
            check_datum("time constant", value)
            self.low_pass(value)
        _ = self.rigid, self.elastic

    def low_pass(self, time_constant_s: float) -> LowPass:
        """Q. Of the first order Butterworth's is the lecture's."""
        return LowPass(time_constant_s=time_constant_s, order=self.order, kind="butterworth")

    def design(self, nominal: Nominal, time_constant_s: float) -> ObserverDesign:
        """The observer with one of the nominals."""
        return ObserverDesign(low_pass=self.low_pass(time_constant_s), nominal=nominal)

    @property
    def rigid(self) -> Nominal:
        """1 / (J s + Dm)."""
        j = self.joint
        inertia = (
            j.motor_inertia_kg_m2
            if self.nominal_inertia_kg_m2 is None
            else self.nominal_inertia_kg_m2
        )
        return Nominal.rigid(inertia, j.motor_friction_n_m_s_rad)

    @property
    def elastic(self) -> Nominal:
        """The joint itself."""
        return Nominal.elastic(self.joint)

    @property
    def joint_pair(self) -> PolePair:
        """The joint's own least damped pair."""
        return min(oscillatory_pairs(self.joint.poles_1_s), key=lambda mode: mode.damping)

    @property
    def excitation_limit(self) -> float:
        """A damping below tells that the observer excites: neither the joint nor Q has it alone."""
        alone = min(mode.damping for mode in pole_pairs(_roots(self.low_pass(1.0).denominator)))
        return (1.0 - UNCHANGED_REL) * min(self.joint_pair.damping, alone)

    def effect(self, damping: float) -> Effect:
        """Of an observer that leaves this least damping: more than the joint's damps, less than the joint's and Q's excites."""
        if damping < 0.0:
            return "unstable"
        if damping < self.excitation_limit:
            return "excites"
        return "damps" if damping > (1.0 + UNCHANGED_REL) * self.joint_pair.damping else "leaves"

    @property
    def locked_rotor_pair(self) -> PolePair:
        """How the load swings while the motor stands; damping 1 where it does not."""
        return pole_pairs(_roots(self.joint.motor_numerator))[0]


class SpeedResponse(NamedTuple):
    """The load's speed after a step of torque, at the motor's side of the gear; (N,) each."""

    t_s: FloatArray
    speed_rad_s: FloatArray

    @property
    def peak_rad_s(self) -> float:
        """Largest |speed|."""
        return float(np.abs(self.speed_rad_s).max())

    @property
    def oscillation_index(self) -> float:
        """Total variation beyond up to the peak and on to the end, over that."""
        peak = self.speed_rad_s[int(np.abs(self.speed_rad_s).argmax())]
        least = float(abs(peak) + abs(peak - self.speed_rad_s[-1]))
        return max(0.0, float(np.abs(np.diff(self.speed_rad_s)).sum()) / least - 1.0)


class Rejection(NamedTuple):
    """One nominal at one time constant. Speeds of the load per N m, at the motor's side; NaN where it is not stable."""

    least_damped: PolePair  # of the poles that a torque on the motor moves, Q's included
    low: float  # |speed over torque on the motor| at LOW_FREQUENCY_SHARE omega_z, over that without observer
    peak_rad_s_n_m: float  # the largest of all frequencies
    motor_step_peak_rad_s: float
    motor_step_rings: float
    load_step_peak_rad_s: float
    load_step_rings: float

    @property
    def stable(self) -> bool:
        """Whether what swings decays."""
        return self.least_damped.damping >= 0.0


class ObserverRow(NamedTuple):
    """One time constant."""

    time_constant_s: float
    rigid: Rejection
    elastic: Rejection
    stiff: (
        PolePair  # the least damped pole of a stiff load (Jm + Jlr in one) under the rigid nominal
    )
    stiff_low: float  # like low, of the stiff load
    printed: (
        PolePair | None
    )  # the pair that H_f as source 001 prints it, for the first order, would have


class TimeConstantRanges(NamedTuple):
    """Over which time constants the rigid nominal excites, and which damps most."""

    excited: tuple[Interval, ...]  # less damped than the joint and Q, unstable ones included
    unstable: tuple[Interval, ...]
    best_s: float
    best: PolePair  # least damped there


def observer_rows(task: ObserverTask) -> tuple[ObserverRow, ...]:
    """All time constants, shortest first."""
    return tuple(_row(task, time_constant_s) for time_constant_s in sorted(task.time_constants_s))


def without_observer(task: ObserverTask) -> Rejection:
    """The joint alone."""
    return _rejection(
        task, task.joint_pair, _alone(task.joint, "motor"), _alone(task.joint, "load")
    )


def least_damping(task: ObserverTask, time_constant_s: float) -> float:
    """The least under the rigid nominal, Q's included; 1 where nothing swings."""
    return task.design(task.rigid, time_constant_s).least_damped(task.joint).damping


def time_constant_ranges(task: ObserverTask) -> TimeConstantRanges:
    """Over time constants from the joint's 1 / omega_z / TIME_CONSTANT_SPREAD to TIME_CONSTANT_SPREAD / omega_z."""
    from scipy.optimize import minimize_scalar

    centre = -math.log(task.joint.antiresonance_rad_s)
    grid = np.linspace(
        centre - math.log(TIME_CONSTANT_SPREAD),
        centre + math.log(TIME_CONSTANT_SPREAD),
        GRID_POINTS,
    )
    found = np.array([least_damping(task, float(np.exp(x))) for x in grid])
    top = int(found.argmax())
    ends = grid[max(top - 1, 0)], grid[min(top + 1, GRID_POINTS - 1)]
    best = float(
        np.exp(
            minimize_scalar(
                lambda x: -least_damping(task, float(np.exp(x))), bounds=ends, method="bounded"
            ).x
        )
    )
    excited, unstable = (_below(task, level, grid, found) for level in (task.excitation_limit, 0.0))
    return TimeConstantRanges(
        excited, unstable, best, task.design(task.rigid, best).least_damped(task.joint)
    )


def _below(
    task: ObserverTask, level: float, grid: FloatArray, found: FloatArray
) -> tuple[Interval, ...]:
    """Where the damping is less: between its crossings of the level, and on to the limits."""
    from scipy.optimize import brentq

    below = found < level
    crossed = np.flatnonzero(below[1:] != below[:-1])
    ends = [
        float(
            np.exp(
                brentq(
                    lambda x: least_damping(task, float(np.exp(x))) - level, grid[k], grid[k + 1]
                )
            )
        )
        for k in crossed
    ]
    ends = [0.0] * bool(below[0]) + ends + [math.inf] * bool(below[-1])
    return tuple(zip(ends[::2], ends[1::2], strict=True))


def torque_step_response(
    task: ObserverTask, nominal: Nominal | None, time_constant_s: float, torque: Place
) -> SpeedResponse:
    """The load's speed after 1 N m on motor or load, exactly; without observer for nominal = None."""
    if nominal is None:
        return _step(task, _alone(task.joint, torque))
    return _step(
        task, task.design(nominal, time_constant_s).disturbance(task.joint, torque, "load")
    )


def printed_poles_1_s(joint: TwoMass, time_constant_s: float) -> ComplexArray:
    """Of H_f = (Jlr s^2 + Del s + Kel)(Jm s^2 + Dm s) + G_f (Del s + Kel) Jm s^2, which source 001 prints with Jm for Jlr."""
    motor = np.array([joint.motor_inertia_kg_m2, joint.motor_friction_n_m_s_rad])
    wrong = np.polymul(
        [joint.motor_inertia_kg_m2, joint.reflected_friction_n_m_s_rad, 0.0], joint.load_numerator
    )
    whole = np.polymul([time_constant_s, 1.0], np.polymul(joint.motor_numerator, motor))
    return _roots(np.asarray(np.polyadd(whole, time_constant_s * wrong)))


def _row(task: ObserverTask, time_constant_s: float) -> ObserverRow:
    stiff, stiff_low = _stiff(task, time_constant_s)
    printed = (
        oscillatory_pairs(printed_poles_1_s(task.joint, time_constant_s)) if task.order == 1 else ()
    )
    return ObserverRow(
        time_constant_s=time_constant_s,
        rigid=_observed(task, task.design(task.rigid, time_constant_s)),
        elastic=_observed(task, task.design(task.elastic, time_constant_s)),
        stiff=stiff,
        stiff_low=stiff_low,
        printed=min(printed, key=lambda mode: mode.damping, default=None),
    )


def _observed(task: ObserverTask, own: ObserverDesign) -> Rejection:
    motor, load = (
        own.disturbance(task.joint, "motor", "load"),
        own.disturbance(task.joint, "load", "load"),
    )
    return _rejection(task, own.least_damped(task.joint), motor, load)


def _rejection(task: ObserverTask, least_damped: PolePair, motor: Ratio, load: Ratio) -> Rejection:
    if least_damped.damping < 0.0:
        return Rejection(least_damped, *[math.nan] * 6)
    omega = task.joint.antiresonance_rad_s
    grid = omega * np.logspace(-3.0, 2.0, 4001)
    low = np.array([LOW_FREQUENCY_SHARE * omega])
    bare = np.abs(_alone(task.joint, "motor").at(low))[0]
    steps = _step(task, motor), _step(task, load)
    return Rejection(
        least_damped,
        float(np.abs(motor.at(low))[0] / bare),
        float(np.abs(motor.at(grid)).max()),
        *(figure for step in steps for figure in (step.peak_rad_s, step.oscillation_index)),
    )


def _stiff(task: ObserverTask, time_constant_s: float) -> tuple[PolePair, float]:
    """Least damped pole, and rejection at LOW_FREQUENCY_SHARE omega_z: (1 / Q - 1) P^-1 + Pn^-1 with P = 1 / ((Jm + Jlr) s + Dm + Dlr)."""
    body = np.array([task.joint.rigid_inertia_kg_m2, task.joint.rigid_friction_n_m_s_rad])
    high = np.append(task.low_pass(time_constant_s).denominator[:-1], 0.0)  # 1 / Q - 1
    whole = np.polyadd(np.polymul(high, body), task.rigid.denominator)
    s = 1j * LOW_FREQUENCY_SHARE * task.joint.antiresonance_rad_s
    low = abs(np.polyval(high, s) * np.polyval(body, s) / np.polyval(whole, s))
    least = min(pole_pairs(_roots(np.asarray(whole))), key=lambda mode: mode.damping)
    return least, float(low) if least.damping >= 0.0 else math.nan


def _alone(joint: TwoMass, torque: Place) -> Ratio:
    """The load's speed over a torque, without observer."""
    own = np.polyadd(
        [joint.motor_inertia_kg_m2, joint.motor_friction_n_m_s_rad, 0.0], joint.load_numerator
    )
    return Ratio(
        joint.load_numerator if torque == "motor" else np.asarray(own), joint.denominator[:-1]
    )


def _step(task: ObserverTask, ratio: Ratio) -> SpeedResponse:
    """By residues: all poles are single, as those of Q are, but for one at 0 without friction, which makes a ramp of a step.

    Of a stable loop, or it grows beyond all numbers.
    """
    t = np.linspace(
        0.0, RESPONSE_PERIODS * 2.0 * np.pi / task.joint.antiresonance_rad_s, RESPONSE_POINTS
    )
    above, below, ramp = ratio.numerator, ratio.denominator, 0.0
    if below[-1] == 0.0:  # N / (s D) / s = ramp / s^2 + (N - ramp D) / s / (s D)
        below = below[:-1]
        ramp = float(above[-1] / below[-1])
        above = np.asarray(np.polysub(above, ramp * below)[:-1], dtype=np.float64)
    below = np.append(below, 0.0)  # times 1 / s
    poles = np.roots(below)
    residues = np.polyval(above, poles) / np.polyval(np.polyder(below), poles)
    return SpeedResponse(t, np.asarray(ramp * t + (np.exp(np.outer(t, poles)) @ residues).real))


def _roots(polynomial: FloatArray) -> ComplexArray:
    return np.asarray(np.roots(polynomial), dtype=np.complex128)
