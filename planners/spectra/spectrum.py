"""Acceleration spectrum of any trajectory, exact and without a singular frequency.

On a cell the acceleration is a Legendre series, and int_-1^1 P_n(x) exp(-j z x) dx =
2 (-j)^n j_n(z) with the spherical Bessel function j_n (DLMF 18.17.19). There is no divisor that
may vanish, so resonance needs no special case.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planners.errors import PlanError
from planners.trajectories.cells import Cells, resolve
from planners.trajectories.pieces import ComplexArray, FloatArray
from planners.trajectories.trajectory import Trajectory

MAX_HELD_FUNCTIONS = 500_000  # Bessel functions in one matrix
MAX_GROWTH_EXPONENT = 700.0  # of exp; 709 overflows
EXTRA_ORDERS = 25  # above the last one, where the continued fraction starts: its error is 1e-15
TINY_ARGUMENT = 1e-30  # |z| below which j_0 is 1 and the others are 0
COEFFICIENT_ROUNDING_REL = 4e-16  # of the largest coefficient; smaller last terms are dropped


def transform(
    trajectory: Trajectory, eigenvalues_1_s: ArrayLike, origin_s: float = 0.0
) -> ComplexArray:
    """Compute int a(t) exp(-rate (t - origin)) dt [m/s] for rates of any shape, in that shape.

    A step in speed is an impulse. rate = j w gives the Fourier transform. With the eigenvalue of
    a mode as rate and origin_s = duration_s it is the state of the mode q' = rate q + a at the
    end. Raises PlanError for a rate that is not finite, or too damped for its origin.
    """
    rates = np.asarray(eigenvalues_1_s, dtype=np.complex128)
    flat = rates.ravel()
    if not np.isfinite(flat).all():
        raise PlanError(
            f"rate {flat[~np.isfinite(flat)][0]} 1/s of a transform; must be finite: leave it out"
        )
    _check_growth(trajectory, flat, origin_s)
    total = _impulses(trajectory, flat, origin_s)
    for begin, piece in zip(trajectory.breaks_s.tolist(), trajectory.pieces, strict=False):
        cells = _trimmed(resolve(piece, 2))
        functions = max(1, flat.size) * cells.series.size
        blocks = np.array_split(flat, math.ceil(functions / MAX_HELD_FUNCTIONS))
        total += np.concatenate([_integral(cells, begin - origin_s, block) for block in blocks])
    return total.reshape(rates.shape)


def spectrum(trajectory: Trajectory, frequencies_rad_s: ArrayLike) -> FloatArray:
    """Compute the acceleration spectrum V(w) = |int a exp(-j w t) dt| / pi [m/s], any shape.

    Then a(t) = int_0^inf V cos(w t + phi) dw (source 000, spectrum of acceleration). pi V(w)/w is
    the residual amplitude of an undamped load of frequency w. A move of h times the distance has
    h times V; lambda times as fast it has lambda V(w / lambda).
    """
    w = np.asarray(frequencies_rad_s, dtype=np.float64)
    return np.asarray(np.abs(transform(trajectory, 1j * w)) / math.pi)


def spectrum_by_cycles(trajectory: Trajectory, cycles: ArrayLike) -> FloatArray:
    """Compute V'(Omega) = V(2 pi Omega / T) [m/s]; cycles Omega = periods in the duration."""
    omega = np.asarray(cycles, dtype=np.float64)
    return spectrum(trajectory, 2.0 * math.pi / trajectory.duration_s * omega)


def _check_growth(trajectory: Trajectory, eigenvalues_1_s: ComplexArray, origin_s: float) -> None:
    """Raise PlanError when exp(-rate (t - origin)) would overflow."""
    exponents = (-eigenvalues_1_s.real * (end - origin_s) for end in (0.0, trajectory.duration_s))
    most = max((float(e.max()) for e in exponents if e.size), default=0.0)
    if most > MAX_GROWTH_EXPONENT:
        raise PlanError(
            f"exp(-rate (t - origin)) reaches exp({most:.4g}); must be "
            f"<= exp({MAX_GROWTH_EXPONENT:.0f}): set origin_s to the end towards which "
            "the load decays"
        )


