"""Setpoints shaped as a drive runs it: a delay line, and impulses that fall on its samples and still leave no swing.

An impulse between two samples is divided so that the mode cannot tell the difference: with rate = s + j w, x = its time after
the earlier sample and h the sample time,

    e^(-s x) sin(w (h - x)) / sin(w h)  at the earlier,  e^(s (h - x)) sin(w x) / sin(w h)  at the later sample

make the same swing (the digital shaper of Murphy & Watanabe 1992, for any impulses). Divided by their sum afterwards,
V = 0 stays 0 to rounding and amplitudes keep their sign. Divided in proportion, x / h and 1 - x / h, an impulse A would miss by
up to A (w h)^2 / 8: 0.125 % at w h = 0.1. What changes here is second order too, but only beside the mode. It does not matter
whether setpoints are held between samples or joined by lines.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planners.errors import unknown_name
from planners.shapers import SHAPERS, Shaper, convolve, insensitivity, residual
from planners.trajectories.pieces import FloatArray
from rig.drives.servo.block import check_period
from rig.drives.servo.errors import (
    BeyondNyquist,
    ServoError,
    check_below_nyquist,
    check_datum,
    check_range,
)
from rig.drives.servo.loops import PolePair
from rig.drives.servo.setpoint import MotorSetpoint

MAX_DAMPING = 0.99  # of a mode; one that swings less needs no shaper
MAX_DELAY_SAMPLES = 1_000_000  # of delay
SAMPLE_TOLERANCE = 1e-6  # of the sample time; an impulse nearer to a sample is there
MIN_AMPLITUDE_SUM = (
    0.5  # of divided amplitudes; those of positive ones sum to 1 or more without damping
)
NEGLIGIBLE_SWING_REL = (
    1e-13  # of the largest swing an impulse makes; one that makes less is left out
)


class ShaperFacts(NamedTuple):
    """What a shaper does to one mode, see planners.shapers."""

    residual: float  # V at the mode
    insensitivity: (
        float  # width of the band around the mode's frequency, as a share of it, in which V <= 5 %
    )
    duration_s: float


def eigenvalue_1_s(mode: PolePair) -> complex:
    """The mode's eigenvalue -zeta w + j w sqrt(1 - zeta^2). Raises ServoError for a mode that hardly swings, or grows."""
    check_datum("frequency_rad_s", mode.frequency_rad_s)
    check_range("damping", mode.damping, 0.0, MAX_DAMPING, "what hardly swings needs no shaper")
    return mode.frequency_rad_s * complex(-mode.damping, math.sqrt(1.0 - mode.damping**2))


def design_shaper(name: str, modes: Sequence[PolePair], period_s: float) -> Shaper:
    """One of SHAPERS for each mode, on the samples, one after the other: V = 0 at every mode if the shaper has it so.

    Raises PlanError for an unknown name and for too much damping for this shaper, ServoError for modes that do not swing,
    BeyondNyquist for a sample time that is too long for one of them.
    """
    if name not in SHAPERS:
        raise unknown_name("shaper", name, SHAPERS)
    if not modes:
        raise ServoError(
            f"modes of shaper {name} = (); must be one or more: give those of the joint that swing"
        )
    return convolve(
        *(place_on_samples(SHAPERS[name](eigenvalue_1_s(mode)), mode, period_s) for mode in modes)
    )


