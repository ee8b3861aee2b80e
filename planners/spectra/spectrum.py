"""What a motion's acceleration holds at a frequency: exact for every trajectory, without a singular frequency.

On a cell the acceleration is a Legendre series, and int_-1^1 P_n(x) exp(-j z x) dx = 2 (-j)^n j_n(z) with the spherical
Bessel function j_n (DLMF 18.17.19): no division by what may vanish, hence no resonance to step around.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planners.errors import PlanError
from planners.trajectories.cells import Cells, resolve
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory

ComplexArray: TypeAlias = NDArray[np.complex128]

BLOCK = 500_000  # Bessel functions held at once
BEYOND = 25  # orders beyond the last one from which a continued fraction begins: it has forgotten its start to 1e-15
TINY = 1e-30  # |z| at which j_0 is 1 and the others are 0
COEFFICIENT_ROUNDING_REL = (
    4e-16  # of the largest coefficient; later terms of a series that small are dropped
)


def transform(
    trajectory: Trajectory, eigenvalues_1_s: ArrayLike, origin_s: float = 0.0
) -> ComplexArray:
    """int a(t) exp(-rate (t - origin)) dt [m/s] for rates of any shape, in that shape; a step in speed is an impulse.

    rate = j w gives the Fourier transform. With rate = a mode's eigenvalue and origin_s = duration_s it is what the mode
    q' = rate q + a holds at the end. Raises PlanError for a rate that is not finite, or too damped for its origin.
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
        blocks = np.array_split(flat, math.ceil(max(1, flat.size) * cells.series.size / BLOCK))
        total += np.concatenate([_integral(cells, begin - origin_s, block) for block in blocks])
    return total.reshape(rates.shape)


def spectrum(trajectory: Trajectory, frequencies_rad_s: ArrayLike) -> FloatArray:
    """V(w) = |int a exp(-j w t) dt| / pi [m/s], any shape, so that a(t) = int_0^inf V cos(w t + phi) dw.

    Source 000, spectrum of acceleration. pi V(w)/w is the swing an undamped load of frequency w keeps. A move of
    h times the distance has h times V; played lambda times as fast it has lambda V(w / lambda).
    """
    w = np.asarray(frequencies_rad_s, dtype=np.float64)
    return np.asarray(np.abs(transform(trajectory, 1j * w)) / math.pi)


def spectrum_by_cycles(trajectory: Trajectory, cycles: ArrayLike) -> FloatArray:
    """V'(Omega) = V(2 pi Omega / T) [m/s]: cycles Omega = periods that fit into the move's duration, any shape."""
    return spectrum(
        trajectory, 2.0 * math.pi / trajectory.duration_s * np.asarray(cycles, dtype=np.float64)
    )


def _check_growth(trajectory: Trajectory, eigenvalues_1_s: ComplexArray, origin_s: float) -> None:
    reach = (-eigenvalues_1_s.real * (end - origin_s) for end in (0.0, trajectory.duration_s))
    most = max((float(r.max()) for r in reach if r.size), default=0.0)
    if most > 700.0:
        raise PlanError(
            f"exp(-rate (t - origin)) reaches exp({most:.4g}); must be <= exp(700): set origin_s to the end the load decays to"
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
    """Step in speed [m/s] at every joint and against rest at both ends: (pieces + 1,)."""
    ends = np.array(
        [piece.at(np.array([0.0, piece.duration_s]), 1) for piece in trajectory.pieces]
    )  # (pieces, 2)
    return np.asarray(np.append(ends[:, 0], 0.0) - np.insert(ends[:, 1], 0, 0.0))


def _trimmed(cells: Cells) -> Cells:
    sizes = np.abs(cells.series).max(axis=0)
    terms = (
        int(np.flatnonzero(sizes > COEFFICIENT_ROUNDING_REL * sizes.max())[-1]) + 1
        if sizes.any()
        else 1
    )
    return cells._replace(series=cells.series[:, :terms])


def _integral(cells: Cells, begin_s: float, eigenvalues_1_s: ComplexArray) -> ComplexArray:
    """Integral of the series times exp(-rate (begin + t)): (W,) for rates (W,)."""
    n = np.arange(cells.series.shape[1])
    total = np.zeros_like(eigenvalues_1_s)
    for half in np.unique(cells.halves_s):
        same = cells.halves_s == half
        waves = (
            2.0 * half * (-1j) ** n * cells.series[same] @ _bessel(n, -1j * half * eigenvalues_1_s)
        )  # (cells, W)
        growth = np.abs(eigenvalues_1_s.real) * half
        total += np.sum(
            waves * np.exp(growth - np.outer(begin_s + cells.middles_s[same], eigenvalues_1_s)),
            axis=0,
        )
    return total


def _bessel(n: NDArray[np.intp], z: ComplexArray) -> ComplexArray | FloatArray:
    """Spherical Bessel functions j_n(z) exp(-|Im z|): (n, z)."""
    if not z.imag.any():
        return _bessel_real(n.size, z.real)
    from scipy.special import jve

    order = n[:, None]
    side = np.where(z.real < 0.0, -1.0, 1.0)  # j_n(-z) = (-1)^n j_n(z) keeps off the branch cut
    tiny = np.abs(z) < TINY
    safe = np.where(tiny, 1.0, side * z)
    return np.asarray(
        np.where(
            tiny, order == 0, side**order * np.sqrt(np.pi / 2.0 / safe) * jve(order + 0.5, safe)
        )
    )


def _bessel_real(terms: int, z: FloatArray) -> FloatArray:
    """j_0 .. j_(terms-1) of real z, each by the recurrence in the direction in which it is stable: (terms, z)."""
    j = np.empty((terms, z.size))
    j[0] = np.sinc(z / np.pi)
    fades = np.abs(z) < terms
    up = np.where(fades, terms, z)
    if terms > 1:
        j[1] = (np.sin(up) / up - np.cos(up)) / up
    for n in range(2, terms):
        j[n] = (2 * n - 1) / up * j[n - 1] - j[n - 2]
    j[:, fades] = _bessel_fading(terms, z[fades])
    return j


def _bessel_fading(terms: int, z: FloatArray) -> FloatArray:
    """The same for |z| < terms: above n = |z| by the ratios j_n / j_(n-1), a continued fraction from far beyond."""
    ratio, ratios = np.zeros_like(z), np.empty((terms, z.size))
    for n in range(terms + BEYOND, 0, -1):
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
