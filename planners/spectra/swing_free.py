"""Zero-residual-vibration durations for an undamped load: zeros of the acceleration spectrum."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from planners.errors import PlanError
from planners.spectra.spectrum import transform
from planners.trajectories.pieces import ComplexArray, FloatArray
from planners.trajectories.trajectory import Trajectory

MIN_CYCLES = 0.01  # a move of so small a part of a period has no zero
MAX_CYCLES = 1000.0
EDGE_VALUE = 1e-100  # in place of an exact zero on the edge of a cycle, so that it is crossed once
CHEBYSHEV_NODES = 24  # per cycle: the 24th term of a spectrum is below (pi/4)^24 2 / 24! = 1e-26
ZERO_REL = 1e-11  # of the largest value in the same cycle: a zero
SPECTRUM_ROUNDING_REL = 1e-14  # of the largest value at all, at one cycle
CONFIRMED_ZERO_REL = 1e-9  # of the largest value, for the whole transform at a zero of its part
MAX_CYCLES_EXCESS_REL = 1e-12  # of most_cycles; a zero above it by less is given
MERGED_CYCLES = 1e-3  # stationary zeros closer than this are one multiple zero
TAYLOR_RADIUS = 0.25  # of the circle that gives the Taylor series [cycles]
TAYLOR_POINTS = 24  # on it: the 24th term is below (pi/4)^24 / 24!
VANISHED_REL = 1e-6  # of the largest Taylor term; a smaller one is 0 at a multiple zero


def swing_free_cycles(
    trajectory: Trajectory, most_cycles: float = 6.0, least_cycles: float = MIN_CYCLES
) -> FloatArray:
    """Find every Omega = duration / modal period with V'(Omega) = 0, increasing: (N,).

    Searched from least_cycles to most_cycles. The zeros belong to the law, not to its duration
    or distance: 1.4303 for the cubic, 1.5 harmonic, 2 cycloidal. A multiple zero, which
    tolerates an error of the period, is given once, and so are two zeros within 1e-5. A motion
    whose halves differ may have none.
    Raises PlanError unless 0.01 <= least_cycles < most_cycles <= 1000.
    """
    if not MIN_CYCLES < most_cycles <= MAX_CYCLES:
        raise PlanError(
            f"most_cycles = {most_cycles}; must be > {MIN_CYCLES} and <= {MAX_CYCLES:g}: "
            "give a few modal periods"
        )
    if not MIN_CYCLES <= least_cycles < most_cycles:
        raise PlanError(
            f"least_cycles = {least_cycles}; must be {MIN_CYCLES} to most_cycles = {most_cycles}: "
            "start lower"
        )
    spectrum = _SpeedSpectrum(trajectory)
    edges = np.append(np.arange(least_cycles, most_cycles, 1.0), most_cycles + MIN_CYCLES)
    stationary, zero = spectrum.stationary_points(edges)
    multiple = np.array([spectrum.multiple_zero(x) for x in _group_means(stationary[zero])])
    places = np.sort(np.concatenate([edges, stationary[~zero], multiple]))
    values = spectrum.at(places)
    values[values == 0.0] = EDGE_VALUE
    values[np.isin(places, multiple)] = 0.0
    crossings = []
    for (a, value_a), (b, value_b) in pairwise(zip(places, values, strict=True)):
        if value_a * value_b < 0.0:
            crossings.append(spectrum.zero_between(a, b))
    zeros = np.sort(np.concatenate([multiple, crossings]))
    confirmed = np.abs(spectrum.whole(zeros)) <= CONFIRMED_ZERO_REL * np.abs(values).max()
    within = zeros <= most_cycles * (1.0 + MAX_CYCLES_EXCESS_REL)
    return np.asarray(zeros[confirmed & within])


def swing_free_durations_s(
    trajectory: Trajectory, natural_frequency_rad_s: float, most_s: float
) -> FloatArray:
    """Find the zero-residual-vibration durations of a motion up to most_s, increasing: (N,).

    The motion stretched to one of them leaves an undamped load at rest.
    Raises PlanError unless the frequency is finite and > 0, and as swing_free_cycles does.
    """
    if not 0.0 < natural_frequency_rad_s < math.inf:
        raise PlanError(
            f"natural_frequency_rad_s = {natural_frequency_rad_s}; must be finite and > 0: "
            "give that of the slowest mode of the model"
        )
    period_s = 2.0 * math.pi / natural_frequency_rad_s
    return swing_free_cycles(trajectory, most_s / period_s) * period_s


class _SpeedSpectrum:
    """Transform int v(t) exp(-j w (t - T/2)) dt over Omega = w T / (2 pi).

    A motion with equal or opposite halves has only a real or only an imaginary part; zeros are
    searched in that part.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        samples = self.whole(np.arange(MIN_CYCLES, 4.0, 0.25))
        real_dominates = np.abs(samples.real).max() >= np.abs(samples.imag).max()
        self._rotation = 1.0 if real_dominates else -1j

    def whole(self, cycles: FloatArray | ComplexArray) -> ComplexArray:
        """Compute the transform of the speed [m] at cycles other than 0, same shape."""
        rates = 2j * math.pi / self._trajectory.duration_s * cycles
        return np.asarray(
            transform(self._trajectory, rates, self._trajectory.duration_s / 2.0) / rates
        )

    def at(self, cycles: FloatArray) -> FloatArray:
        """Compute the dominant part, real or imaginary."""
        return np.asarray((self._rotation * self.whole(cycles)).real)

    def zero_between(self, low: float, high: float) -> float:
        """Find the zero between two cycles with values of opposite sign."""
        from scipy.optimize import brentq

        return float(brentq(lambda x: float(self.at(np.array([x]))[0]), low, high, xtol=1e-14))

    def multiple_zero(self, near: float) -> float:
        """Find a multiple zero: the zero of the last derivative that vanishes there."""
        turn = 2j * math.pi / TAYLOR_POINTS
        circle = TAYLOR_RADIUS * np.exp(turn * np.arange(TAYLOR_POINTS))
        # Taylor coefficients x TAYLOR_RADIUS^k
        terms = np.fft.fft(self.whole(near + circle)) / TAYLOR_POINTS
        m = int(np.flatnonzero(np.abs(terms) > VANISHED_REL * np.abs(terms).max())[0])
        if m == 0:
            return near
        return near - TAYLOR_RADIUS * float((terms[m - 1] / (m * terms[m])).real)

    def stationary_points(self, edges: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Find the zeros of the slope, and mark those where the value is zero too.

        Between two neighbours there is at most one zero.
        """
        from numpy.polynomial.chebyshev import chebder, chebpts1, chebroots, chebvander

        x = chebpts1(CHEBYSHEV_NODES)
        weights = np.where(np.arange(CHEBYSHEV_NODES) == 0, 1.0, 2.0)
        to_series = chebvander(x, CHEBYSHEV_NODES - 1) * weights / CHEBYSHEV_NODES
        middles = (edges[1:] + edges[:-1]) / 2.0
        halves = (edges[1:] - edges[:-1]) / 2.0
        values = self.at(middles[:, None] + halves[:, None] * x)  # (cycles, nodes)
        found, largest = [np.zeros(0)], [np.zeros(0)]
        for middle, half, row in zip(middles, halves, values, strict=True):
            roots = chebroots(chebder(row @ to_series))
            is_real = np.abs(roots.imag) < MERGED_CYCLES
            inside = roots.real[(np.abs(roots.real) <= 1.0 + MERGED_CYCLES) & is_real]
            found.append(middle + half * inside)
            largest.append(np.full(inside.size, np.abs(row).max()))
        points = np.concatenate(found)
        rounding = SPECTRUM_ROUNDING_REL * np.abs(values).max() / (1.0 + points)
        bound = np.maximum(ZERO_REL * np.concatenate(largest), rounding)
        return points, np.abs(self.at(points)) <= bound


def _group_means(places: FloatArray) -> FloatArray:
    """Compute the mean of each group of neighbours closer than MERGED_CYCLES."""
    places = np.sort(places)
    groups = np.split(places, np.flatnonzero(np.diff(places) > MERGED_CYCLES) + 1)
    return np.array([group.mean() for group in groups if group.size])
