"""Where a notch filter helps against a joint's resonance: inside the speed loop, or upstream of it (source 001)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from planners.pieces import FloatArray
from rig.servo.block import check_period
from rig.servo.cascade import Cascade, Where
from rig.servo.errors import ServoError, check_range
from rig.servo.loops import Mode, modes, swinging
from rig.servo.notch import Notch
from rig.servo.two_mass import TwoMass
from rig.servo.wiring import Loop

SETTLED = 0.02  # of the step
WATCHED = 14.0  # time constants of the slowest pole
POINTS = 10_001  # of a response: what peaks lose between samples is 1e-4 of them
DETUNED = 0.1, 10.0


@dataclass(frozen=True, kw_only=True)
class NotchTask:
    """A joint under a cascade; the notches are tuned to the joint and to the loop. Raises ServoError for no such task."""

    joint: TwoMass
    gains: Cascade
    denominator_damping: float = 1.0

    def __post_init__(self) -> None:
        self.joint.check_elastic()
        if not swinging(self.gains.speed_loop(self.joint).shown_poles_1_s):
            raise ServoError(
                f"speed_gain_n_m_s_rad = {self.gains.speed_gain_n_m_s_rad:.6g} leaves a speed loop without a pair of poles; "
                "must leave one for the upstream notch: raise or lower the gain"
            )

    def notches(self, factor: float = 1.0) -> dict[str, Notch]:
        """inside: on the joint's poles; upstream: on the least damped pair of the speed loop; frequencies times factor."""
        check_range("detune", factor, *DETUNED, "1 is a notch that is right, 0.9 one that lies 10 % too low")
        pairs = {"inside": self.joint.poles_1_s, "upstream": self.gains.speed_loop(self.joint).shown_poles_1_s}
        return {where: self._notch(_least_damped(poles), factor) for where, poles in pairs.items()}

    def _notch(self, pair: Mode, factor: float) -> Notch:
        return Notch.tuned_to(pair._replace(frequency_rad_s=factor * pair.frequency_rad_s), self.denominator_damping)


class Placement(NamedTuple):
    """No notch, or one in its place, and the loops it makes."""

    name: str  # none, inside, upstream
    notch: Notch | None
    speed: Loop
    position: Loop


class Response(NamedTuple):
    """Of the load after a step, angles and speeds at the motor's side of the gear; (N,) each."""

    t_s: FloatArray
    angle_rad: FloatArray
    speed_rad_s: FloatArray

    @property
    def variation_rad_s(self) -> float:
        """Total variation of the speed: how much goes up and down in all."""
        return float(np.abs(np.diff(self.speed_rad_s)).sum())


class NotchRow(NamedTuple):
    """What a placement amounts to."""

    name: str
    factor: float  # of the notch's frequency; 1 is right
    notch: Notch | None
    speed_modes: tuple[Mode, ...]  # of the speed loop
    position_modes: tuple[Mode, ...]
    hidden: tuple[Mode, ...]  # cancelled: only disturbances move them
    phase_margin_deg: float  # of the speed loop
    crossover_rad_s: float
    motor_step_variation: float  # of the load's speed after 1 N m on the motor
    load_step_variation: float
    position_step_peak_rad_s: float  # of the load's speed after 1 rad
    overshoot: float  # of the load's angle
    oscillation: float  # of the load's speed: total variation beyond up and down, over up and down
    settling_s: float  # of the load's angle, to SETTLED

    @property
    def least_damped(self) -> Mode:
        """Of the position loop's modes that the setpoint moves."""
        return min(self.position_modes, key=lambda mode: mode.damping)


class Sampled(NamedTuple):
    """A notch in a drive."""

    name: str
    frequency_rad_s: float
    unwarped_rad_s: float  # where it lies without prewarp
    depth: float
    prewarped: float  # what passes at the frequency, with prewarp and without
    unwarped: float

    @property
    def shift(self) -> float:
        """Of the frequency without prewarp, as a share."""
        return self.unwarped_rad_s / self.frequency_rad_s - 1.0


def placements(task: NotchTask, factor: float = 1.0) -> tuple[Placement, ...]:
    """none, inside and upstream, the notches' frequencies times factor."""
    notches = task.notches(factor)
    return tuple(_placement(task, notches.get(name), name) for name in ("none", "inside", "upstream"))


