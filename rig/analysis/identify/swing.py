"""How far the load swings: peaks, amplitudes, and the simulated bench's truth between its stamps."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.errors import AnalysisError

FloatArray = npt.NDArray[np.float64]


def peak_swing_rad(t_s: FloatArray, angle_rad: FloatArray, t0_s: float, t1_s: float) -> float:
    """Largest |angle| [rad] of the samples (N,) stamped within [t0_s, t1_s]; AnalysisError when there is none.

    At 50 Hz and 0.5 Hz swing the true peak lies less than 0.05 % above the nearest sample.
    """
    inside = np.asarray(angle_rad)[(np.asarray(t_s) >= t0_s) & (np.asarray(t_s) <= t1_s)]
    if inside.size == 0:
        raise AnalysisError(
            f"no angle within [{t0_s:.3f}, {t1_s:.3f}] s: check that the log covers the move"
        )
    return float(np.max(np.abs(inside)))


def initial_swing_rad(t_s: npt.ArrayLike, angle_rad: npt.ArrayLike, omega_rad_s: float) -> float:
    """Amplitude [rad] of the least-squares sinusoid of known frequency about zero, over a quiet window.

    t_s, angle_rad (N,), N >= 3. Raises AnalysisError for fewer samples, or a window under a quarter period, on which
    sine and cosine are hardly told apart.
    """
    t = np.asarray(t_s, dtype=np.float64)
    if t.size < 3 or (t[-1] - t[0]) * omega_rad_s < math.pi / 2:
        raise AnalysisError(
            f"{t.size} samples in the quiet window; need 3 over a quarter period or more: raise quiet_s"
        )
    phase = omega_rad_s * (t - t[0])
    (a, b), *_ = np.linalg.lstsq(
        np.stack([np.cos(phase), np.sin(phase)], axis=-1), np.asarray(angle_rad, dtype=np.float64)
    )
    return math.hypot(a, b)


def residual_amplitude_rad(angle_rad: float, rate_rad_s: float, omega_rad_s: float) -> float:
    """Amplitude of the swing that passes through this state: sqrt(theta^2 + (theta_dot / omega)^2)."""
    return math.hypot(angle_rad, rate_rad_s / omega_rad_s)


def truth_at(
    t_s: FloatArray, t_truth_s: FloatArray, angle_rad: FloatArray, rate_rad_s: FloatArray
) -> FloatArray:
    """True angle [rad] at t_s (M,) by cubic Hermite interpolation of angle and rate (N,) given at t_truth_s (N,).

    Error at 10 ms spacing: h^4 / 384 omega^4 of the amplitude, 3e-9 at 0.5 Hz. AnalysisError outside the truth's stamps.
    """
    from scipy.interpolate import CubicHermiteSpline

    t, known = np.asarray(t_s, dtype=np.float64), np.asarray(t_truth_s, dtype=np.float64)
    if known.size < 2 or (t.size and (t.min() < known[0] or t.max() > known[-1])):
        span = f"[{known[0]:.3f}, {known[-1]:.3f}] s" if known.size else "nothing"
        raise AnalysisError(
            f"truth covers {span}, asked for [{t.min():.3f}, {t.max():.3f}] s: ask inside, from two samples on"
        )
    angle: FloatArray = CubicHermiteSpline(known, np.asarray(angle_rad), np.asarray(rate_rad_s))(t)
    return angle
