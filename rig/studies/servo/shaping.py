"""Input shaping of an elastic joint: residual vibration versus parameter error.

Two measures of the same impulses (source 001, input shaping): the shaped vibration over the
unshaped one at the same instant, and over that of one impulse at time 0 (Singer and Seering 1990).
They differ by the decay in the meantime.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planners.errors import unknown_name
from planners.shapers import SHAPERS, Shaper, residual, transform
from planners.shapers.plan_shaped import shape
from planners.spectra.oscillator import MassChain, response
from planners.trajectories.pieces import FloatArray, add, polynomial
from planners.trajectories.trajectory import Trajectory
from rig.drives.servo.errors import ServoError, check_range
from rig.drives.servo.loops import PolePair
from rig.drives.servo.shaped_setpoint import (
    MAX_DAMPING,
    ShaperFacts,
    analyse_shaper,
    design_shaper,
    eigenvalue_1_s,
)

UNSHAPED = Shaper(np.ones(1), np.zeros(1))
MAX_FREQUENCY_ERROR = 0.9  # relative; at 1 the frequency would be 0
MIN_VALUE, MAX_VALUE = 1e-6, 1e6  # of frequencies [rad/s] and pulses [s]
UNPUBLISHED_NOTE = (
    "Source 001 gives frequency 1 rad/s, damping 0.05 and errors of 10 % and 20 %; "
    "the numbers of its figures are lost.",
    "Inferred, not published: the errors as four corners, the pulse of 10 s, the total inertia.",
)


@dataclass(frozen=True, kw_only=True)
class ShapingTask:
    """Mode, its parameter errors, the shapers to compare, and the torque pulse.

    The pulse is that of the two-mass example. Raises PlanError for an unknown shaper, ServoError
    for values out of bounds.
    """

    frequency_rad_s: float = 1.0
    damping: float = 0.05
    frequency_error: float = 0.1  # relative, both ways
    damping_error: float = 0.2  # relative, both ways
    shapers: tuple[str, ...] = ("zv", "zvd", "zvdd")
    pulse_s: float = 10.0
    period_s: float | None = None  # sample time of a drive, for sampled shapers

    def __post_init__(self) -> None:
        check_range(
            "frequency",
            self.frequency_rad_s,
            MIN_VALUE,
            MAX_VALUE,
            "give the natural frequency of the mode in rad/s",
        )
        check_range(
            "damping",
            self.damping,
            0.0,
            MAX_DAMPING,
            "give the damping ratio of the mode, e.g. 0.05",
        )
        check_range(
            "frequency error",
            self.frequency_error,
            0.0,
            MAX_FREQUENCY_ERROR,
            "give a share, e.g. 0.1",
        )
        check_range("damping error", self.damping_error, 0.0, 1.0, "give a share, e.g. 0.2")
        check_range("pulse", self.pulse_s, MIN_VALUE, MAX_VALUE, "give its length in s")
        largest = self.damping * (1.0 + self.damping_error)
        check_range(
            "damping x (1 + damping error)", largest, 0.0, MAX_DAMPING, "lower one of the two"
        )
        if not self.shapers:
            raise ServoError(
                f"shapers = (); must be one or more of {', '.join(SHAPERS)}: name them"
            )
        for name in self.shapers:
            if name not in SHAPERS:
                raise unknown_name("shaper", name, SHAPERS)

    @property
    def mode(self) -> PolePair:
        """Mode that the shapers are designed for."""
        return PolePair(self.frequency_rad_s, self.damping)

    @property
    def factors(self) -> tuple[tuple[float, float], ...]:
        """Actual over modelled frequency and damping ratio at the four corners.

        Both too high first.
        """
        f, d = self.frequency_error, self.damping_error
        return ((1.0 + f, 1.0 + d), (1.0 + f, 1.0 - d), (1.0 - f, 1.0 + d), (1.0 - f, 1.0 - d))

    @property
    def cases(self) -> tuple[PolePair, ...]:
        """Actual mode at the four corners."""
        return tuple(PolePair(f * self.frequency_rad_s, d * self.damping) for f, d in self.factors)


class PulseResponse(NamedTuple):
    """Response of a joint of 1 kg m2 in total to a torque pulse of 1 N m on the motor.

    Without friction.
    """

    command: Trajectory  # value: speed [rad/s] of a rigid joint; derivative: shaped torque [N m]
    load_speed: Trajectory  # value [rad/s]; continues after the torque
    residual: float  # largest deviation after the torque from the final speed, share of it


class Robustness(NamedTuple):
    """Figures of one shaper; shares, not percent."""

    name: str
    shaper: Shaper
    facts: ShaperFacts
    same_instant: FloatArray  # (4,) for the cases
    singer_seering: FloatArray  # (4,)
    damping_only: FloatArray  # (2,) same instant, only the damping ratio too high and too low
    sampled: Shaper | None  # with its impulses on samples of the drive
    sampled_facts: ShaperFacts | None


def robustness(task: ShapingTask) -> tuple[Robustness, ...]:
    """Compute the figures of every shaper of the task.

    Raises PlanError for a damping ratio too high for one of them, BeyondNyquist.
    """
    return tuple(_robustness(task, name) for name in dict.fromkeys(task.shapers))


def pulse_residuals(task: ShapingTask, shaper: Shaper = UNSHAPED) -> FloatArray:
    """Compute the residuals (5,) of the pulse example: modelled mode, then the four cases."""
    return np.array(
        [pulse_response(task.pulse_s, shaper, mode).residual for mode in (task.mode, *task.cases)]
    )


def pulse_response(
    pulse_s: float, shaper: Shaper, mode: PolePair, watch_s: float = 0.0
) -> PulseResponse:
    """Compute the response of a two-mass joint with this mode to a shaped torque pulse.

    It is followed by watch_s, at least one period. Load over rigid speed is (2 zeta w s + w^2) /
    (s^2 + 2 zeta w s + w^2) for any ratio of the masses: a mass on a spring whose foot moves like
    the rigid joint. Exact, no step size (source 001, example of two masses).
    """
    rate = eigenvalue_1_s(mode)
    chain = MassChain(
        masses_kg=(1.0,), stiffnesses_n_m=(abs(rate) ** 2,), dampings_n_s_m=(-2.0 * rate.real,)
    )
    command = shape(Trajectory((polynomial(pulse_s, (0.0, 1.0)),)), shaper)
    after_s = max(watch_s, 2.0 * math.pi / rate.imag)
    (lag,) = response(chain.modal, command, after_s)
    rigid_speed = (*command.pieces, polynomial(after_s, (pulse_s,)))
    load = Trajectory(
        tuple(add(rigid, behind) for rigid, behind in zip(rigid_speed, lag.pieces, strict=True))
    )
    return PulseResponse(command, load, Trajectory(lag.pieces[-1:]).peak().value / pulse_s)


def impulse_response(shaper: Shaper, mode: PolePair, t_s: FloatArray) -> FloatArray:
    """Compute the response of a mode to the impulses of a shaper, over w.

    Of w^2 / (s^2 + 2 zeta w s + w^2): (T,) for times (T,) (source 001).
    """
    rate = eigenvalue_1_s(mode)
    since_s = np.subtract.outer(t_s, shaper.times_s)  # (T, n)
    waves = np.where(since_s >= 0.0, np.exp(rate * np.maximum(since_s, 0.0)).imag, 0.0)
    return np.asarray(waves @ shaper.amplitudes * (mode.frequency_rad_s / rate.imag))


def _robustness(task: ShapingTask, name: str) -> Robustness:
    shaper = SHAPERS[name](eigenvalue_1_s(task.mode))
    rates = np.array([eigenvalue_1_s(case) for case in task.cases])
    sides = (1.0 + task.damping_error, 1.0 - task.damping_error)
    damped = np.array(
        [eigenvalue_1_s(PolePair(task.frequency_rad_s, side * task.damping)) for side in sides]
    )
    sampled = None if task.period_s is None else design_shaper(name, [task.mode], task.period_s)
    return Robustness(
        name,
        shaper,
        analyse_shaper(shaper, task.mode),
        np.abs(transform(shaper, rates)),
        residual(shaper, rates),
        np.abs(transform(shaper, damped)),
        sampled,
        None if sampled is None else analyse_shaper(sampled, task.mode),
    )
