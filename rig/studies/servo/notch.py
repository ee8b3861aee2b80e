"""Where a notch filter helps against a joint's resonance: inside the speed loop, or upstream of it (source 001)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.servo.block import check_period
from rig.drives.servo.cascade import Cascade, NotchPlacement
from rig.drives.servo.errors import ServoError, check_range
from rig.drives.servo.loops import PolePair, margins, oscillatory_pairs, pole_pairs
from rig.drives.servo.notch import Notch
from rig.drives.servo.two_mass import TwoMass
from rig.drives.servo.wiring import ControlLoop

SETTLED_STEP_SHARE = 0.02  # of the step
RESPONSE_TIME_CONSTANTS = 14.0  # time constants of the slowest pole
RESPONSE_POINTS = 10_001  # of a response: what peaks lose between samples is 1e-4 of them
DETUNE_RANGE = 0.1, 10.0
MIN_PAIR_DAMPING = 1e-9  # damping of a pair that is as good as none
UNPUBLISHED_NOTE = (
    "Source 001 gives the joint and the gains of its example, and where the notch lies; the numbers of its figures are lost. "
    "Inferred, not published: that gains are in shares of ω_z and of the rigid inertia Jm + Jlr; the damping of the notch's "
    "poles."
)
FITTED_NOTE = "Fitted: the constants that have all five printed modes of source 001's rig; they are inferred, not published."


@dataclass(frozen=True, kw_only=True)
class NotchTask:
    """A joint under a cascade; the notches are tuned to the joint and to the loop. Raises ServoError for no such task."""

    joint: TwoMass
    gains: Cascade
    denominator_damping: float = 1.0

    def __post_init__(self) -> None:
        self.joint.check_elastic()
        pair = _least_damped(self.joint.poles_1_s)
        if pair.damping < MIN_PAIR_DAMPING:
            raise ServoError(
                f"the joint's pair at {pair.frequency_rad_s:.6g} rad/s is undamped; must be damped, or it swings on for ever "
                "behind a notch inside the speed loop: raise --damping, or elastic_damping_n_m_s_rad in the file"
            )
        speed = self.gains.speed_loop(self.joint)
        if not _settles(speed):
            raise self.unsettled(speed, "no notch")
        if not oscillatory_pairs(speed.controllable_poles_1_s):
            raise ServoError(
                f"--speed-loop {self.speed_share:.6g} leaves a speed loop without a pair of poles; must leave one for the "
                "upstream notch: raise or lower it"
            )

    @property
    def speed_share(self) -> float:
        """Speed gain over omega_z (Jm + Jlr)."""
        return self.gains.speed_gain_n_m_s_rad / (
            self.joint.antiresonance_rad_s * self.joint.rigid_inertia_kg_m2
        )

    @property
    def position_share(self) -> float:
        """Position gain over omega_z."""
        return self.gains.position_gain_1_s / self.joint.antiresonance_rad_s

    def notches(self, factor: float = 1.0) -> dict[str, Notch]:
        """inside: on the joint's poles; upstream: on the least damped pair of the speed loop; frequencies times factor."""
        check_range(
            "--detune",
            factor,
            *DETUNE_RANGE,
            "1 is a notch that is right, 0.9 one that lies 10 % too low",
        )
        pairs = {
            "inside": self.joint.poles_1_s,
            "upstream": self.gains.speed_loop(self.joint).controllable_poles_1_s,
        }
        return {where: self._notch(_least_damped(poles), factor) for where, poles in pairs.items()}

    def unsettled(self, speed: ControlLoop, where: str) -> ServoError:
        """The error for a speed loop that does not settle."""
        return ServoError(
            f"--speed-loop {self.speed_share:.6g} with {where}: the speed loop has {_worst(speed)}; must be damped to settle: "
            "lower it, or raise --reset-time"
        )

    def _notch(self, pair: PolePair, factor: float) -> Notch:
        if not pair.damping < self.denominator_damping:
            raise ServoError(
                f"--notch-damping {self.denominator_damping:.6g}; must be > {pair.damping:.4g}, the damping of the pair to be "
                f"cancelled at {pair.frequency_rad_s:.4g} rad/s, or it is no notch: raise it, 1 is usual"
            )
        return Notch.tuned_to(
            pair._replace(frequency_rad_s=factor * pair.frequency_rad_s), self.denominator_damping
        )


class Placement(NamedTuple):
    """No notch, or one in its place, and the loops it makes."""

    name: str  # none, inside, upstream
    notch: Notch | None
    speed: ControlLoop
    position: ControlLoop
    position_opened: Any  # control.StateSpace from the error of the motor's angle to that angle; position opens at the torque


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
    speed_modes: tuple[PolePair, ...]  # of the speed loop
    position_modes: tuple[PolePair, ...]
    hidden: tuple[PolePair, ...]  # cancelled: only disturbances move them
    phase_margin_deg: float  # of the speed loop
    crossover_rad_s: float
    position_margin_deg: float  # of the position loop, opened at the error of the motor's angle
    position_crossover_rad_s: float
    motor_step_variation: float  # of the load's speed after 1 N m on the motor
    load_step_variation: float
    position_step_peak_rad_s: float  # of the load's speed after 1 rad
    overshoot: float  # of the load's angle
    oscillation: float  # of the load's speed: total variation beyond up and down, over up and down
    settling_s: float  # of the load's angle, to SETTLED

    @property
    def least_damped(self) -> PolePair:
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
    """none, inside and upstream, the notches' frequencies times factor. Raises ServoError for a loop that does not settle."""
    notches = task.notches(factor)
    found = tuple(
        _placement(task, notches.get(name), name) for name in ("none", "inside", "upstream")
    )
    _check_settling(task, found, factor)
    return found


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


