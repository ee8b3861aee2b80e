"""Torque disturbance observer on an elastic joint, versus its filter time constant.

Source 001, torque disturbance observer (TDO). Q = 1 / (1 + s T_f), or Butterworth of that corner;
nominal model: the motor alone or the elastic joint; for a stiff and an elastic load.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from planners.trajectories.pieces import ComplexArray, FloatArray
from rig.drives.servo.disturbance_design import ObserverDesign, Place
from rig.drives.servo.errors import ServoError, check_datum
from rig.drives.servo.loops import PolePair, oscillatory_pairs, pole_pairs
from rig.drives.servo.nominal import LowPass, Nominal, Ratio
from rig.drives.servo.two_mass import TwoMass
from rig.studies.servo.joints import FITTED_NOTE

TIME_CONSTANTS_S = (1e-9, 1e-4, 5e-4, 1e-3, 2e-3, 5e-3, 2e-2, 1e9)
LOW_FREQUENCY_SHARE = 0.01  # frequency of the low-frequency rejection, over omega_z
RESPONSE_PERIODS = 12.0  # duration of a response, in periods of omega_z
RESPONSE_POINTS = 6001
UNCHANGED_REL = 1e-3  # change of the damping ratio that counts as none
Effect = Literal["excites", "leaves", "damps", "unstable"]
INFERRED_NOTES = {
    "fitted": FITTED_NOTE,
    "listed": (
        "Source 001 lists the joint's constants; the time constants are ours, as the numbers of "
        "its simulation are lost."
    ),
}


@dataclass(frozen=True, kw_only=True)
class ObserverTask:
    """Joint, time constants, inertia of the rigid nominal model, and order of Q.

    The rigid nominal model is the motor alone unless an inertia is given. Raises ServoError for
    values out of bounds and for a joint that does not oscillate.
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
        """Build Q: Butterworth, which at order 1 is the filter of source 001."""
        return LowPass(time_constant_s=time_constant_s, order=self.order, kind="butterworth")

    def design(self, nominal: Nominal, time_constant_s: float) -> ObserverDesign:
        """Build the observer with one of the nominal models."""
        return ObserverDesign(low_pass=self.low_pass(time_constant_s), nominal=nominal)

    @property
    def rigid(self) -> Nominal:
        """Rigid nominal model 1 / (J s + Dm)."""
        j = self.joint
        inertia = self.nominal_inertia_kg_m2
        if inertia is None:
            inertia = j.motor_inertia_kg_m2
        return Nominal.rigid(inertia, j.motor_friction_n_m_s_rad)

    @property
    def elastic(self) -> Nominal:
        """Elastic nominal model: the joint itself."""
        return Nominal.elastic(self.joint)

    @property
    def joint_pair(self) -> PolePair:
        """Least damped pole pair of the joint without observer."""
        return min(oscillatory_pairs(self.joint.poles_1_s), key=lambda mode: mode.damping)

    @property
    def excitation_limit(self) -> float:
        """Damping ratio below which the observer excites.

        Slightly below that of the joint and that of Q, the less damped of both.
        """
        alone = min(mode.damping for mode in pole_pairs(_roots(self.low_pass(1.0).denominator)))
        return (1.0 - UNCHANGED_REL) * min(self.joint_pair.damping, alone)

    def effect(self, damping: float) -> Effect:
        """Classify an observer by the least damping ratio with it.

        damps: more than without observer; excites: less than joint and Q each have; unstable: < 0.
        """
        if damping < 0.0:
            return "unstable"
        if damping < self.excitation_limit:
            return "excites"
        return "damps" if damping > (1.0 + UNCHANGED_REL) * self.joint_pair.damping else "leaves"

    @property
    def locked_rotor_pair(self) -> PolePair:
        """Pole pair of the load with locked rotor; damping ratio 1 if it does not oscillate."""
        return pole_pairs(_roots(self.joint.motor_numerator))[0]


