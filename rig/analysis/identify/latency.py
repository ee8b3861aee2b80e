"""Delays by least-squares alignment of curves: robot against plan, measured against true swing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.errors import AnalysisError
from rig.analysis.identify.swing import truth_at

FloatArray = npt.NDArray[np.float64]

MIN_TRAVEL_M = 0.001  # a delay is not observable at rest
MIN_LATENCY_S, MAX_LATENCY_S = -0.1, 0.5  # range searched for the command latency
MAX_MISALIGNMENT_S = 0.25  # an eighth of a 2 s swing: far from the next period
MIN_ANGLES = 10
COARSE_STEP_S = 0.01
RESOLUTION_S = 1e-6


class TrackingError(NamedTuple):
    """Error of a motion against its plan, split into a delay and what no delay explains."""

    delay_s: float
    sigma_delay_s: float  # for a distortion that is white; larger where it is not
    rms: float  # without the delay taken out
    distortion_rms: float  # with it taken out

    @property
    def delay_rms(self) -> float:
        """Part of the rms that the delay makes."""
        return math.sqrt(max(0.0, self.rms**2 - self.distortion_rms**2))


def tracking_error(
    t_s: FloatArray, actual_m: FloatArray, plan: Callable[[FloatArray], FloatArray]
) -> TrackingError | None:
    """Split actual(t) - plan(t) over the move (N,) [m]; None where command_latency_s is None.

    The standard deviation of the delay is distortion / sqrt(sum of squared speeds), the
    Cramer-Rao bound of a shift in white noise.
    """
    delay_s = command_latency_s(t_s, actual_m, plan)
    if delay_s is None:
        return None
    t = np.asarray(t_s, dtype=np.float64)
    actual = np.asarray(actual_m, dtype=np.float64)
    move = _move_samples(plan(t))
    part = slice(move.start, min(t.size, move.stop + int(np.ceil(delay_s / np.median(np.diff(t))))))
    later = plan(t[part] - delay_s)
    total = actual[part] - plan(t[part])
    left = actual[part] - later
    speed = np.gradient(later, t[part])
    distortion = float(np.sqrt(np.mean(left**2)))
    sigma_s = distortion / math.sqrt(float(speed @ speed))
    return TrackingError(delay_s, sigma_s, float(np.sqrt(np.mean(total**2))), distortion)


def alignment_sigma_s(sigma_rad: FloatArray, rate_rad_s: FloatArray) -> float:
    """Compute the Cramer-Rao bound of alignment_s: sigma_rad, rate_rad_s (N,) of the samples."""
    information = float(np.sum(np.square(rate_rad_s / sigma_rad)))
    return 1.0 / math.sqrt(information) if information > 0.0 else math.inf


def command_latency_s(
    t_s: FloatArray, actual_m: FloatArray, plan: Callable[[FloatArray], FloatArray]
) -> float | None:
    """Find the delay d [s] that minimises rms(actual(t + d) - plan(t)) over the move.

    t_s, actual_m (N,): measured position at its own stamps, strictly increasing. plan maps stamps
    (M,) on the same time axis to positions (M,) [m], at rest before and after its move. None when
    plan or platform travels less than 1 mm, or without a minimum within -0.1 to 0.5 s.
    """
    from scipy.interpolate import CubicSpline

    t = np.asarray(t_s, dtype=np.float64)
    actual = np.asarray(actual_m, dtype=np.float64)
    planned = plan(t)
    if t.size < 4 or min(np.ptp(planned), np.ptp(actual)) < MIN_TRAVEL_M:
        return None
    move = _move_samples(planned)
    measured = CubicSpline(t, actual)

    def mismatch(delay_s: float) -> float:
        # the platform is at rest beyond both ends of the log
        at_s = np.clip(t[move] + delay_s, t[0], t[-1])
        return float(np.mean((measured(at_s) - planned[move]) ** 2))

    return _best_delay_s(mismatch, MIN_LATENCY_S, MAX_LATENCY_S)


def alignment_s(
    t_valid_s: FloatArray,
    angle_rad: FloatArray,
    t_truth_s: FloatArray,
    truth_angle_rad: FloatArray,
    truth_rate_rad_s: FloatArray,
) -> float:
    """Find the delay [s] of the measured swing (N,) behind the true one (M,) of least rms mismatch.

    Positive = measured late. Samples within 0.26 s of the ends of the truth are left out, so that
    all delays are compared on the same samples. Raises AnalysisError for fewer than 10 samples, or
    without a minimum within +-0.25 s.
    """
    t, angle = _within(t_valid_s, angle_rad, t_truth_s, MAX_MISALIGNMENT_S + COARSE_STEP_S)

    def mismatch(delay_s: float) -> float:
        true_angle = truth_at(t - delay_s, t_truth_s, truth_angle_rad, truth_rate_rad_s)
        return float(np.mean((angle - true_angle) ** 2))

    delay_s = _best_delay_s(mismatch, -MAX_MISALIGNMENT_S, MAX_MISALIGNMENT_S)
    if delay_s is None:
        raise AnalysisError(
            f"the mismatch has no minimum within +-{MAX_MISALIGNMENT_S} s: "
            "check sign, stamps, and that the load swings"
        )
    return delay_s


def swing_error_rms_rad(
    t_valid_s: FloatArray,
    angle_rad: FloatArray,
    t_truth_s: FloatArray,
    truth_angle_rad: FloatArray,
    truth_rate_rad_s: FloatArray,
) -> float:
    """Compute the rms [rad] of measured (N,) minus true angle (M,) at unchanged stamps.

    No delay is fitted. Samples outside the stamps of the truth are left out. Raises AnalysisError
    for fewer than 10 samples.
    """
    t, angle = _within(t_valid_s, angle_rad, t_truth_s, 0.0)
    true_angle = truth_at(t, t_truth_s, truth_angle_rad, truth_rate_rad_s)
    return float(np.sqrt(np.mean((angle - true_angle) ** 2)))


def _move_samples(planned: FloatArray) -> slice:
    """Select the samples from the last one at rest before the move to the first one after it."""
    moves = np.flatnonzero(np.abs(np.diff(planned)) > 1e-9 * np.ptp(planned))
    return slice(int(moves[0]), int(moves[-1]) + 2)


def _best_delay_s(mismatch: Callable[[float], float], low_s: float, high_s: float) -> float | None:
    """Scan coarsely, then minimise by Brent's bounded method; None for a minimum at an end."""
    from scipy.optimize import minimize_scalar

    delays = np.linspace(low_s, high_s, 1 + round((high_s - low_s) / COARSE_STEP_S))
    k = int(np.argmin([mismatch(float(delay_s)) for delay_s in delays]))
    if k in (0, delays.size - 1):
        return None
    bounds = (float(delays[k - 1]), float(delays[k + 1]))
    found = minimize_scalar(
        mismatch, bounds=bounds, method="bounded", options={"xatol": RESOLUTION_S}
    )
    return float(found.x)


def _within(
    t_s: FloatArray, angle_rad: FloatArray, t_truth_s: FloatArray, margin_s: float
) -> tuple[FloatArray, FloatArray]:
    """Select the samples inside the stamps of the truth, margin_s away from both ends."""
    t = np.asarray(t_s, dtype=np.float64)
    angle = np.asarray(angle_rad, dtype=np.float64)
    first, last = math.inf, -math.inf
    if len(t_truth_s):
        first, last = float(t_truth_s[0]), float(t_truth_s[-1])
    inside = (t >= first + margin_s) & (t <= last - margin_s)
    count = np.count_nonzero(inside)
    if count < MIN_ANGLES:
        raise AnalysisError(
            f"{count} angles inside [{first:.2f}, {last:.2f}] s; need {MIN_ANGLES}: "
            "record truth longer"
        )
    return t[inside], angle[inside]
