"""Offset table of the camera, from free swings at several platform positions."""

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
FREQUENCY_BAND_REL = 0.2  # of the model's frequency, searched to both sides
MAX_DAMPING_RATIO = 0.05
MAX_ROW_SIGMA_PX = 1.0  # the row of the pivot is taken from the data where its sigma is smaller


@dataclass(frozen=True, kw_only=True, eq=False)
class SwingRecord:
    """Samples of a free swing at one platform position; nan marks a value that a frame lacks.

    Arrays (N,): stamps, angle without offset and average, measured platform position, and fitted
    line minus predicted pivot along image x at the row of the predicted pivot.
    """

    t_s: FloatArray
    raw_rad: FloatArray
    platform_m: FloatArray
    pivot_miss_px: FloatArray

    def valid(self) -> SwingRecord:
        """Select the frames that have all values."""
        columns = (self.t_s, self.raw_rad, self.platform_m, self.pivot_miss_px)
        fields = [np.asarray(column, dtype=np.float64) for column in columns]
        keep = np.isfinite(fields).all(axis=0)
        t, raw, platform, miss = (a[keep] for a in fields)
        return SwingRecord(t_s=t, raw_rad=raw, platform_m=platform, pivot_miss_px=miss)


@dataclass(frozen=True, kw_only=True, eq=False)
class OffsetCalibration:
    """Offsets (P,) over rising platform positions, and pivot and scale of the pictures.

    Each sigma is one standard deviation.
    """

    x_m: FloatArray
    offset_rad: FloatArray
    sigma_offset_rad: FloatArray
    amplitude_rad: FloatArray  # of the swing at the middle of the record
    frequency_hz: float  # common to all positions; at a bound of +-20 % without a visible swing
    residual_rad: float  # rms of raw angle minus swing and offset
    pivot_home_px: tuple[float, float]  # (u, v) with the platform at 0
    sigma_pivot_home_px: tuple[float, float]
    row_observed: bool  # False: the swing was too small, v is the predicted one
    pixels_per_m: float
    sigma_pixels_per_m: float
    residual_px: float  # rms of the pivot miss after the refinement


class Swings(NamedTuple):
    """Offset and decaying sinusoid at every position, with common frequency and decay rate."""

    coefficients: FloatArray  # (P, 3): cosine, sine [rad] at mid-record, offset [rad]
    sigma_offset_rad: FloatArray  # (P,)
    frequency_hz: float
    residual_rad: float
    angles: list[FloatArray]  # fitted angle at the stamps of each record


class Pivot(NamedTuple):
    """Pivot and scale from the regression of the observed line at the predicted pivot row."""

    home_px: tuple[float, float]
    sigma_home_px: tuple[float, float]
    row_observed: bool
    pixels_per_m: float
    sigma_pixels_per_m: float
    residual_px: float


def calibrate_offsets(
    records: Sequence[SwingRecord],
    *,
    pivot_home_px: tuple[float, float],
    pixels_per_m: float,
    natural_frequency_hz: float,
) -> OffsetCalibration:
    """Fit the offset at each position, and pivot and scale of the pictures.

    pivot_home_px (u, v), pixels_per_m: values with which the tracker predicted the pivot.
    natural_frequency_hz: of the model, searched within 20 %. Design, section 4: two periods per
    position, sinusoid and offset; the load need not be at rest. Raises AnalysisError for fewer than
    2 positions, positions closer than 1 mm, a record shorter than one period of the model or with
    fewer than 20 valid samples.
    """
    valid = sorted((record.valid() for record in records), key=_mean_position_m)
    for record in valid:
        _check_record(record, natural_frequency_hz)
    x_m = np.array([np.mean(record.platform_m) for record in valid])
    if x_m.size < 2 or np.diff(x_m).min() < MIN_SPACING_M:
        raise AnalysisError(
            f"positions {x_m.round(4).tolist()} m; need 2, {MIN_SPACING_M} m apart: "
            "watch each position once"
        )
    swings = _fit_swings(valid, natural_frequency_hz)
    pivot = _fit_pivot(valid, swings.angles, pivot_home_px, pixels_per_m)
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


def _mean_position_m(record: SwingRecord) -> float:
    """Compute the mean position; a record without a valid sample sorts first."""
    return float(np.mean(record.platform_m)) if record.platform_m.size else -math.inf


def _check_record(record: SwingRecord, natural_frequency_hz: float) -> None:
    count = record.t_s.size
    place = f"at {np.mean(record.platform_m):.3f} m" if count else "at an unknown position"
    if count < MIN_SAMPLES:
        raise AnalysisError(
            f"{count} valid samples {place}; need {MIN_SAMPLES}: see why the frames were refused"
        )
    periods = float(np.ptp(record.t_s)) * natural_frequency_hz
    if periods < MIN_PERIODS:
        raise AnalysisError(
            f"{periods:.2f} periods watched {place}; need {MIN_PERIODS}: "
            "watch two periods at each position"
        )


