"""Loops of an elastic joint with a notch filter inside the speed loop or upstream of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.servo.cascade import Cascade, NotchPlacement
from rig.drives.servo.errors import ServoError, check_range
from rig.drives.servo.loops import PolePair, margins, oscillatory_pairs, pole_pairs
from rig.drives.servo.notch import Notch
from rig.drives.servo.two_mass import TwoMass
from rig.drives.servo.wiring import ControlLoop

RESPONSE_TIME_CONSTANTS = 14.0  # duration of a response, in time constants of the slowest pole
RESPONSE_POINTS = 10_001  # peaks between the points are missed by 1e-4 of their value
DETUNE_RANGE = 0.1, 10.0  # notch frequency over the tuned one
MIN_PAIR_DAMPING = 1e-9  # damping ratio; a pair below it counts as undamped


@dataclass(frozen=True, kw_only=True)
class NotchTask:
    """Joint under a cascade; the notches are tuned to the joint and to its speed loop.

    Raises ServoError for a joint or gains without a pole pair that a notch could cancel.
    """

    joint: TwoMass
    gains: Cascade
    denominator_damping: float = 1.0

    def __post_init__(self) -> None:
        self.joint.check_elastic()
        pair = _least_damped(self.joint.poles_1_s)
        if pair.damping < MIN_PAIR_DAMPING:
            raise ServoError(
                f"the pole pair of the joint at {pair.frequency_rad_s:.6g} rad/s is undamped; must "
                "be damped, otherwise it never decays with a notch inside the speed loop: "
                "raise --damping, or elastic_damping_n_m_s_rad in the file"
            )
        speed = self.gains.speed_loop(self.joint)
        if not _is_stable(speed):
            raise self.unstable_speed_loop(speed, "no notch")
        if not oscillatory_pairs(speed.controllable_poles_1_s):
            raise ServoError(
                f"--speed-loop {self.speed_share:.6g} makes a speed loop without a complex pole "
                "pair; must leave one for the upstream notch: raise or lower it"
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
        """Tune both notches; their frequencies are multiplied by factor.

        inside: on the poles of the joint; upstream: on the least damped pair of the speed loop.
        """
        check_range(
            "--detune",
            factor,
            *DETUNE_RANGE,
            "1 is a tuned notch, 0.9 one whose frequency is 10 % too low",
        )
        pairs = {
            "inside": self.joint.poles_1_s,
            "upstream": self.gains.speed_loop(self.joint).controllable_poles_1_s,
        }
        return {where: self._notch(_least_damped(poles), factor) for where, poles in pairs.items()}

    def unstable_speed_loop(self, speed: ControlLoop, where: str) -> ServoError:
        """Build the error for a speed loop that is not stable."""
        return ServoError(
            f"--speed-loop {self.speed_share:.6g} with {where}: the speed loop has "
            f"{_worst_pole(speed)}; must be damped: lower it, or raise --reset-time"
        )

    def _notch(self, pair: PolePair, factor: float) -> Notch:
        if not pair.damping < self.denominator_damping:
            raise ServoError(
                f"--notch-damping {self.denominator_damping:.6g}; must be > {pair.damping:.4g}, "
                f"the damping ratio of the pole pair to be cancelled at {pair.frequency_rad_s:.4g} "
                "rad/s, otherwise it is no notch: raise it, 1 is usual"
            )
        return Notch.tuned_to(
            pair._replace(frequency_rad_s=factor * pair.frequency_rad_s), self.denominator_damping
        )


class Placement(NamedTuple):
    """Place of the notch (or no notch), and the loops with it."""

    name: str  # none, inside, upstream
    notch: Notch | None
    speed: ControlLoop
    position: ControlLoop  # opened at the torque
    # control.StateSpace from the error of the motor angle to that angle
    position_opened: Any


class Response(NamedTuple):
    """Step response of the load, angles and speeds at the motor side of the gear.

    (N,) each.
    """

    t_s: FloatArray
    angle_rad: FloatArray
    speed_rad_s: FloatArray

    @property
    def variation_rad_s(self) -> float:
        """Total variation of the speed."""
        return float(np.abs(np.diff(self.speed_rad_s)).sum())


def placements(task: NotchTask, factor: float = 1.0) -> tuple[Placement, ...]:
    """Build the loops of none, inside and upstream, notch frequencies times factor.

    Raises ServoError for a loop that is not stable.
    """
    notches = task.notches(factor)
    found = tuple(
        _placement(task, notches.get(name), name) for name in ("none", "inside", "upstream")
    )
    _check_stability(task, found, factor)
    return found


def step_response(loop: ControlLoop, source: str, time_s: float | None = None) -> Response:
    """Compute the response of the load to a unit step at an input of a position loop.

    Until all has settled unless a time is given. Raises ServoError for a loop that is not stable.
    """
    slowest = float(np.min(-loop.closed.poles().real))
    if not slowest > 0.0:
        raise ServoError(
            f"a loop with {_worst_pole(loop)}; must be damped: change the gains, or damp the joint"
        )
    if time_s is None:
        time_s = RESPONSE_TIME_CONSTANTS / slowest
    t = np.linspace(0.0, time_s, RESPONSE_POINTS)
    system = loop.closed[["load_angle", "load_speed"], source]
    angle, speed = np.hstack([system.C, system.D]) @ _step_states(system, float(t[1]))
    return Response(t, angle, speed)


def _step_states(system: Any, period_s: float) -> FloatArray:
    """Compute states and input (n + 1, RESPONSE_POINTS) from rest after a unit step.

    Exact: the known part is continued by doubling.
    """
    from scipy.linalg import expm

    n = system.nstates
    matrix = np.zeros((n + 1, n + 1))
    matrix[:n] = np.hstack([system.A, system.B])
    step = expm(matrix * period_s)
    found = np.eye(n + 1)[:, n:]
    while found.shape[1] < RESPONSE_POINTS:
        found = np.hstack([found, step @ found])
        step = step @ step
    return np.asarray(found[:, :RESPONSE_POINTS])


def _placement(task: NotchTask, notch: Notch | None, name: str) -> Placement:
    where: NotchPlacement = "upstream" if name == "upstream" else "inside"
    speed = task.gains.speed_loop(task.joint, notch if where == "inside" else None)
    position = task.gains.position_loop(task.joint, notch, where)
    opened = _position_opened(task, speed, notch if where == "upstream" else None)
    return Placement(name, notch, speed, position, opened)


def _position_opened(task: NotchTask, speed: ControlLoop, upstream: Notch | None) -> Any:
    import control

    # position gain, and the integral of the speed
    gain = control.ss(control.tf([task.gains.position_gain_1_s], [1.0, 0.0]))
    closed = control.ss(speed.closed["motor_speed", "speed_setpoint"])
    return closed * gain * (control.ss(upstream.system) if upstream else 1.0)


def _check_stability(task: NotchTask, found: Sequence[Placement], factor: float) -> None:
    """Check that all loops are stable; raises ServoError otherwise.

    The error names the loop, its worst pole, the option, and for the position loop the largest
    stable value.
    """
    tuned = "" if factor == 1.0 else f" tuned to {factor:.4g} of its frequency (--detune)"
    for row in found:
        if not _is_stable(row.speed):
            raise task.unstable_speed_loop(row.speed, _notch_label(row) + tuned)
    failing = [row for row in found if not _is_stable(row.position)]
    if failing:
        share = min(margins(row.position_opened).lower_gain_margin for row in failing)
        raise ServoError(
            f"--position-loop {task.position_share:.6g} with {_notch_label(failing[0])}{tuned}: "
            f"the position loop has {_worst_pole(failing[0].position)}; "
            f"must be < {share * task.position_share:.4g} for stability: lower it"
            + (", or choose --detune nearer to 1" if tuned else "")
        )


def _notch_label(row: Placement) -> str:
    return "no notch" if row.notch is None else f"the notch {row.name}"


def _is_stable(loop: ControlLoop) -> bool:
    return bool(np.all(loop.closed.poles().real < 0.0))


def _worst_pole(loop: ControlLoop) -> str:
    mode = min(pole_pairs(loop.closed.poles()), key=lambda mode: mode.damping)
    return f"a pole at {mode.frequency_rad_s:.6g} rad/s with damping {mode.damping:.3g}"


def _least_damped(poles_1_s: Any) -> PolePair:
    return min(
        oscillatory_pairs(poles_1_s), key=lambda mode: mode.damping, default=PolePair(math.inf, 1.0)
    )
