"""Impulses of an input shaper: residual vibration, insensitivity, convolution.

A mode is its eigenvalue mu = -zeta w + j w sqrt(1 - zeta^2), upper half plane. The residual
vibration V = |sum A_i exp(mu (t_N - t_i))| of the impulses A_i at t_i is a share of that of an
impulse of 1 at time 0 (Singer & Seering 1990).
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

RESIDUAL_TOLERANCE = 0.05  # residual vibration V of the extra-insensitive shapers
COINCIDENT_REL = 1e-12  # of the shaper's length; impulses closer than this are merged
BAND_END = 4.0  # of the nominal frequency; a band that extends so far counts as unbounded
BAND_STEP = 1e-4  # of the nominal frequency; a hump exceeds its samples by less than 1e-6


class Shaper(NamedTuple):
    """Impulses of an input shaper: amplitudes that sum to 1, at times."""

    amplitudes: FloatArray  # (n,)
    times_s: FloatArray  # (n,) from 0, increasing


def transform(shaper: Shaper, eigenvalues_1_s: ArrayLike) -> ComplexArray:
    """Compute sum A_i exp(-mu t_i) for eigenvalues mu of any shape, in that shape.

    Zero where the residual vibration is zero. Its absolute value is the shaped swing as a share of
    the unshaped one at the same instant (source 001).
    """
    mu = np.asarray(eigenvalues_1_s, dtype=np.complex128)
    return np.asarray(np.exp(-np.multiply.outer(mu, shaper.times_s)) @ shaper.amplitudes)


def residual(shaper: Shaper, eigenvalues_1_s: ArrayLike) -> FloatArray:
    """Compute the residual vibration V of modes with these eigenvalues, in their shape.

    Swing at the last impulse over that of an impulse of 1 at the first one. Singer & Seering
    (1990): exp(-zeta w t_N) sqrt(C^2 + S^2).
    """
    mu = np.asarray(eigenvalues_1_s, dtype=np.complex128)
    waves = np.exp(np.multiply.outer(mu, shaper.times_s[-1] - shaper.times_s))
    return np.asarray(np.abs(waves @ shaper.amplitudes))


def insensitivity(
    design: Callable[[complex], Shaper],
    eigenvalue_1_s: complex,
    tolerance: float = RESIDUAL_TOLERANCE,
) -> float:
    """Compute the range of relative frequency error in which V <= tolerance.

    The damping ratio is constant. 0 when V exceeds the tolerance at the mode itself, inf when the
    band extends to four times the frequency. Raises PlanError unless 0 < tolerance < 1.
    """
    from scipy.optimize import brentq

    if not 0.0 < tolerance < 1.0:
        raise PlanError(
            f"tolerance = {tolerance}; must be > 0 and < 1: "
            "give a share of the unshaped swing, e.g. 0.05"
        )
    shaper = design(eigenvalue_1_s)
    bound = tolerance * (1.0 + 1e-9)  # a hump that touches the tolerance stays inside

    def excess(ratio: float) -> float:
        return float(residual(shaper, ratio * eigenvalue_1_s)) - bound

    ratios = np.arange(0.0, BAND_END, BAND_STEP)
    outside = residual(shaper, np.multiply.outer(ratios, eigenvalue_1_s)) > bound
    if excess(1.0) > 0.0:
        return 0.0
    below, above = ratios[outside & (ratios < 1.0)], ratios[outside & (ratios > 1.0)]
    if not above.size:
        return math.inf
    lower = brentq(excess, below[-1], below[-1] + BAND_STEP, xtol=1e-13)
    upper = brentq(excess, above[0], above[0] - BAND_STEP, xtol=1e-13)
    return upper - lower


def convolve(*shapers: Shaper) -> Shaper:
    """Convolve shapers: products of amplitudes at sums of times; coinciding impulses are merged."""
    amplitudes, times = np.ones(1), np.zeros(1)
    for shaper in shapers:
        amplitudes = np.outer(amplitudes, shaper.amplitudes).ravel()
        times = np.add.outer(times, shaper.times_s).ravel()
    return merge_impulses(amplitudes, times, COINCIDENT_REL * float(times.max()))


def merge_impulses(amplitudes: FloatArray, times: FloatArray, gap: float) -> Shaper:
    """Sort impulses by time; merge those within the gap at the time of the first."""
    order = np.argsort(times, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(times[order]) > gap))
    return Shaper(np.add.reduceat(amplitudes[order], first), times[order][first])


def check_mode(eigenvalue_1_s: complex) -> None:
    """Raise PlanError unless the mode is oscillatory and not unstable."""
    if not (cmath.isfinite(eigenvalue_1_s) and eigenvalue_1_s.imag > 0.0 >= eigenvalue_1_s.real):
        raise PlanError(
            f"eigenvalue_1_s = {eigenvalue_1_s} of a mode; must have an imaginary part > 0 and a "
            "real part <= 0, both finite: "
            "an overdamped mode needs no shaper, an unstable one is not a hanging load"
        )
