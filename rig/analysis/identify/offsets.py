"""The camera's offset table, from swings watched at several platform positions; the load never needs rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]

MIN_SAMPLES = 20
MIN_PERIODS = 1.0
MIN_SPACING_M = 0.001
FREQUENCY_BAND = 0.2  # the believed frequency is trusted to +-20 %
MAX_DAMPING_RATIO = 0.05
ROW_SEEN_PX = 1.0  # the pivot's row is taken from the data once its sigma is below


@dataclass(frozen=True, kw_only=True, eq=False)
class Watch:
    """One position, watched while the load swings freely; nan marks what a frame did not give.

    Arrays (N,): stamps, angle without any offset or average, measured platform position, and the fitted line minus
    the predicted pivot along image x at the predicted pivot's row.
    """

    t_s: FloatArray
    raw_rad: FloatArray
    platform_m: FloatArray
    pivot_miss_px: FloatArray

    def valid(self) -> Watch:
        """The frames that gave everything."""
        fields = [
            np.asarray(a, dtype=np.float64)
            for a in (self.t_s, self.raw_rad, self.platform_m, self.pivot_miss_px)
        ]
        keep = np.isfinite(fields).all(axis=0)
        t, raw, platform, miss = (a[keep] for a in fields)
        return Watch(t_s=t, raw_rad=raw, platform_m=platform, pivot_miss_px=miss)


@dataclass(frozen=True, kw_only=True, eq=False)
class OffsetCalibration:
    """Offsets (P,) over rising platform positions, and the pivot as the pictures show it; sigmas are one standard deviation."""

    x_m: FloatArray
    offset_rad: FloatArray
    sigma_offset_rad: FloatArray
    amplitude_rad: FloatArray  # swing at mid-watch
    frequency_hz: (
        float  # shared by all positions; at the belief's +-20 % where nothing swings visibly
    )
    residual_rad: float  # rms of raw angle minus swing and offset
    pivot_home_px: tuple[float, float]  # (u, v) with the platform at 0
    sigma_pivot_home_px: tuple[float, float]
    row_observed: bool  # False: the swing was too small, v is the prediction kept
    pixels_per_m: float
    sigma_pixels_per_m: float
    residual_px: float  # rms of pivot miss left by the refined pivot


class Swings(NamedTuple):
    """Offset + decaying sinusoid at every position, frequency and decay shared."""

    coefficients: FloatArray  # (P, 3): cosine, sine [rad] at mid-watch, offset [rad]
    sigma_offset_rad: FloatArray  # (P,)
    frequency_hz: float
    residual_rad: float
    angles: list[FloatArray]  # the fitted angle at each watch's stamps


class Pivot(NamedTuple):
    """Regression of the observed line at the predicted pivot row."""

    home_px: tuple[float, float]
    sigma_home_px: tuple[float, float]
    row_observed: bool
    pixels_per_m: float
    sigma_pixels_per_m: float
    residual_px: float


def calibrate_offsets(
    watches: Sequence[Watch],
    *,
    pivot_home_px: tuple[float, float],
    pixels_per_m: float,
    natural_frequency_hz: float,
) -> OffsetCalibration:
    """Offset at each watched position, the pivot's home and the scale of the pictures.

    pivot_home_px (u, v) and pixels_per_m are what the tracker predicted the pivot with; natural_frequency_hz is the
    belief, searched within 20 %. Design, section 4: two periods a position, sinusoid + offset, no rest needed.
    Raises AnalysisError for fewer than 2 positions, positions closer than 1 mm, a watch shorter than one believed
    period or with fewer than 20 valid samples.
    """
    seen = sorted(
        (w.valid() for w in watches),
        key=lambda w: float(np.mean(w.platform_m)) if w.platform_m.size else -math.inf,
    )
    for watch in seen:
        _check_watch(watch, natural_frequency_hz)
    x_m = np.array([np.mean(w.platform_m) for w in seen])
    if x_m.size < 2 or np.diff(x_m).min() < MIN_SPACING_M:
        raise AnalysisError(
            f"positions {x_m.round(4).tolist()} m; need 2, {MIN_SPACING_M} m apart: watch each position once"
        )
    swings = _fit_swings(seen, natural_frequency_hz)
    pivot = _fit_pivot(seen, swings.angles, pivot_home_px, pixels_per_m)
    return OffsetCalibration(
        x_m=x_m,
        offset_rad=swings.coefficients[:, 2],
        sigma_offset_rad=swings.sigma_offset_rad,
        amplitude_rad=np.hypot(swings.coefficients[:, 0], swings.coefficients[:, 1]),
        frequency_hz=swings.frequency_hz,
        residual_rad=swings.residual_rad,
        pivot_home_px=pivot.home_px,
        sigma_pivot_home_px=pivot.sigma_home_px,
        row_observed=pivot.row_observed,
        pixels_per_m=pivot.pixels_per_m,
        sigma_pixels_per_m=pivot.sigma_pixels_per_m,
        residual_px=pivot.residual_px,
    )


def _check_watch(watch: Watch, natural_frequency_hz: float) -> None:
    where = f"at {np.mean(watch.platform_m):.3f} m" if watch.t_s.size else "at an unseen position"
    if watch.t_s.size < MIN_SAMPLES:
        raise AnalysisError(
            f"{watch.t_s.size} valid samples {where}; need {MIN_SAMPLES}: see why the frames were refused"
        )
    periods = float(np.ptp(watch.t_s)) * natural_frequency_hz
    if periods < MIN_PERIODS:
        raise AnalysisError(
            f"{periods:.2f} periods watched {where}; need {MIN_PERIODS}: watch two periods at each position"
        )


def _fit_swings(watches: Sequence[Watch], natural_frequency_hz: float) -> Swings:
    """Variable projection: only frequency and decay rate are searched, the rest is linear at each position."""
    from scipy.optimize import least_squares

    w0 = 2 * math.pi * natural_frequency_hz
    belief, reach = np.array([w0, 0.0]), np.array([FREQUENCY_BAND, MAX_DAMPING_RATIO]) * w0
    unit = (
        max(float(np.std(w.raw_rad)) for w in watches) or 1.0
    )  # tolerances mean the same at any amplitude

    def misfit(q: FloatArray) -> FloatArray:
        fits = _linear_fits(watches, belief + q * reach)
        return np.concatenate([w.raw_rad - X @ c for w, X, c in fits]) / unit

    q = least_squares(misfit, np.zeros(2), bounds=(-1, 1)).x
    shared, residual = belief + q * reach, misfit(q) * unit
    fits = _linear_fits(watches, shared)
    variance = float(residual @ residual) / (residual.size - 3 * len(fits) - 2)
    return Swings(
        coefficients=np.array([c for _, _, c in fits]),
        sigma_offset_rad=np.sqrt(variance * np.diag(_unit_covariance(fits))[2:-2:3]),
        frequency_hz=float(shared[0]) / (2 * math.pi),
        residual_rad=float(np.sqrt(np.mean(residual**2))),
        angles=[X @ c for _, X, c in fits],
    )


def _linear_fits(
    watches: Sequence[Watch], shared: FloatArray
) -> list[tuple[Watch, FloatArray, FloatArray]]:
    """For each watch its basis X (N, 3) = decaying cosine, sine, one, and the least-squares coefficients (3,)."""
    omega, decay = shared
    fits = []
    for watch in watches:
        tau = watch.t_s - (watch.t_s[0] + watch.t_s[-1]) / 2
        fall = np.exp(-decay * tau)
        X = np.stack(
            [fall * np.cos(omega * tau), fall * np.sin(omega * tau), np.ones_like(tau)], axis=-1
        )
        fits.append((watch, X, np.linalg.lstsq(X, watch.raw_rad)[0]))
    return fits


def _unit_covariance(fits: Sequence[tuple[Watch, FloatArray, FloatArray]]) -> FloatArray:
    """(J'J)^-1 of all coefficients, position by position, then frequency and decay."""
    rows = [X.shape[0] for _, X, _ in fits]
    J, first = np.zeros((sum(rows), 3 * len(fits) + 2)), 0
    for k, (watch, X, (a, b, _)) in enumerate(fits):
        tau = watch.t_s - (watch.t_s[0] + watch.t_s[-1]) / 2
        here = slice(first, first + rows[k])
        J[here, 3 * k : 3 * k + 3] = X
        J[here, -2] = tau * (b * X[:, 0] - a * X[:, 1])
        J[here, -1] = -tau * (a * X[:, 0] + b * X[:, 1])
        first += rows[k]
    inverse = np.linalg.pinv(J)
    covariance: FloatArray = inverse @ inverse.T
    return covariance


def _fit_pivot(
    watches: Sequence[Watch],
    angles: Sequence[FloatArray],
    home_px: tuple[float, float],
    pixels_per_m: float,
) -> Pivot:
    """u_line(v_pred) = u0 + pixels_per_m x + (v_pred - v0) tan(angle), least squares in u0, pixels_per_m, v_pred - v0.

    The angle is the fitted swing, not the raw sample: a sample's noise sits in its pivot miss too and would pose as
    a pivot in the middle of the picture.
    """
    x = np.concatenate([w.platform_m for w in watches])
    observed_px = home_px[0] + pixels_per_m * x + np.concatenate([w.pivot_miss_px for w in watches])
    basis = np.stack([np.ones_like(x), x, np.tan(np.concatenate(angles))], axis=-1)
    (u0, scale, rise), sigma, residual_px = _regression(basis, observed_px)
    row_observed = sigma[2] < ROW_SEEN_PX
    if not row_observed:
        (u0, scale), sigma, residual_px = _regression(basis[:, :2], observed_px)
    return Pivot(
        home_px=(float(u0), float(home_px[1] - rise) if row_observed else home_px[1]),
        sigma_home_px=(float(sigma[0]), float(sigma[2]) if row_observed else math.inf),
        row_observed=bool(row_observed),
        pixels_per_m=float(scale),
        sigma_pixels_per_m=float(sigma[1]),
        residual_px=residual_px,
    )


def _regression(basis: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Least-squares coefficients, their sigmas for white residuals, and the residual rms."""
    inverse = np.linalg.pinv(basis)
    coefficients = inverse @ y
    residual = y - basis @ coefficients
    variance = float(residual @ residual) / (y.size - basis.shape[1])
    return (
        coefficients,
        np.sqrt(variance * np.sum(inverse**2, axis=1)),
        float(np.sqrt(np.mean(residual**2))),
    )
