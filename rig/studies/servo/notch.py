"""Comparison of a notch filter inside the speed loop, upstream of it, and none (source 001)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rig.drives.servo.block import check_period
from rig.drives.servo.loops import PolePair, margins, pole_pairs
from rig.drives.servo.notch import Notch
from rig.studies.servo.notch_loops import (
    RESPONSE_POINTS,
    NotchTask,
    Placement,
    placements,
    step_response,
)

SETTLED_STEP_SHARE = 0.02  # band of the settling time, share of the step
UNPUBLISHED_NOTE = (
    "Source 001 gives the joint and the gains of its example, and where the notch lies; the "
    "numbers of its figures are lost. Inferred, not published: that gains are in shares of ω_z and "
    "of the rigid inertia Jm + Jlr; the damping of the notch's poles."
)


class NotchRow(NamedTuple):
    """Figures of one placement."""

    name: str
    factor: float  # on the frequency of the notch; 1 is tuned
    notch: Notch | None
    speed_modes: tuple[PolePair, ...]  # of the speed loop
    position_modes: tuple[PolePair, ...]
    hidden: tuple[PolePair, ...]  # cancelled poles: excited by disturbances alone
    phase_margin_deg: float  # of the speed loop
    crossover_rad_s: float
    position_margin_deg: float  # phase margin of the position loop, opened at the angle error
    position_crossover_rad_s: float
    motor_step_variation: (
        float  # total variation of the load speed after 1 N m on the motor [rad/s]
    )
    load_step_variation: float  # after 1 N m on the load [rad/s]
    position_step_peak_rad_s: float  # peak speed of the load after a setpoint step of 1 rad
    overshoot: float  # of the load angle, share of the step
    oscillation: float  # oscillation index of the load speed: total variation / (2 x peak) - 1
    settling_s: float  # settling time of the load angle, band SETTLED_STEP_SHARE

    @property
    def least_damped(self) -> PolePair:
        """Least damped pole pair of the position loop that the setpoint excites."""
        return min(self.position_modes, key=lambda mode: mode.damping)


class SampledNotch(NamedTuple):
    """Discretised notch of one placement."""

    name: str
    frequency_rad_s: float
    unwarped_rad_s: float  # frequency without prewarp
    depth: float  # gain of the continuous notch at frequency_rad_s
    prewarped: float  # gain there, sampled with prewarp
    unwarped: float  # gain there, sampled without prewarp

    @property
    def shift(self) -> float:
        """Frequency shift without prewarp, relative to the frequency."""
        return self.unwarped_rad_s / self.frequency_rad_s - 1.0


def compare(task: NotchTask) -> tuple[NotchRow, ...]:
    """Compute the figures of none, inside and upstream."""
    return tuple(_row(placement, 1.0) for placement in placements(task))


def detuned(task: NotchTask, factor: float) -> tuple[NotchRow, ...]:
    """Compute the figures of inside and upstream, notch frequencies times factor."""
    return tuple(_row(placement, factor) for placement in placements(task, factor)[1:])


def sampled(task: NotchTask, period_s: float) -> tuple[SampledNotch, ...]:
    """Discretise both notches at a sample time.

    Raises BeyondNyquist for a notch at or above the Nyquist frequency, ServoError for a sample time
    out of bounds.
    """
    check_period(period_s)
    return tuple(_sampled(name, notch, period_s) for name, notch in task.notches().items())


def _row(placement: Placement, factor: float) -> NotchRow:
    name, notch, speed, position, position_opened = placement
    inner = speed.analysis.margins
    outer = margins(position_opened)
    motor = step_response(position, "motor_torque")
    load = step_response(position, "load_torque")
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


def _sampled(name: str, notch: Notch, period_s: float) -> SampledNotch:
    w = notch.frequency_rad_s
    return SampledNotch(
        name=name,
        frequency_rad_s=w,
        unwarped_rad_s=notch.digital_frequency_rad_s(period_s),
        depth=notch.depth,
        prewarped=_gain(notch.sampled(period_s, prewarp=True), w),
        unwarped=_gain(notch.sampled(period_s, prewarp=False), w),
    )


def _gain(system: Any, omega_rad_s: float) -> float:
    return abs(complex(system(complex(np.exp(1j * omega_rad_s * system.dt)))))
