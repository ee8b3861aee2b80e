"""Acceleration spectra of the laws in closed form, without a singular frequency.

All are V'(Omega) of a move of 1 m in 1 s, with Omega = number of periods in the duration; a move
of h metres in T seconds has h/T times as much. Each tends to 2 Omega as Omega goes to 0.
Source 000, spectrum of acceleration; its forms for the degrees 3 and 5 lack the phase inside the
sine, and degree 5 has a 4 for a 3 under the root.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from planners import bounds
from planners.errors import PlanError, unknown_name
from planners.laws import LAWS
from planners.laws.fourier import (
    FREUDENSTEIN_1_3,
    FREUDENSTEIN_1_3_5,
    GUTMAN_1_3,
    SHARE_SUM_TOLERANCE,
)
from planners.spectra.spectrum import spectrum_by_cycles
from planners.trajectories.pieces import FloatArray


def polynomial_spectrum(n: int, cycles: ArrayLike) -> FloatArray:
    """Compute the spectrum of the polynomial law of degree 2 n + 1.

    (2 / pi) (2n+1)!! |j_n(pi Omega)| / (pi Omega)^(n-1), j_n the spherical Bessel function.
    """
    from scipy.special import spherical_jn

    x = math.pi * np.abs(np.asarray(cycles, dtype=np.float64))
    odd = math.prod(range(1, 2 * n + 2, 2))
    safe = np.where(x > 0.0, x, 1.0)
    values = 2.0 / math.pi * odd * np.abs(spherical_jn(n, safe)) / safe ** (n - 1)
    return np.asarray(np.where(x > 0.0, values, 0.0))


def harmonic_spectrum(cycles: ArrayLike) -> FloatArray:
    """Compute the spectrum of the harmonic law, 2 Omega |cos(pi Omega) / (1 - 4 Omega^2)|."""
    x = np.abs(np.asarray(cycles, dtype=np.float64))
    return np.asarray(math.pi / 2.0 * x * np.abs(np.sinc(x - 0.5) + np.sinc(x + 0.5)))


def fourier_spectrum(shares: Mapping[int, float], cycles: ArrayLike) -> FloatArray:
    """Compute the spectrum of x - sum c_n sin(2 pi n x) / (2 pi n), shares n -> c_n with sum 1.

    (2 / pi) |sin(pi Omega) sum c_n n^2 / (n^2 - Omega^2)|.
    """
    x = np.abs(np.asarray(cycles, dtype=np.float64))
    waves = (c * n * (-1) ** n * (np.sinc(x + n) - np.sinc(x - n)) for n, c in shares.items())
    return np.asarray(np.abs(sum(waves, np.zeros_like(x))))


def rect_spectrum(shares: Sequence[float], cycles: ArrayLike) -> FloatArray:
    """Compute the spectrum of a cascade of moving averages, 2 Omega prod |sinc(share Omega)|.

    shares: lengths of the averages as shares of the duration, with sum 1. Trapezoidal
    (1 - alpha, alpha), double S (1 - alpha, alpha (1 - beta), alpha beta), four for 15 segments.
    Raises PlanError when the shares do not sum to 1.
    """
    if not math.isclose(sum(shares), 1.0, rel_tol=SHARE_SUM_TOLERANCE):
        raise PlanError(
            f"shares {tuple(shares)} sum to {sum(shares)}; must sum to 1: "
            "divide each length by the duration"
        )
    x = np.abs(np.asarray(cycles, dtype=np.float64))
    return np.asarray(2.0 * x * np.abs(np.prod([np.sinc(share * x) for share in shares], axis=0)))


SPECTRA: dict[str, Callable[[ArrayLike], FloatArray]] = {
    "harmonic": harmonic_spectrum,
    "cycloidal": partial(fourier_spectrum, {1: 1.0}),
    "cubic": partial(polynomial_spectrum, 1),
    "quintic": partial(polynomial_spectrum, 2),
    "septic": partial(polynomial_spectrum, 3),
    "gutman_1_3": partial(fourier_spectrum, GUTMAN_1_3),
    "freudenstein_1_3": partial(fourier_spectrum, FREUDENSTEIN_1_3),
    "freudenstein_1_3_5": partial(fourier_spectrum, FREUDENSTEIN_1_3_5),
    "triangular": partial(rect_spectrum, (1 / 2, 1 / 2)),
    "trapezoidal": partial(rect_spectrum, (2 / 3, 1 / 3)),
    "double_s": partial(rect_spectrum, (2 / 3, 1 / 6, 1 / 6)),
    "fifteen_segments": partial(rect_spectrum, (2 / 3, 1 / 6, 1 / 12, 1 / 12)),
}


def law_spectrum(
    name: str, cycles: ArrayLike, *, distance_m: float = 1.0, duration_s: float = 1.0
) -> FloatArray:
    """Compute the spectrum V'(Omega) [m/s] of a law by name, in the shape of cycles.

    In closed form, or by the transform of the trajectory where the law has none.
    Raises PlanError for an unknown law, cycles that are not finite, and a distance or duration
    out of bounds.
    """
    if name not in LAWS:
        raise unknown_name("law", name, LAWS)
    bounds.duration(duration_s)
    bounds.distance(distance_m)
    for value in np.extract(~np.isfinite(cycles), cycles)[:1]:
        raise PlanError(f"cycles = {value} of a spectrum; must be finite: correct the frequencies")
    unit = SPECTRA[name](cycles) if name in SPECTRA else spectrum_by_cycles(LAWS[name](1.0), cycles)
    return np.asarray(abs(distance_m) / duration_s * unit)
