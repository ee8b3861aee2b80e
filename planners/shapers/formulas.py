"""Input shapers of one mode: by formula, or by their defining conditions if damped."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from planners.errors import PlanError
from planners.shapers.impulses import RESIDUAL_TOLERANCE, Shaper, check_mode
from planners.trajectories.pieces import FloatArray

# Largest damping ratio of a shaper; near it the last impulses coincide.
MAX_DAMPING_RATIO = {"ei": 0.5, "ei_two_hump": 0.35, "ei_three_hump": 0.25, "um_zv": 0.9}
# Step of real over imaginary part from one solution to the next; with steps of 0.1 some shapers
# converge to another solution.
DAMPING_STEP = 0.02
MAX_CONDITION_ERROR = 1e-12  # of a defining condition, as a share of the unshaped swing
DAMPING_ROUNDING = 1e-12  # of a damping ratio computed from an eigenvalue

# Errors of the defining conditions for (unknowns, eigenvalue), one each.
ConditionErrors: TypeAlias = Callable[[FloatArray, complex], FloatArray]


def zero_vibration(eigenvalue_1_s: complex, derivatives: int = 0) -> Shaper:
    """Make V and its first `derivatives` derivatives by frequency 0 at the mode.

    derivatives + 2 impulses. Binomial amplitudes, reduced in each half damped period by
    K = exp(-pi zeta / sqrt(1 - zeta^2)) (Singer & Seering 1990). Raises PlanError unless the mode
    is oscillatory and not unstable, as every shaper in this file does.
    """
    check_mode(eigenvalue_1_s)
    if derivatives < 0:
        raise PlanError(f"derivatives = {derivatives} of a shaper; must be >= 0: 0 is zv, 1 is zvd")
    n = derivatives + 1
    decay = math.exp(math.pi * eigenvalue_1_s.real / eigenvalue_1_s.imag)
    weights = np.array([math.comb(n, i) * decay**i for i in range(n + 1)])
    return Shaper(weights / (1.0 + decay) ** n, math.pi / eigenvalue_1_s.imag * np.arange(n + 1.0))


def zv(eigenvalue_1_s: complex) -> Shaper:
    """Compute the zero-vibration shaper, half a damped period (Singer & Seering 1990)."""
    return zero_vibration(eigenvalue_1_s, 0)


def zvd(eigenvalue_1_s: complex) -> Shaper:
    """Compute the shaper with one zero derivative, one damped period (Singer & Seering 1990)."""
    return zero_vibration(eigenvalue_1_s, 1)


def zvdd(eigenvalue_1_s: complex) -> Shaper:
    """Compute the shaper with two zero derivatives, 1.5 damped periods (Singer & Seering 1990)."""
    return zero_vibration(eigenvalue_1_s, 2)


def zvddd(eigenvalue_1_s: complex) -> Shaper:
    """Compute the shaper with three zero derivatives, 2 damped periods (Singer & Seering 1990)."""
    return zero_vibration(eigenvalue_1_s, 3)


def mzv(eigenvalue_1_s: complex) -> Shaper:
    """Compute the modified zero-vibration shaper, for any damping ratio below 1.

    Three impulses, equally spaced over three quarters of a damped period. The residual vibration is
    zero if the polynomial with these coefficients is 0 at exp(-eigenvalue x spacing), and so at its
    conjugate.
    """
    check_mode(eigenvalue_1_s)
    spacing_s = 0.75 * math.pi / eigenvalue_1_s.imag
    z = cmath.exp(eigenvalue_1_s * spacing_s)
    weights = np.array([1.0, -2.0 * z.real, abs(z) ** 2])
    return Shaper(weights / weights.sum(), spacing_s * np.arange(3.0))


def ei(eigenvalue_1_s: complex) -> Shaper:
    """Compute the extra-insensitive shaper: V = 5 % at the mode and 0 on both sides of it.

    Singhose, Seering & Singer 1994.
    """
    v = RESIDUAL_TOLERANCE
    return _humped("ei", eigenvalue_1_s, [(1.0 + v) / 4.0, (1.0 - v) / 2.0, (1.0 + v) / 4.0])


def ei_two_hump(eigenvalue_1_s: complex) -> Shaper:
    """Compute the two-hump shaper: V = 0 at the mode, humps of 5 % on both sides, zeros beyond.

    Singhose, Porter & Singer 1995. The curve fits in damping that are in wide use reach 5.4 %
    without damping and leave 0.3 % at the mode; these solutions do not.
    """
    v = RESIDUAL_TOLERANCE
    x = math.cbrt(v * v * (math.sqrt(1.0 - v * v) + 1.0))
    a = (3.0 * x * x + 2.0 * x + 3.0 * v * v) / (16.0 * x)
    return _humped("ei_two_hump", eigenvalue_1_s, [a, 0.5 - a, 0.5 - a, a])


def ei_three_hump(eigenvalue_1_s: complex) -> Shaper:
    """Compute the three-hump shaper: humps of V = 5 % at the mode and on both sides.

    With zeros between them (Singhose, Porter & Singer 1995).
    """
    v = RESIDUAL_TOLERANCE
    a = (1.0 + 3.0 * v + 2.0 * math.sqrt(2.0 * (v * v + v))) / 16.0
    b = (1.0 - v) / 4.0
    return _humped("ei_three_hump", eigenvalue_1_s, [a, b, 1.0 - 2.0 * (a + b), b, a])


def um_zv(eigenvalue_1_s: complex) -> Shaper:
    """Compute the unity-magnitude shaper +1 -1 +1: a third of a period long without damping.

    Singhose, Singer & Seering 1997. With damping the two times solve V = 0. Shorter than zv, but it
    excites faster modes, and may exceed limits that the unshaped move keeps.
    """
    amplitudes = np.array([1.0, -1.0, 1.0])

    def errors(x: FloatArray, eigenvalue: complex) -> FloatArray:
        residual = np.exp(eigenvalue * (x[1] - np.array([0.0, *x]))) @ amplitudes
        return np.array([residual.real, residual.imag])

    start = np.array([1.0, 2.0]) * math.pi / 3.0
    times = _continue_in_damping("um_zv", eigenvalue_1_s, errors, start)
    return Shaper(amplitudes, np.array([0.0, *times]) / eigenvalue_1_s.imag)


def _humped(name: str, eigenvalue_1_s: complex, amplitudes: Sequence[float]) -> Shaper:
    """Compute a shaper with n humps of RESIDUAL_TOLERANCE between n + 1 zeros.

    The middle hump or zero is at the mode. Undamped, the n + 2 impulses have the given amplitudes,
    half a period apart; with damping, the same conditions are solved for amplitudes, times and
    frequencies.
    """
    undamped = np.array(amplitudes)
    n = len(amplitudes) - 2
    extrema = _zeros_and_humps(undamped)  # (2n + 1,) zero, hump, zero, ...

    def errors(x: FloatArray, eigenvalue: complex) -> FloatArray:
        a, times, ratios = np.split(x, [n + 2, 2 * n + 3])
        lags = eigenvalue * (times[-1] - np.append(0.0, times))
        waves = np.exp(np.multiply.outer(np.insert(ratios, n, 1.0), lags))
        v, slopes = waves @ a, waves @ (a * lags)
        zeros, humps = v[::2], v[1::2]
        heights = np.abs(humps) ** 2 / RESIDUAL_TOLERANCE - RESIDUAL_TOLERANCE
        hump_slopes = (humps.conj() * slopes[1::2]).real / RESIDUAL_TOLERANCE
        return np.concatenate([[a.sum() - 1.0], zeros.real, zeros.imag, heights, hump_slopes])

    start = np.concatenate([undamped, math.pi * np.arange(1.0, n + 2.0), np.delete(extrema, n)])
    x = _continue_in_damping(name, eigenvalue_1_s, errors, start)
    a, times, ratios = np.split(x, [n + 2, 2 * n + 3])
    if np.any(np.diff(np.insert(ratios, n, 1.0)) <= 0.0) or np.any(np.diff(times) <= 0.0):
        raise _not_found(name, eigenvalue_1_s)
    return Shaper(a, np.append(0.0, times) / eigenvalue_1_s.imag)


def _zeros_and_humps(amplitudes: FloatArray) -> FloatArray:
    """Find the frequency ratios, within 0..2, of the zeros and humps of an undamped shaper: sorted.

    Its impulses are symmetric and half a period apart. With z = exp(-j pi ratio) the ratios are the
    roots on the unit circle of sum A_i z^i and sum A_i (i - N/2) z^i.
    """
    powers = np.arange(len(amplitudes)) - (len(amplitudes) - 1) / 2.0
    roots = np.concatenate([np.roots(amplitudes), np.roots(amplitudes * powers)])
    return np.sort(np.angle(roots[np.abs(roots - 1.0) > 1e-6]) / math.pi % 2.0)


def _continue_in_damping(
    name: str, eigenvalue_1_s: complex, errors: ConditionErrors, start: FloatArray
) -> FloatArray:
    """Solve errors(x, eigenvalue) = 0 for a mode of damped frequency 1.

    By continuation from the undamped solution as the damping grows. Raises PlanError beyond
    MAX_DAMPING_RATIO.
    """
    check_mode(eigenvalue_1_s)
    damping_ratio = -eigenvalue_1_s.real / abs(eigenvalue_1_s)
    bound = MAX_DAMPING_RATIO[name]
    if damping_ratio > bound + DAMPING_ROUNDING:
        raise PlanError(
            f"damping ratio {damping_ratio:.6g} for shaper {name}; must be <= {bound:g}: "
            "take zvd or mzv"
        )
    if damping_ratio == 0.0:
        return start
    from scipy.optimize import root

    goal = eigenvalue_1_s.real / eigenvalue_1_s.imag
    x = start
    for real in np.linspace(0.0, goal, 1 + math.ceil(-goal / DAMPING_STEP))[1:]:
        x = root(errors, x, args=(complex(real, 1.0),), tol=1e-15).x
    if np.max(np.abs(errors(x, complex(goal, 1.0)))) > MAX_CONDITION_ERROR:
        raise _not_found(name, eigenvalue_1_s)
    return x


def _not_found(name: str, eigenvalue_1_s: complex) -> PlanError:
    return PlanError(
        f"shaper {name} for the mode {eigenvalue_1_s} 1/s did not converge to "
        f"{MAX_CONDITION_ERROR:g}: take zvd or mzv"
    )