def compare(task: NotchTask) -> tuple[NotchRow, ...]:
    """none, inside and upstream in figures."""
    return tuple(_row(placement, 1.0) for placement in placements(task))


def detuned(task: NotchTask, factor: float) -> tuple[NotchRow, ...]:
    """inside and upstream, the notches' frequencies times factor."""
    return tuple(_row(placement, factor) for placement in placements(task, factor)[1:])


def sampled(task: NotchTask, period_s: float) -> tuple[Sampled, ...]:
    """Both notches at a sample time. Raises BeyondNyquist for one it cannot hold, ServoError for no sample time."""
    check_period(period_s)
    return tuple(_sampled(name, notch, period_s) for name, notch in task.notches().items())


def step_response(loop: Loop, source: str, time_s: float | None = None) -> Response:
    """Of the load to a unit step at an input of a position loop, until all has settled unless a time is given.

    Raises ServoError for a loop that is not stable.
    """
    slowest = float(np.min(-loop.closed.poles().real))
    if not slowest > 0.0:
        raise ServoError(f"a pole at {-slowest:.6g} 1/s; must be < 0 to settle: change the gains, or damp the joint")
    t = np.linspace(0.0, WATCHED / slowest if time_s is None else time_s, POINTS)
    system = loop.closed[["load_angle", "load_speed"], source]
    angle, speed = np.hstack([system.C, system.D]) @ _states(system, float(t[1]))
    return Response(t, angle, speed)


def _states(system: Any, period_s: float) -> FloatArray:
    """States and input (n + 1, POINTS) from rest after a unit step, exactly: what is known is carried on by doubling."""
    from scipy.linalg import expm

    n = system.nstates
    whole = np.zeros((n + 1, n + 1))
    whole[:n] = np.hstack([system.A, system.B])
    step = expm(whole * period_s)
    found = np.eye(n + 1)[:, n:]
    while found.shape[1] < POINTS:
        found = np.hstack([found, step @ found])
        step = step @ step
    return np.asarray(found[:, :POINTS])


def _placement(task: NotchTask, notch: Notch | None, name: str) -> Placement:
    where: Where = "upstream" if name == "upstream" else "inside"
    speed = task.gains.speed_loop(task.joint, notch if where == "inside" else None)
    return Placement(name, notch, speed, task.gains.position_loop(task.joint, notch, where))


def _row(placement: Placement, factor: float) -> NotchRow:
    name, notch, speed, position = placement
    margins = speed.facts.margins
    motor, load = (step_response(position, source) for source in ("motor_torque", "load_torque"))
    step = step_response(position, "setpoint_angle")
    peak = float(np.abs(step.speed_rad_s).max())
    last = int(np.flatnonzero(np.abs(step.angle_rad - 1.0) > SETTLED)[-1])
    return NotchRow(
        name=name,
        factor=factor,
        notch=notch,
        speed_modes=modes(speed.shown_poles_1_s),
        position_modes=modes(position.shown_poles_1_s),
        hidden=modes(position.hidden_poles_1_s),
        phase_margin_deg=margins.phase_deg,
        crossover_rad_s=margins.crossover_rad_s,
        motor_step_variation=motor.variation_rad_s,
        load_step_variation=load.variation_rad_s,
        position_step_peak_rad_s=peak,
        overshoot=max(0.0, float(step.angle_rad.max()) - 1.0),
        oscillation=max(0.0, step.variation_rad_s / (2.0 * peak) - 1.0),
        settling_s=float(step.t_s[min(last + 1, POINTS - 1)]),
    )


def _sampled(name: str, notch: Notch, period_s: float) -> Sampled:
    w = notch.frequency_rad_s
    with_it, without = (_passed(notch.sampled(period_s, prewarp=prewarp), w) for prewarp in (True, False))
    return Sampled(name, w, notch.digital_frequency_rad_s(period_s), notch.depth, with_it, without)


def _passed(system: Any, omega_rad_s: float) -> float:
    return abs(complex(system(complex(np.exp(1j * omega_rad_s * system.dt)))))


def _least_damped(poles_1_s: Any) -> Mode:
    return min(swinging(poles_1_s), key=lambda mode: mode.damping, default=Mode(math.inf, 1.0))