def step_response(loop: ControlLoop, source: str, time_s: float | None = None) -> Response:
    """Of the load to a unit step at an input of a position loop, until all has settled unless a time is given.

    Raises ServoError for a loop that is not stable.
    """
    slowest = float(np.min(-loop.closed.poles().real))
    if not slowest > 0.0:
        raise ServoError(
            f"a loop with {_worst(loop)}; must be damped to settle: change the gains, or damp the joint"
        )
    t = np.linspace(
        0.0, RESPONSE_TIME_CONSTANTS / slowest if time_s is None else time_s, RESPONSE_POINTS
    )
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
    while found.shape[1] < RESPONSE_POINTS:
        found = np.hstack([found, step @ found])
        step = step @ step
    return np.asarray(found[:, :RESPONSE_POINTS])


def _placement(task: NotchTask, notch: Notch | None, name: str) -> Placement:
    where: NotchPlacement = "upstream" if name == "upstream" else "inside"
    speed = task.gains.speed_loop(task.joint, notch if where == "inside" else None)
    position = task.gains.position_loop(task.joint, notch, where)
    return Placement(
        name,
        notch,
        speed,
        position,
        _position_opened(task, speed, notch if where == "upstream" else None),
    )


def _position_opened(task: NotchTask, speed: ControlLoop, upstream: Notch | None) -> Any:
    import control

    gain = control.ss(
        control.tf([task.gains.position_gain_1_s], [1.0, 0.0])
    )  # and the speed's integral
    closed = control.ss(speed.closed["motor_speed", "speed_setpoint"])
    return closed * gain * (control.ss(upstream.system) if upstream else 1.0)


def _check_settling(task: NotchTask, found: Sequence[Placement], factor: float) -> None:
    """Names the loop, its worst pole and the option; of the position loop the largest value that settles."""
    tuned = "" if factor == 1.0 else f" tuned to {factor:.4g} of its frequency (--detune)"
    for row in found:
        if not _settles(row.speed):
            raise task.unsettled(row.speed, _called(row) + tuned)
    failing = [row for row in found if not _settles(row.position)]
    if failing:
        share = min(margins(row.position_opened).lower_gain_margin for row in failing)
        raise ServoError(
            f"--position-loop {task.position_share:.6g} with {_called(failing[0])}{tuned}: the position loop has "
            f"{_worst(failing[0].position)}; must be < {share * task.position_share:.4g} to settle: lower it"
            + (", or take --detune nearer to 1" if tuned else "")
        )


def _called(row: Placement) -> str:
    return "no notch" if row.notch is None else f"the notch {row.name}"


def _settles(loop: ControlLoop) -> bool:
    return bool(np.all(loop.closed.poles().real < 0.0))


def _worst(loop: ControlLoop) -> str:
    mode = min(pole_pairs(loop.closed.poles()), key=lambda mode: mode.damping)
    return f"a pole at {mode.frequency_rad_s:.6g} rad/s with damping {mode.damping:.3g}"


def _row(placement: Placement, factor: float) -> NotchRow:
    name, notch, speed, position, position_opened = placement
    inner, outer = speed.analysis.margins, margins(position_opened)
    motor, load = (step_response(position, source) for source in ("motor_torque", "load_torque"))
    step = step_response(position, "setpoint_angle")
    peak = float(np.abs(step.speed_rad_s).max())
    last = int(np.flatnonzero(np.abs(step.angle_rad - 1.0) > SETTLED_STEP_SHARE)[-1])
    return NotchRow(
        name=name,
        factor=factor,
        notch=notch,
        speed_modes=pole_pairs(speed.controllable_poles_1_s),
        position_modes=pole_pairs(position.controllable_poles_1_s),
        hidden=pole_pairs(position.cancelled_poles_1_s),
        phase_margin_deg=inner.phase_margin_deg,
        crossover_rad_s=inner.crossover_rad_s,
        position_margin_deg=outer.phase_margin_deg,
        position_crossover_rad_s=outer.crossover_rad_s,
        motor_step_variation=motor.variation_rad_s,
        load_step_variation=load.variation_rad_s,
        position_step_peak_rad_s=peak,
        overshoot=max(0.0, float(step.angle_rad.max()) - 1.0),
        oscillation=max(0.0, step.variation_rad_s / (2.0 * peak) - 1.0),
        settling_s=float(step.t_s[min(last + 1, RESPONSE_POINTS - 1)]),
    )


def _sampled(name: str, notch: Notch, period_s: float) -> Sampled:
    w = notch.frequency_rad_s
    with_it, without = (
        _passed(notch.sampled(period_s, prewarp=prewarp), w) for prewarp in (True, False)
    )
    return Sampled(name, w, notch.digital_frequency_rad_s(period_s), notch.depth, with_it, without)


def _passed(system: Any, omega_rad_s: float) -> float:
    return abs(complex(system(complex(np.exp(1j * omega_rad_s * system.dt)))))


def _least_damped(poles_1_s: Any) -> PolePair:
    return min(
        oscillatory_pairs(poles_1_s), key=lambda mode: mode.damping, default=PolePair(math.inf, 1.0)
    )
