"""Swing of the load: peaks, amplitudes, and the true angle between its stamps."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]
SETTLED_SHARE = 0.9  # of a record, after which nothing may leave the band


def peak_swing_rad(t_s: FloatArray, angle_rad: FloatArray, t0_s: float, t1_s: float) -> float:
    """Find the largest |angle| [rad] of the samples (N,) stamped within [t0_s, t1_s].

    At 50 Hz and 0.5 Hz swing the true peak lies less than 0.05 % above the nearest sample. Raises
    AnalysisError without a sample.
    """
    t = np.asarray(t_s)
    inside = np.asarray(angle_rad)[(t >= t0_s) & (t <= t1_s)]
    if inside.size == 0:
        raise AnalysisError(
            f"no angle within [{t0_s:.3f}, {t1_s:.3f}] s: check that the log covers the move"
        )
    return float(np.max(np.abs(inside)))


def largest_gap_s(t_s: FloatArray, t0_s: float, t1_s: float) -> tuple[float, float]:
    """Find the longest part of [t0_s, t1_s] without a stamp of t_s (N,), rising: from and to."""
    t = np.asarray(t_s)
    edges = np.concatenate([[t0_s], t[(t >= t0_s) & (t <= t1_s)], [t1_s]])
    widest = int(np.argmax(np.diff(edges)))
    return float(edges[widest]), float(edges[widest + 1])


def settling_time_s(
    t_s: FloatArray, angle_rad: FloatArray, from_s: float, band_rad: float
) -> float | None:
    """Compute the time [s] from from_s until |angle| stays within a band to the end of the record.

    t_s, angle_rad (N,). None without a sample after from_s, or where the last tenth of the record
    still leaves the band: it has not settled.
    """
    t, angle = np.asarray(t_s), np.asarray(angle_rad)
    after = t >= from_s
    if not after.any():
        return None
    t, angle = t[after], angle[after]
    outside = np.flatnonzero(np.abs(angle) > band_rad)
    if outside.size == 0:
        return 0.0
    last_s = float(t[outside[-1]])
    if last_s > from_s + SETTLED_SHARE * (float(t[-1]) - from_s):
        return None
    return last_s - from_s


def initial_swing_rad(t_s: npt.ArrayLike, angle_rad: npt.ArrayLike, omega_rad_s: float) -> float:
    """Fit a sinusoid of known frequency about zero; return its amplitude [rad].

    t_s, angle_rad (N,), N >= 3: samples of the quiet interval. Raises AnalysisError for fewer
    samples, or less than a quarter period, over which sine and cosine are nearly dependent.
    """
    t = np.asarray(t_s, dtype=np.float64)
    angle = np.asarray(angle_rad, dtype=np.float64)
    if t.size < 3 or (t[-1] - t[0]) * omega_rad_s < math.pi / 2:
        raise AnalysisError(
            f"{t.size} samples in the quiet interval; "
            "need 3 over a quarter period or more: raise quiet_s"
        )
    phase = omega_rad_s * (t - t[0])
    basis = np.stack([np.cos(phase), np.sin(phase)], axis=-1)
    (a, b), *_ = np.linalg.lstsq(basis, angle)
    return math.hypot(a, b)


def residual_amplitude_rad(
    angle_rad: float, rate_rad_s: float, omega_rad_s: float, damping_ratio: float
) -> float:
    """Compute the amplitude [rad] of a pendulum in this state: the envelope of its turning points.

    Without the part of the rate that the damping z makes, (theta' + z omega theta) / sqrt(1 - z^2),
    the energy of the state is that of a turning point: omega^2 (1 - cos A). It is what
    DecayFit.amplitude_at reports: within 1e-4 of it up to 0.3 rad and z = 0.05.
    """
    rate = (rate_rad_s + damping_ratio * omega_rad_s * angle_rad) / math.sqrt(
        1.0 - damping_ratio**2
    )
    # half angles: 1 - cos would lose the digits of small swings
    square = math.sin(0.5 * angle_rad) ** 2 + (0.5 * rate / omega_rad_s) ** 2
    return 2.0 * math.asin(min(math.sqrt(square), 1.0))


def truth_at(
    t_s: FloatArray, t_truth_s: FloatArray, angle_rad: FloatArray, rate_rad_s: FloatArray
) -> FloatArray:
    """Interpolate the true angle [rad] at t_s (M,).

    Cubic Hermite interpolation of angle and rate (N,) at the stamps t_truth_s (N,). Error at 10 ms
    spacing: h^4 / 384 omega^4 of the amplitude, 3e-9 at 0.5 Hz. Raises AnalysisError outside the
    stamps.
    """
    from scipy.interpolate import CubicHermiteSpline

    t = np.asarray(t_s, dtype=np.float64)
    known = np.asarray(t_truth_s, dtype=np.float64)
    if known.size < 2 or (t.size and (t.min() < known[0] or t.max() > known[-1])):
        span = f"[{known[0]:.3f}, {known[-1]:.3f}] s" if known.size else "nothing"
        raise AnalysisError(
            f"truth covers {span}, requested is [{t.min():.3f}, {t.max():.3f}] s; "
            "must lie inside, with two samples of truth or more: record truth longer"
        )
    angle: FloatArray = CubicHermiteSpline(known, np.asarray(angle_rad), np.asarray(rate_rad_s))(t)
    return angle