def _fit_swings(records: Sequence[SwingRecord], natural_frequency_hz: float) -> Swings:
    """Fit by variable projection: search frequency and decay rate, solve linearly for the rest."""
    from scipy.optimize import least_squares

    w0 = 2 * math.pi * natural_frequency_hz
    expected = np.array([w0, 0.0])
    half_range = np.array([FREQUENCY_BAND_REL, MAX_DAMPING_RATIO]) * w0
    # scales the residual, so that the tolerances hold at any amplitude
    unit = max(float(np.std(record.raw_rad)) for record in records) or 1.0

    def scaled_residual(q: FloatArray) -> FloatArray:
        fits = _linear_fits(records, expected + q * half_range)
        return np.concatenate([record.raw_rad - X @ c for record, X, c in fits]) / unit

    q = least_squares(scaled_residual, np.zeros(2), bounds=(-1, 1)).x
    shared = expected + q * half_range
    residual = scaled_residual(q) * unit
    fits = _linear_fits(records, shared)
    variance = float(residual @ residual) / (residual.size - 3 * len(fits) - 2)
    return Swings(
        coefficients=np.array([c for _, _, c in fits]),
        sigma_offset_rad=np.sqrt(variance * np.diag(_unit_covariance(fits))[2:-2:3]),
        frequency_hz=float(shared[0]) / (2 * math.pi),
        residual_rad=float(np.sqrt(np.mean(residual**2))),
        angles=[X @ c for _, X, c in fits],
    )


def _linear_fits(
    records: Sequence[SwingRecord], shared: FloatArray
) -> list[tuple[SwingRecord, FloatArray, FloatArray]]:
    """Solve for the linear coefficients (3,) of each record.

    Returns them with the record and its basis X (N, 3) = decaying cosine, decaying sine, one.
    """
    omega, decay = shared
    fits = []
    for record in records:
        tau = record.t_s - (record.t_s[0] + record.t_s[-1]) / 2
        envelope = np.exp(-decay * tau)
        cosine = envelope * np.cos(omega * tau)
        sine = envelope * np.sin(omega * tau)
        X = np.stack([cosine, sine, np.ones_like(tau)], axis=-1)
        fits.append((record, X, np.linalg.lstsq(X, record.raw_rad)[0]))
    return fits


def _unit_covariance(fits: Sequence[tuple[SwingRecord, FloatArray, FloatArray]]) -> FloatArray:
    """Compute (J'J)^-1 of all coefficients, position by position, then frequency and decay rate."""
    rows = [X.shape[0] for _, X, _ in fits]
    J = np.zeros((sum(rows), 3 * len(fits) + 2))
    first = 0
    for k, (record, X, (a, b, _)) in enumerate(fits):
        tau = record.t_s - (record.t_s[0] + record.t_s[-1]) / 2
        here = slice(first, first + rows[k])
        J[here, 3 * k : 3 * k + 3] = X
        J[here, -2] = tau * (b * X[:, 0] - a * X[:, 1])
        J[here, -1] = -tau * (a * X[:, 0] + b * X[:, 1])
        first += rows[k]
    inverse = np.linalg.pinv(J)
    covariance: FloatArray = inverse @ inverse.T
    return covariance


def _fit_pivot(
    records: Sequence[SwingRecord],
    angles: Sequence[FloatArray],
    home_px: tuple[float, float],
    pixels_per_m: float,
) -> Pivot:
    """Fit u_line(v_pred) = u0 + pixels_per_m x + (v_pred - v0) tan(angle) by least squares.

    Unknown are u0, pixels_per_m and v_pred - v0. The angle is the fitted swing, not the raw sample:
    the noise of a sample is in its pivot miss too, and would bias the pivot to the middle of the
    picture.
    """
    x = np.concatenate([record.platform_m for record in records])
    miss_px = np.concatenate([record.pivot_miss_px for record in records])
    observed_px = home_px[0] + pixels_per_m * x + miss_px
    basis = np.stack([np.ones_like(x), x, np.tan(np.concatenate(angles))], axis=-1)
    (u0, scale, rise), sigma, residual_px = _regression(basis, observed_px)
    row_observed = sigma[2] < MAX_ROW_SIGMA_PX
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
    """Solve by least squares; return coefficients, sigmas for white residuals, residual rms."""
    inverse = np.linalg.pinv(basis)
    coefficients = inverse @ y
    residual = y - basis @ coefficients
    variance = float(residual @ residual) / (y.size - basis.shape[1])
    return (
        coefficients,
        np.sqrt(variance * np.sum(inverse**2, axis=1)),
        float(np.sqrt(np.mean(residual**2))),
    )