def _impulses(
    trajectory: Trajectory, eigenvalues_1_s: ComplexArray, origin_s: float
) -> ComplexArray:
    steps = speed_steps(trajectory)
    total = np.zeros_like(eigenvalues_1_s)
    for k in np.flatnonzero(steps):
        total += steps[k] * np.exp(-eigenvalues_1_s * (trajectory.breaks_s[k] - origin_s))
    return total


def speed_steps(trajectory: Trajectory) -> FloatArray:
    """Compute the steps in speed [m/s] at joints and against rest at both ends: (pieces + 1,)."""
    rows = [piece.at(np.array([0.0, piece.duration_s]), 1) for piece in trajectory.pieces]
    ends = np.array(rows)  # (pieces, 2)
    return np.asarray(np.append(ends[:, 0], 0.0) - np.insert(ends[:, 1], 0, 0.0))


def _trimmed(cells: Cells) -> Cells:
    """Drop the last terms that are rounding."""
    sizes = np.abs(cells.series).max(axis=0)
    terms = 1
    if sizes.any():
        significant = np.flatnonzero(sizes > COEFFICIENT_ROUNDING_REL * sizes.max())
        terms = int(significant[-1]) + 1
    return cells._replace(series=cells.series[:, :terms])


def _integral(cells: Cells, begin_s: float, eigenvalues_1_s: ComplexArray) -> ComplexArray:
    """Integrate the series times exp(-rate (begin + t)): (W,) for rates (W,)."""
    n = np.arange(cells.series.shape[1])
    total = np.zeros_like(eigenvalues_1_s)
    for half in np.unique(cells.halves_s):
        same = cells.halves_s == half
        weights = 2.0 * half * (-1j) ** n * cells.series[same]
        waves = weights @ _bessel(n, -1j * half * eigenvalues_1_s)  # (cells, W)
        growth = np.abs(eigenvalues_1_s.real) * half
        shifts = np.outer(begin_s + cells.middles_s[same], eigenvalues_1_s)
        total += np.sum(waves * np.exp(growth - shifts), axis=0)
    return total


def _bessel(n: NDArray[np.intp], z: ComplexArray) -> ComplexArray | FloatArray:
    """Compute the spherical Bessel functions j_n(z) exp(-|Im z|): (n, z)."""
    if not z.imag.any():
        return _bessel_real(n.size, z.real)
    from scipy.special import jve

    order = n[:, None]
    side = np.where(z.real < 0.0, -1.0, 1.0)  # j_n(-z) = (-1)^n j_n(z) avoids the branch cut
    tiny = np.abs(z) < TINY_ARGUMENT
    safe = np.where(tiny, 1.0, side * z)
    values = side**order * np.sqrt(np.pi / 2.0 / safe) * jve(order + 0.5, safe)
    return np.asarray(np.where(tiny, order == 0, values))


def _bessel_real(terms: int, z: FloatArray) -> FloatArray:
    """Compute j_0 .. j_(terms-1) of real z: (terms, z).

    Each by the recurrence in its stable direction: upwards for |z| >= terms.
    """
    j = np.empty((terms, z.size))
    j[0] = np.sinc(z / np.pi)
    small = np.abs(z) < terms
    up = np.where(small, terms, z)
    if terms > 1:
        j[1] = (np.sin(up) / up - np.cos(up)) / up
    for n in range(2, terms):
        j[n] = (2 * n - 1) / up * j[n - 1] - j[n - 2]
    j[:, small] = _bessel_small(terms, z[small])
    return j


def _bessel_small(terms: int, z: FloatArray) -> FloatArray:
    """Compute j_0 .. j_(terms-1) for |z| < terms: (terms, z).

    Upwards to n = |z|, above by the ratios j_n / j_(n-1) of a continued fraction that starts
    EXTRA_ORDERS higher.
    """
    ratio, ratios = np.zeros_like(z), np.empty((terms, z.size))
    for n in range(terms + EXTRA_ORDERS, 0, -1):
        ratio = z / (2 * n + 1 - z * ratio)
        if n < terms:
            ratios[n] = ratio
    j = np.empty((terms, z.size))
    j[0] = np.sinc(z / np.pi)
    safe = np.where(np.abs(z) < 1.0, 1.0, z)
    for n in range(1, terms):
        before = j[n - 2] if n > 1 else np.cos(safe) / safe
        j[n] = np.where(np.abs(z) < n, ratios[n] * j[n - 1], (2 * n - 1) / safe * j[n - 1] - before)
    return j