def place_on_samples(shaper: Shaper, mode: PolePair, period_s: float) -> Shaper:
    """The shaper with its impulses on whole sample times, up to twice as many; at most a sample longer.

    What it leaves of the mode, against no shaper at the same instant, is what the shaper itself does over the sum of the
    divided amplitudes. Raises BeyondNyquist, and ServoError for a delay of more than MAX_DELAY_SAMPLES.
    """
    check_period(period_s)
    rate = eigenvalue_1_s(mode)
    check_below_nyquist("damped frequency of a shaper's mode", rate.imag, period_s, "sample faster")
    check_range(
        "samples of delay",
        float(shaper.times_s[-1] / period_s),
        0.0,
        MAX_DELAY_SAMPLES,
        "sample slower",
    )
    line = _split_impulses(shaper, rate, period_s)
    total = float(line.sum())
    if not total > MIN_AMPLITUDE_SUM:
        raise BeyondNyquist(
            f"impulses of both signs on samples of {period_s:g} s sum to {total:.4g}; must be > {MIN_AMPLITUDE_SUM:g}: sample faster, "
            "or take zv, which has no negative ones"
        )
    swings = np.abs(line) * np.exp(-rate.real * period_s * np.arange(line.size))
    kept = np.flatnonzero(swings > NEGLIGIBLE_SWING_REL * swings.max())
    return Shaper(line[kept] / total, period_s * kept.astype(np.float64))


def _split_impulses(shaper: Shaper, rate_1_s: complex, period_s: float) -> FloatArray:
    """An amplitude for every sample up to the one after the last impulse."""
    decay, w = rate_1_s.real, rate_1_s.imag
    samples = shaper.times_s / period_s  # (n,)
    before = np.floor(samples).astype(np.intp)
    late_s = (samples - before) * period_s
    early_s, whole = period_s - late_s, math.sin(w * period_s)
    line: FloatArray = np.zeros(int(before[-1]) + 2)
    np.add.at(
        line, before, shaper.amplitudes * np.exp(-decay * late_s) * np.sin(w * early_s) / whole
    )
    np.add.at(
        line, before + 1, shaper.amplitudes * np.exp(decay * early_s) * np.sin(w * late_s) / whole
    )
    return line


def analyse_shaper(shaper: Shaper, mode: PolePair) -> ShaperFacts:
    """Of any shaper, on the samples or not, at one mode. Raises ServoError for a mode that does not swing."""
    rate = eigenvalue_1_s(mode)
    width = insensitivity(lambda _: shaper, rate)
    return ShaperFacts(float(residual(shaper, rate)), width, float(shaper.times_s[-1]))


class ShapedSetpoint:
    """The setpoint now and before, weighed by the shaper's impulses. Starts at rest at 0.

    A step touches the impulses alone, however long the delay.
    """

    def __init__(self, shaper: Shaper, period_s: float) -> None:
        """For a shaper of design_shaper() or place_on_samples() with this sample time. Raises ServoError for impulses between samples."""
        check_period(period_s)
        samples = shaper.times_s / period_s
        delays = np.rint(samples).astype(np.intp)
        off = int(np.argmax(np.abs(samples - delays)))
        if not abs(samples[off] - delays[off]) <= SAMPLE_TOLERANCE:
            raise ServoError(
                f"times_s = {shaper.times_s[off]} of impulse {off} is {samples[off]:.6f} samples of {period_s:g} s; "
                "must be a whole number: design the shaper for this sample time, or put it there with place_on_samples"
            )
        self._taps: list[tuple[float, int]] = list(
            zip(shaper.amplitudes.tolist(), delays.tolist(), strict=True)
        )
        self._line = [MotorSetpoint(0.0)] * (int(delays[-1]) + 1)  # a ring
        self._now = 0  # where the next setpoint goes; older ones lie before it

    def step(self, setpoint: MotorSetpoint) -> MotorSetpoint:
        """The shaped setpoint now, for the one that is asked for now."""
        line, now = self._line, self._now
        line[now] = setpoint
        angle = speed = acceleration = 0.0
        for amplitude, delay in self._taps:
            then = line[now - delay]  # an index below 0 counts from the end, as a ring does
            angle += amplitude * then[0]
            speed += amplitude * then[1]
            acceleration += amplitude * then[2]
        self._now = now + 1 if now + 1 < len(line) else 0
        return MotorSetpoint(angle, speed, acceleration)

    def reset(self) -> None:
        """Back to rest at 0."""
        self._line[:] = [MotorSetpoint(0.0)] * len(self._line)
        self._now = 0
