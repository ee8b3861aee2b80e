"""Durations in which a motion leaves an undamped load at rest: the zeros of its acceleration spectrum."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from planners.errors import PlanError
from planners.spectra.spectrum import ComplexArray, transform
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

SIGN = 1e-100  # stands for an exact zero on the edge of a cycle, so that it is crossed once
CHEBYSHEV_NODES = 24  # over one cycle a spectrum has no finer detail: its 24th Chebyshev term is below (pi/4)^24 2 / 24! = 1e-26
FIRST = 0.01  # cycles; a move of so small a part of a period leaves swing
MOST_CYCLES = 1000.0
ZERO = 1e-11  # of the largest value in the same cycle
SLACK = 1e-12  # of most_cycles
SPECTRUM_ROUNDING_REL = 1e-14  # of the largest value at all, at one cycle
SAME = 1e-3  # cycles; turns closer than this that are all zeros are one multiple zero
RADIUS, POINTS = (
    0.25,
    24,
)  # of the circle that gives the Taylor series: its 24th term is below (pi/4)^24 / 24!
VANISHED = 1e-6  # of the largest Taylor term; what is below is zero at a multiple zero


def swing_free_cycles(
    trajectory: Trajectory, most_cycles: float = 6.0, least_cycles: float = FIRST
) -> FloatArray:
    """Every Omega = duration / load period, from least_cycles up to most_cycles, at which V'(Omega) = 0, increasing: (N,).

    They belong to the law, not to its duration or distance: 1.4303 for the cubic, 1.5 harmonic, 2 cycloidal. A multiple
    zero, near which a wrong period matters little, is given once, and so are two within 1e-5. A motion whose halves differ
    may have none.
    Raises PlanError unless 0.01 <= least_cycles < most_cycles <= 1000.
    """
    if not FIRST < most_cycles <= MOST_CYCLES:
        raise PlanError(
            f"most_cycles = {most_cycles}; must be > {FIRST} and <= {MOST_CYCLES:g}: a few load periods do"
        )
    if not FIRST <= least_cycles < most_cycles:
        raise PlanError(
            f"least_cycles = {least_cycles}; must be {FIRST} to most_cycles = {most_cycles}: begin lower"
        )
    wave = _Wave(trajectory)
    edges = np.append(np.arange(least_cycles, most_cycles, 1.0), most_cycles + FIRST)
    turns, zero = wave.turns(edges)
    multiple = np.array([wave.centre(place) for place in _means(turns[zero])])
    places = np.sort(np.concatenate([edges, turns[~zero], multiple]))
    values = wave.at(places)
    values[values == 0.0] = SIGN
    values[np.isin(places, multiple)] = 0.0
    crossings = [
        wave.crossing(a, b)
        for (a, va), (b, vb) in pairwise(zip(places, values, strict=True))
        if va * vb < 0.0
    ]
    zeros = np.sort(np.concatenate([multiple, crossings]))
    still = np.abs(wave.whole(zeros)) <= 1e-9 * np.abs(values).max()
    return np.asarray(zeros[still & (zeros <= most_cycles * (1.0 + SLACK))])


def swing_free_durations_s(
    trajectory: Trajectory, natural_frequency_rad_s: float, most_s: float
) -> FloatArray:
    """Durations up to most_s to which the motion may be slowed or hastened to leave an undamped load at rest: (N,).

    Raises PlanError unless the frequency is finite and > 0, and as swing_free_cycles does.
    """
    if not 0.0 < natural_frequency_rad_s < math.inf:
        raise PlanError(
            f"natural_frequency_rad_s = {natural_frequency_rad_s}; must be finite and > 0: take the model's slowest mode"
        )
    period_s = 2.0 * math.pi / natural_frequency_rad_s
    return swing_free_cycles(trajectory, most_s / period_s) * period_s


class _Wave:
    """int v(t) exp(-j w (t - T/2)) dt over Omega = w T / (2 pi), and the part of it, real or imaginary, that a motion with
    equal or opposite halves fills alone."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        look = self.whole(np.arange(FIRST, 4.0, 0.25))
        self._turn = 1.0 if np.abs(look.real).max() >= np.abs(look.imag).max() else -1j

    def whole(self, cycles: FloatArray | ComplexArray) -> ComplexArray:
        """The transform of the speed [m] at cycles other than 0, same shape."""
        rates = 2j * math.pi / self._trajectory.duration_s * cycles
        return np.asarray(
            transform(self._trajectory, rates, self._trajectory.duration_s / 2.0) / rates
        )

    def at(self, cycles: FloatArray) -> FloatArray:
        """The part that counts."""
        return np.asarray((self._turn * self.whole(cycles)).real)

    def crossing(self, low: float, high: float) -> float:
        """The zero between two cycles with values of opposite sign."""
        from scipy.optimize import brentq

        return float(brentq(lambda x: float(self.at(np.array([x]))[0]), low, high, xtol=1e-14))

    def centre(self, near: float) -> float:
        """The place of a multiple zero: where the first derivative but one that does not vanish is zero."""
        circle = RADIUS * np.exp(2j * math.pi / POINTS * np.arange(POINTS))
        terms = np.fft.fft(self.whole(near + circle)) / POINTS  # Taylor coefficients x RADIUS^k
        m = int(np.flatnonzero(np.abs(terms) > VANISHED * np.abs(terms).max())[0])
        return near - RADIUS * float((terms[m - 1] / (m * terms[m])).real) if m else near

    def turns(self, edges: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Where the slope is zero, and whether the value is, too: between turns there is at most one zero."""
        from numpy.polynomial.chebyshev import chebder, chebpts1, chebroots, chebvander

        x = chebpts1(CHEBYSHEV_NODES)
        to_series = (
            chebvander(x, CHEBYSHEV_NODES - 1)
            * np.where(np.arange(CHEBYSHEV_NODES) == 0, 1.0, 2.0)
            / CHEBYSHEV_NODES
        )
        middles, halves = (edges[1:] + edges[:-1]) / 2.0, (edges[1:] - edges[:-1]) / 2.0
        values = self.at(middles[:, None] + halves[:, None] * x)  # (cycles, nodes)
        found, largest = [np.zeros(0)], [np.zeros(0)]
        for middle, half, row in zip(middles, halves, values, strict=True):
            roots = chebroots(chebder(row @ to_series))
            inside = roots.real[(np.abs(roots.real) <= 1.0 + SAME) & (np.abs(roots.imag) < SAME)]
            found.append(middle + half * inside)
            largest.append(np.full(inside.size, np.abs(row).max()))
        turns = np.concatenate(found)
        bound = np.maximum(
            ZERO * np.concatenate(largest),
            SPECTRUM_ROUNDING_REL * np.abs(values).max() / (1.0 + turns),
        )
        return turns, np.abs(self.at(turns)) <= bound


def _means(places: FloatArray) -> FloatArray:
    """The mean of each group of neighbours."""
    places = np.sort(places)
    groups = np.split(places, np.flatnonzero(np.diff(places) > SAME) + 1)
    return np.array([group.mean() for group in groups if group.size])
