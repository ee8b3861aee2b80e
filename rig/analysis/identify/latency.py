"""Delays found by laying one curve over another: the robot behind its plan, the camera behind the truth."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.errors import AnalysisError
from rig.analysis.identify.swing import truth_at

FloatArray = npt.NDArray[np.float64]

MIN_TRAVEL_M = 0.001  # less is rest, and rest has no delay
EARLIEST_S, LATEST_S = -0.1, 0.5  # command latency is looked for in between
MAX_MISALIGNMENT_S = 0.25  # an eighth of a 2 s swing: the nearest copy of the curve is far
COARSE_STEP_S = 0.01
RESOLUTION_S = 1e-6


def command_latency_s(
    t_s: FloatArray, actual_m: FloatArray, plan: Callable[[FloatArray], FloatArray]
) -> float | None:
    """Delay d [s] that minimises rms(actual(t + d) - plan(t)) over the move.

    t_s, actual_m (N,): measured position at its own stamps, strictly increasing. plan maps stamps (M,) on the same
    time axis to positions (M,) [m], at rest before and after its move. None when plan or platform travels less than
    1 mm, or when no delay in -0.1..0.5 s is better than its neighbours.
    """
    from scipy.interpolate import CubicSpline

    t, actual = np.asarray(t_s, dtype=np.float64), np.asarray(actual_m, dtype=np.float64)
    planned = plan(t)
    if t.size < 4 or min(np.ptp(planned), np.ptp(actual)) < MIN_TRAVEL_M:
        return None
    move, measured = _moving(planned), CubicSpline(t, actual)

    def mismatch(delay_s: float) -> float:
        at_s = np.clip(
            t[move] + delay_s, t[0], t[-1]
        )  # the platform rests beyond both ends of the log
        return float(np.mean((measured(at_s) - planned[move]) ** 2))

    return _best_delay_s(mismatch, EARLIEST_S, LATEST_S)


def alignment_s(
    t_valid_s: FloatArray,
    angle_rad: FloatArray,
    t_truth_s: FloatArray,
    truth_angle_rad: FloatArray,
    truth_rate_rad_s: FloatArray,
) -> float:
    """Delay [s] of the measured swing (N,) behind the truth (M,), positive = measured late, by least rms mismatch.

    Samples within 0.26 s of the truth's ends are left out, for every tried delay has to meet the same samples.
    Raises AnalysisError when fewer than 10 are left, or when no delay within +-0.25 s fits better than its neighbours.
    """
    t, angle = _within(t_valid_s, angle_rad, t_truth_s, MAX_MISALIGNMENT_S + COARSE_STEP_S)

    def mismatch(delay_s: float) -> float:
        return float(
            np.mean(
                (angle - truth_at(t - delay_s, t_truth_s, truth_angle_rad, truth_rate_rad_s)) ** 2
            )
        )

    delay_s = _best_delay_s(mismatch, -MAX_MISALIGNMENT_S, MAX_MISALIGNMENT_S)
    if delay_s is None:
        raise AnalysisError(
            f"no best delay within +-{MAX_MISALIGNMENT_S} s: check sign, stamps, and that the load swings"
        )
    return delay_s


def swing_error_rms_rad(
    t_valid_s: FloatArray,
    angle_rad: FloatArray,
    t_truth_s: FloatArray,
    truth_angle_rad: FloatArray,
    truth_rate_rad_s: FloatArray,
) -> float:
    """Rms [rad] of measured (N,) minus true angle (M,) at the stamps as they are: no delay is fitted away.

    Samples outside the truth's stamps are left out; raises AnalysisError when fewer than 10 are left.
    """
    t, angle = _within(t_valid_s, angle_rad, t_truth_s, 0.0)
    return float(
        np.sqrt(np.mean((angle - truth_at(t, t_truth_s, truth_angle_rad, truth_rate_rad_s)) ** 2))
    )


def _moving(planned: FloatArray) -> slice:
    """From the last sample at rest before the plan's move to the first one at rest after it."""
    moves = np.flatnonzero(np.abs(np.diff(planned)) > 1e-9 * np.ptp(planned))
    return slice(int(moves[0]), int(moves[-1]) + 2)


def _best_delay_s(mismatch: Callable[[float], float], low_s: float, high_s: float) -> float | None:
    """Coarse scan, then Brent's bounded minimisation around its best; None when that is an end of the range."""
    from scipy.optimize import minimize_scalar

    delays = np.linspace(low_s, high_s, 1 + round((high_s - low_s) / COARSE_STEP_S))
    k = int(np.argmin([mismatch(float(d)) for d in delays]))
    if k in (0, delays.size - 1):
        return None
    around = (float(delays[k - 1]), float(delays[k + 1]))
    return float(
        minimize_scalar(
            mismatch, bounds=around, method="bounded", options={"xatol": RESOLUTION_S}
        ).x
    )


def _within(
    t_s: FloatArray, angle_rad: FloatArray, t_truth_s: FloatArray, margin_s: float
) -> tuple[FloatArray, FloatArray]:
    t, angle = np.asarray(t_s, dtype=np.float64), np.asarray(angle_rad, dtype=np.float64)
    first, last = (
        (float(t_truth_s[0]), float(t_truth_s[-1])) if len(t_truth_s) else (math.inf, -math.inf)
    )
    inside = (t >= first + margin_s) & (t <= last - margin_s)
    if np.count_nonzero(inside) < 10:
        raise AnalysisError(
            f"{np.count_nonzero(inside)} angles inside [{first:.2f}, {last:.2f}] s; need 10: record truth longer"
        )
    return t[inside], angle[inside]
