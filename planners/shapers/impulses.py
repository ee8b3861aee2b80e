"""Impulses whose swings cancel: what they leave of a mode, how wide they forgive, one after the other.

A mode is its eigenvalue -zeta w + j w sqrt(1 - zeta^2), upper half plane. A step through the impulses A_i at t_i leaves of
it V = |sum A_i exp(rate (t_N - t_i))| of what an impulse of 1 at time 0 would leave (Singer & Seering 1990).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import PlanError
from planners.trajectories.pieces import ComplexArray, FloatArray

TOLERANCE = 0.05  # of the unshaped swing: what the extra-insensitive shapers may leave
COINCIDENT = 1e-12  # of the shaper's length; impulses closer than this are one
BAND_END = 4.0  # of the nominal frequency; a band that reaches so far counts as unbounded
BAND_STEP = 1e-4  # of the nominal frequency; a hump exceeds its samples by less than 1e-6


class Shaper(NamedTuple):
    """Impulses: amplitudes that sum to 1, and when they come."""

    amplitudes: FloatArray  # (n,)
    times_s: FloatArray  # (n,) from 0, increasing


def transform(shaper: Shaper, eigenvalues_1_s: ArrayLike) -> ComplexArray:
    """sum A_i exp(-rate t_i) for rates of any shape, in that shape; 0 where the shaper leaves no swing.

    Its absolute value is the shaped swing as a share of the unshaped one at the same instant (source 001).
    """
    rates = np.asarray(eigenvalues_1_s, dtype=np.complex128)
    return np.asarray(np.exp(-np.multiply.outer(rates, shaper.times_s)) @ shaper.amplitudes)


def residual(shaper: Shaper, eigenvalues_1_s: ArrayLike) -> FloatArray:
    """V on modes with these rates, any shape: swing at the last impulse over that of an impulse of 1 at the first one.

    Singer & Seering (1990): exp(-zeta w t_N) sqrt(C^2 + S^2).
    """
    rates = np.asarray(eigenvalues_1_s, dtype=np.complex128)
    return np.asarray(
        np.abs(
            np.exp(np.multiply.outer(rates, shaper.times_s[-1] - shaper.times_s))
            @ shaper.amplitudes
        )
    )


def insensitivity(
    design: Callable[[complex], Shaper], rate_1_s: complex, tolerance: float = TOLERANCE
) -> float:
    """Width of the band around the mode's frequency, as a share of it, in which V <= tolerance; the damping ratio is kept.

    0 when V exceeds the tolerance at the mode already, inf when the band reaches four times the frequency.
    Raises PlanError unless 0 < tolerance < 1.
    """
    from scipy.optimize import brentq

    if not 0.0 < tolerance < 1.0:
        raise PlanError(
            f"tolerance = {tolerance}; must be > 0 and < 1: give a share of the unshaped swing, e.g. 0.05"
        )
    shaper = design(rate_1_s)
    bound = tolerance * (1.0 + 1e-9)  # a hump that touches the tolerance stays inside

    def excess(ratio: float) -> float:
        return float(residual(shaper, ratio * rate_1_s)) - bound

    ratios = np.arange(0.0, BAND_END, BAND_STEP)
    outside = residual(shaper, np.multiply.outer(ratios, rate_1_s)) > bound
    if excess(1.0) > 0.0:
        return 0.0
    below, above = ratios[outside & (ratios < 1.0)], ratios[outside & (ratios > 1.0)]
    if not above.size:
        return math.inf
    edges = [
        brentq(excess, end, end + step, xtol=1e-13)
        for end, step in ((below[-1], BAND_STEP), (above[0], -BAND_STEP))
    ]
    return edges[1] - edges[0]


def convolve(*shapers: Shaper) -> Shaper:
    """One after the other: every product of amplitudes at the sum of the times; coinciding impulses are one."""
    amplitudes, times = np.ones(1), np.zeros(1)
    for shaper in shapers:
        amplitudes = np.outer(amplitudes, shaper.amplitudes).ravel()
        times = np.add.outer(times, shaper.times_s).ravel()
    return gathered(amplitudes, times, COINCIDENT * float(times.max()))


def gathered(amplitudes: FloatArray, times: FloatArray, gap: float) -> Shaper:
    """In order of time; of impulses no farther apart than the gap, all at the time of the first."""
    order = np.argsort(times, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(times[order]) > gap))
    return Shaper(np.add.reduceat(amplitudes[order], first), times[order][first])


def check_mode(rate_1_s: complex) -> None:
    """Raises PlanError unless the mode swings and does not grow."""
    if not (cmath.isfinite(rate_1_s) and rate_1_s.imag > 0.0 >= rate_1_s.real):
        raise PlanError(
            f"rate_1_s = {rate_1_s} of a mode; must have an imaginary part > 0 and a real part <= 0, both finite: "
            "a mode that does not swing needs no shaper, one that grows is not a hanging load"
        )