class SpeedResponse(NamedTuple):
    """Speed of the load after a step of torque, at the motor side of the gear.

    (N,) each.
    """

    t_s: FloatArray
    speed_rad_s: FloatArray

    @property
    def peak_rad_s(self) -> float:
        """Largest |speed|."""
        return float(np.abs(self.speed_rad_s).max())

    @property
    def oscillation_index(self) -> float:
        """Oscillation index: total variation / (|peak| + |peak - final value|) - 1.

        With the final value 0 this is total variation / (2 x peak) - 1.
        """
        peak = self.speed_rad_s[int(np.abs(self.speed_rad_s).argmax())]
        least = float(abs(peak) + abs(peak - self.speed_rad_s[-1]))
        return max(0.0, float(np.abs(np.diff(self.speed_rad_s)).sum()) / least - 1.0)


class Rejection(NamedTuple):
    """Figures of one nominal model at one time constant.

    Speeds of the load per N m, at the motor side of the gear; NaN if unstable.
    """

    least_damped: PolePair  # pole pair that a torque on the motor excites, Q included
    # |speed over torque on the motor| at LOW_FREQUENCY_SHARE omega_z, over that without observer
    low: float
    peak_rad_s_n_m: float  # largest |speed over torque on the motor| of all frequencies
    motor_step_peak_rad_s: float
    motor_step_rings: float  # oscillation index
    load_step_peak_rad_s: float
    load_step_rings: float  # oscillation index

    @property
    def stable(self) -> bool:
        """True if no pole pair grows."""
        return self.least_damped.damping >= 0.0


class ObserverRow(NamedTuple):
    """Figures of one time constant."""

    time_constant_s: float
    rigid: Rejection
    elastic: Rejection
    stiff: PolePair  # least damped pair with a stiff load (inertia Jm + Jlr), rigid nominal model
    stiff_low: float  # low of Rejection, with the stiff load
    printed: PolePair | None  # pair of H_f as source 001 prints it, for order 1


def observer_rows(task: ObserverTask) -> tuple[ObserverRow, ...]:
    """Compute the figures of all time constants, shortest first."""
    return tuple(_row(task, time_constant_s) for time_constant_s in sorted(task.time_constants_s))


def without_observer(task: ObserverTask) -> Rejection:
    """Compute the figures of the joint without observer."""
    return _rejection(
        task,
        task.joint_pair,
        _without_observer_ratio(task.joint, "motor"),
        _without_observer_ratio(task.joint, "load"),
    )


def torque_step_response(
    task: ObserverTask, nominal: Nominal | None, time_constant_s: float, torque: Place
) -> SpeedResponse:
    """Compute the speed of the load after 1 N m on motor or load, exactly.

    nominal = None: without observer.
    """
    if nominal is None:
        return _step(task, _without_observer_ratio(task.joint, torque))
    return _step(
        task, task.design(nominal, time_constant_s).disturbance(task.joint, torque, "load")
    )


def printed_poles_1_s(joint: TwoMass, time_constant_s: float) -> ComplexArray:
    """Compute the roots of H_f as source 001 prints it, with Jm for Jlr in the last term.

    H_f = (Jlr s^2 + Del s + Kel)(Jm s^2 + Dm s) + G_f (Del s + Kel) Jm s^2.
    """
    motor = np.array([joint.motor_inertia_kg_m2, joint.motor_friction_n_m_s_rad])
    wrong = np.polymul(
        [joint.motor_inertia_kg_m2, joint.reflected_friction_n_m_s_rad, 0.0], joint.load_numerator
    )
    denominator = np.polymul([time_constant_s, 1.0], np.polymul(joint.motor_numerator, motor))
    return _roots(np.asarray(np.polyadd(denominator, time_constant_s * wrong)))


