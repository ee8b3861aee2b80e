"""One mode's shapers by the literature's formulas; with damping, by their defining conditions."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from planners.errors import PlanError
from planners.shapers.impulses import TOLERANCE, Shaper, check_mode
from planners.trajectories.pieces import FloatArray

MOST_DAMPING = {
    "ei": 0.5,
    "ei_two_hump": 0.35,
    "ei_three_hump": 0.25,
    "um_zv": 0.9,
}  # near it the last impulses meet
DAMPING_STEP = 0.02  # of real to imaginary part, from one solution to the next; at 0.1 another solution catches some
EXACT = 1e-12  # largest error of a defining condition, as a share of the unshaped swing
DAMPING_ROUNDING = 1e-12  # of a damping ratio that was taken from a rate

Conditions: TypeAlias = Callable[
    [FloatArray, complex], FloatArray
]  # (unknowns, rate) -> one error each


def zero_vibration(rate_1_s: complex, derivatives: int = 0) -> Shaper:
    """V and its first `derivatives` derivatives by frequency are 0 at the mode; derivatives + 2 impulses.

    Binomial amplitudes, each half damped period weakened by K = exp(-pi zeta / sqrt(1 - zeta^2)) (Singer & Seering 1990).
    Raises PlanError unless the mode swings and does not grow, as every shaper here does.
    """
    check_mode(rate_1_s)
    if derivatives < 0:
        raise PlanError(f"derivatives = {derivatives} of a shaper; must be >= 0: 0 is zv, 1 is zvd")
    n = derivatives + 1
    decay = math.exp(math.pi * rate_1_s.real / rate_1_s.imag)
    weights = np.array([math.comb(n, i) * decay**i for i in range(n + 1)])
    return Shaper(weights / (1.0 + decay) ** n, math.pi / rate_1_s.imag * np.arange(n + 1.0))


def zv(rate_1_s: complex) -> Shaper:
    """Zero vibration, half a damped period (Singer & Seering 1990)."""
    return zero_vibration(rate_1_s, 0)


def zvd(rate_1_s: complex) -> Shaper:
    """Zero vibration and derivative, one damped period (Singer & Seering 1990)."""
    return zero_vibration(rate_1_s, 1)


def zvdd(rate_1_s: complex) -> Shaper:
    """Zero vibration and two derivatives, three half damped periods (Singer & Seering 1990)."""
    return zero_vibration(rate_1_s, 2)


def zvddd(rate_1_s: complex) -> Shaper:
    """Zero vibration and three derivatives, two damped periods (Singer & Seering 1990)."""
    return zero_vibration(rate_1_s, 3)


def mzv(rate_1_s: complex) -> Shaper:
    """Modified zero vibration: three impulses evenly over three quarters of a damped period; any damping below 1.

    There is no swing when the polynomial with these coefficients is 0 at exp(-rate spacing), and so at its conjugate.
    """
    check_mode(rate_1_s)
    spacing_s = 0.75 * math.pi / rate_1_s.imag
    z = cmath.exp(rate_1_s * spacing_s)
    weights = np.array([1.0, -2.0 * z.real, abs(z) ** 2])
    return Shaper(weights / weights.sum(), spacing_s * np.arange(3.0))


def ei(rate_1_s: complex) -> Shaper:
    """Extra-insensitive: V = 5 % at the mode and 0 on both sides of it (Singhose, Seering & Singer 1994)."""
    v = TOLERANCE
    return _humped("ei", rate_1_s, [(1.0 + v) / 4.0, (1.0 - v) / 2.0, (1.0 + v) / 4.0])


def ei_two_hump(rate_1_s: complex) -> Shaper:
    """V = 0 at the mode, with a hump of 5 % on both sides and a zero beyond (Singhose, Porter & Singer 1995).

    The fits in damping that are in wide use reach 5.4 % without damping and leave 0.3 % at the mode; these do not.
    """
    v = TOLERANCE
    x = math.cbrt(v * v * (math.sqrt(1.0 - v * v) + 1.0))
    a = (3.0 * x * x + 2.0 * x + 3.0 * v * v) / (16.0 * x)
    return _humped("ei_two_hump", rate_1_s, [a, 0.5 - a, 0.5 - a, a])


def ei_three_hump(rate_1_s: complex) -> Shaper:
    """A hump of V = 5 % at the mode and one more on both sides, with zeros between (Singhose, Porter & Singer 1995)."""
    v = TOLERANCE
    a, b = (1.0 + 3.0 * v + 2.0 * math.sqrt(2.0 * (v * v + v))) / 16.0, (1.0 - v) / 4.0
    return _humped("ei_three_hump", rate_1_s, [a, b, 1.0 - 2.0 * (a + b), b, a])


def um_zv(rate_1_s: complex) -> Shaper:
    """Unity magnitude, +1 -1 +1: over in a third of a period without damping (Singhose, Singer & Seering 1997).

    With damping the two times solve V = 0. Shorter than zv, but it excites faster modes, and exceeds limits that the
    unshaped move keeps.
    """
    amplitudes = np.array([1.0, -1.0, 1.0])

    def conditions(x: FloatArray, rate: complex) -> FloatArray:
        left = np.exp(rate * (x[1] - np.array([0.0, *x]))) @ amplitudes
        return np.array([left.real, left.imag])

    times = _follow("um_zv", rate_1_s, conditions, np.array([1.0, 2.0]) * math.pi / 3.0)
    return Shaper(amplitudes, np.array([0.0, *times]) / rate_1_s.imag)


def _humped(name: str, rate_1_s: complex, amplitudes: Sequence[float]) -> Shaper:
    """n humps of TOLERANCE between n + 1 zeros, the middle one at the mode, with n + 2 impulses half a period apart.

    That is the undamped shaper; with damping, the same conditions are solved for amplitudes, times and frequencies.
    """
    undamped, n = np.array(amplitudes), len(amplitudes) - 2
    nodes = _nodes(undamped)  # (2n + 1,) zero, hump, zero, ...

    def conditions(x: FloatArray, rate: complex) -> FloatArray:
        a, times, ratios = np.split(x, [n + 2, 2 * n + 3])
        lags = rate * (times[-1] - np.append(0.0, times))
        waves = np.exp(np.multiply.outer(np.insert(ratios, n, 1.0), lags))
        v, slopes = waves @ a, waves @ (a * lags)
        zeros, humps = v[::2], v[1::2]
        heights = np.abs(humps) ** 2 / TOLERANCE - TOLERANCE
        flat = (humps.conj() * slopes[1::2]).real / TOLERANCE
        return np.concatenate([[a.sum() - 1.0], zeros.real, zeros.imag, heights, flat])

    start = np.concatenate([undamped, math.pi * np.arange(1.0, n + 2.0), np.delete(nodes, n)])
    a, times, ratios = np.split(_follow(name, rate_1_s, conditions, start), [n + 2, 2 * n + 3])
    if np.any(np.diff(np.insert(ratios, n, 1.0)) <= 0.0) or np.any(np.diff(times) <= 0.0):
        raise _not_found(name, rate_1_s)
    return Shaper(a, np.append(0.0, times) / rate_1_s.imag)


def _nodes(amplitudes: FloatArray) -> FloatArray:
    """Frequency ratios, within 0..2, of the zeros and humps of undamped impulses half a period apart, symmetric: sorted.

    With z = exp(-j pi ratio) they are the roots on the unit circle of sum A_i z^i and sum A_i (i - N/2) z^i.
    """
    powers = np.arange(len(amplitudes)) - (len(amplitudes) - 1) / 2.0
    roots = np.concatenate([np.roots(amplitudes), np.roots(amplitudes * powers)])
    return np.sort(np.angle(roots[np.abs(roots - 1.0) > 1e-6]) / math.pi % 2.0)


def _follow(name: str, rate_1_s: complex, conditions: Conditions, start: FloatArray) -> FloatArray:
    """Solution of conditions(x, rate) = 0 for a mode of damped frequency 1, from the undamped one as damping grows.

    Raises PlanError beyond MOST_DAMPING.
    """
    check_mode(rate_1_s)
    damping_ratio, most = -rate_1_s.real / abs(rate_1_s), MOST_DAMPING[name]
    if damping_ratio > most + DAMPING_ROUNDING:
        raise PlanError(
            f"damping ratio {damping_ratio:.6g} for shaper {name}; must be <= {most:g}: take zvd or mzv"
        )
    if damping_ratio == 0.0:
        return start
    from scipy.optimize import root

    goal = rate_1_s.real / rate_1_s.imag
    x = start
    for real in np.linspace(0.0, goal, 1 + math.ceil(-goal / DAMPING_STEP))[1:]:
        x = root(conditions, x, args=(complex(real, 1.0),), tol=1e-15).x
    if np.max(np.abs(conditions(x, complex(goal, 1.0)))) > EXACT:
        raise _not_found(name, rate_1_s)
    return x


def _not_found(name: str, rate_1_s: complex) -> PlanError:
    return PlanError(
        f"shaper {name} was not found for the mode {rate_1_s} 1/s to {EXACT:g}: take zvd or mzv"
    )