def _row(task: ObserverTask, time_constant_s: float) -> ObserverRow:
    stiff, stiff_low = _stiff(task, time_constant_s)
    printed: tuple[PolePair, ...] = ()
    if task.order == 1:
        printed = oscillatory_pairs(printed_poles_1_s(task.joint, time_constant_s))
    return ObserverRow(
        time_constant_s=time_constant_s,
        rigid=_with_observer(task, task.design(task.rigid, time_constant_s)),
        elastic=_with_observer(task, task.design(task.elastic, time_constant_s)),
        stiff=stiff,
        stiff_low=stiff_low,
        printed=min(printed, key=lambda mode: mode.damping, default=None),
    )


def _with_observer(task: ObserverTask, design: ObserverDesign) -> Rejection:
    motor = design.disturbance(task.joint, "motor", "load")
    load = design.disturbance(task.joint, "load", "load")
    return _rejection(task, design.least_damped(task.joint), motor, load)


def _rejection(task: ObserverTask, least_damped: PolePair, motor: Ratio, load: Ratio) -> Rejection:
    if least_damped.damping < 0.0:
        return Rejection(least_damped, *[math.nan] * 6)
    omega = task.joint.antiresonance_rad_s
    grid = omega * np.logspace(-3.0, 2.0, 4001)
    low = np.array([LOW_FREQUENCY_SHARE * omega])
    bare = np.abs(_without_observer_ratio(task.joint, "motor").at(low))[0]
    motor_step = _step(task, motor)
    load_step = _step(task, load)
    return Rejection(
        least_damped=least_damped,
        low=float(np.abs(motor.at(low))[0] / bare),
        peak_rad_s_n_m=float(np.abs(motor.at(grid)).max()),
        motor_step_peak_rad_s=motor_step.peak_rad_s,
        motor_step_rings=motor_step.oscillation_index,
        load_step_peak_rad_s=load_step.peak_rad_s,
        load_step_rings=load_step.oscillation_index,
    )


def _stiff(task: ObserverTask, time_constant_s: float) -> tuple[PolePair, float]:
    """Compute least damped pole pair and low-frequency rejection of a stiff load.

    (1 / Q - 1) P^-1 + Pn^-1 with P = 1 / ((Jm + Jlr) s + Dm + Dlr); at LOW_FREQUENCY_SHARE omega_z.
    """
    body = np.array([task.joint.rigid_inertia_kg_m2, task.joint.rigid_friction_n_m_s_rad])
    high = np.append(task.low_pass(time_constant_s).denominator[:-1], 0.0)  # 1 / Q - 1
    denominator = np.polyadd(np.polymul(high, body), task.rigid.denominator)
    s = 1j * LOW_FREQUENCY_SHARE * task.joint.antiresonance_rad_s
    low = abs(np.polyval(high, s) * np.polyval(body, s) / np.polyval(denominator, s))
    least = min(pole_pairs(_roots(np.asarray(denominator))), key=lambda mode: mode.damping)
    return least, float(low) if least.damping >= 0.0 else math.nan


def _without_observer_ratio(joint: TwoMass, torque: Place) -> Ratio:
    """Build the transfer function from a torque to the speed of the load, without observer."""
    motor_side = np.polyadd(
        [joint.motor_inertia_kg_m2, joint.motor_friction_n_m_s_rad, 0.0], joint.load_numerator
    )
    return Ratio(
        joint.load_numerator if torque == "motor" else np.asarray(motor_side),
        joint.denominator[:-1],
    )


def _step(task: ObserverTask, ratio: Ratio) -> SpeedResponse:
    """Compute a step response by residues, for a stable loop.

    All poles are single, as those of Q are, except one at 0 without friction, which makes a ramp of
    a step.
    """
    duration_s = RESPONSE_PERIODS * 2.0 * np.pi / task.joint.antiresonance_rad_s
    t = np.linspace(0.0, duration_s, RESPONSE_POINTS)
    above = ratio.numerator
    below = ratio.denominator
    ramp = 0.0
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
