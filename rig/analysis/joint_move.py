"""Move of an elastic joint: what was recorded at the samples of its drive, and its figures."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
SETTLED_SPEED_SHARE = 0.01  # band of the settling time, share of the largest reference speed
REST_SHARE = 0.2  # last share of the samples after the move, for the torque at rest
LIMIT_SHARE = 0.999  # share of the torque limit; torque above it counts as limited
CRUISE_SPEED_SHARE = 1.0 - 1e-6  # of the top speed of the reference: it counts as constant
MIN_CRUISE_SAMPLES = 20
ARRIVED_SHARE = 0.01  # final error of a load that reached its goal, share of the move


class Recording(NamedTuple):
    """Recording of a run; every array (N,), those of the load at its own shaft."""

    t_s: FloatArray
    end_s: float  # of the reference
    reference_rad: FloatArray  # reference of the load
    reference_rad_s: FloatArray
    load_rad: FloatArray  # truth
    load_rad_s: FloatArray  # truth
    measured_rad_s: FloatArray  # speed of the load by integration of its accelerometer
    torque_n_m: FloatArray  # applied torque, held from this sample to the next
    integration_error_rad: float  # bound of the simulation, at the motor


class MoveMetrics(NamedTuple):
    """Figures of a run.

    The residual is the largest |speed| of the load after the end of the move.
    """

    residual: float  # share of the largest reference speed
    residual_measured: float  # the same from the accelerometer
    # settling time from the end of the reference, band SETTLED_SPEED_SHARE; inf if never
    settled_s: float
    speed_error: float  # rms against the reference from the start of the move, share likewise
    overshoot_deg: float  # excess of the load angle over the goal
    final_error_deg: float  # the same at the end of the recording, signed
    arrived: bool  # final error within ARRIVED_SHARE of the move
    peak_torque_n_m: float
    rms_torque_n_m: float  # over the move
    rest_torque_n_m: float  # rms over REST_SHARE: limit cycle by encoder steps or friction
    at_limit_s: float  # duration of limited torque


def move_metrics(
    recording: Recording, delay_s: float = 0.0, torque_limit_n_m: float = math.inf
) -> MoveMetrics:
    """Compute the figures of a run whose reference moves.

    delay_s is the intended delay of the controller; the torque limit is that of drive and bench.
    """
    r = recording
    after, moving = r.t_s >= r.end_s + delay_s, (r.t_s >= 0.0) & (r.t_s < r.end_s + delay_s)
    fastest, goal = float(np.abs(r.reference_rad_s).max()), float(r.reference_rad[-1])
    beyond = (r.load_rad - goal) * math.copysign(1.0, goal)
    return MoveMetrics(
        residual=float(np.abs(r.load_rad_s[after]).max()) / fastest,
        residual_measured=float(np.abs(r.measured_rad_s[after]).max()) / fastest,
        settled_s=_settled_s(
            r.t_s[after] - r.end_s, np.abs(r.load_rad_s[after]) > SETTLED_SPEED_SHARE * fastest
        ),
        speed_error=float(np.sqrt(np.mean((r.load_rad_s - r.reference_rad_s)[r.t_s >= 0.0] ** 2)))
        / fastest,
        overshoot_deg=math.degrees(max(0.0, float(beyond.max()))),
        final_error_deg=math.degrees(float(beyond[-1])),
        arrived=bool(abs(beyond[-1]) <= ARRIVED_SHARE * abs(goal)),
        peak_torque_n_m=float(np.abs(r.torque_n_m).max()),
        rms_torque_n_m=float(np.sqrt(np.mean(r.torque_n_m[moving] ** 2))),
        rest_torque_n_m=float(
            np.sqrt(
                np.mean(r.torque_n_m[-max(1, int(REST_SHARE * np.count_nonzero(after))) :] ** 2)
            )
        ),
        at_limit_s=float(
            np.count_nonzero(np.abs(r.torque_n_m) >= LIMIT_SHARE * torque_limit_n_m)
            * (r.t_s[1] - r.t_s[0])
        ),
    )


def cruise_ripple_rad_s(recording: Recording) -> float | None:
    """Compute the standard deviation of the load speed in the second half of the constant speed.

    None for a move with less than MIN_CRUISE_SAMPLES at its top speed.
    """
    r = recording
    speed = np.abs(r.reference_rad_s)
    cruise = np.flatnonzero(speed >= CRUISE_SPEED_SHARE * speed.max())
    if cruise.size < MIN_CRUISE_SAMPLES:
        return None
    return float(np.std(r.load_rad_s[cruise[cruise.size // 2 :]]))


def _settled_s(t_s: FloatArray, moves: NDArray[np.bool_]) -> float:
    """Find the first instant after which `moves` is False for good; inf if there is none."""
    last = np.flatnonzero(moves)
    first = last[-1] + 1 if last.size else 0
    return float(t_s[first]) if first < t_s.size else math.inf


def integrated_speed(t_s: FloatArray, acceleration: FloatArray, before: int) -> FloatArray:
    """Integrate the acceleration (N,) at t_s by trapezoids, minus the bias of the sensor.

    The bias is the mean of the first `before` samples, at rest. As source 001 does.
    """
    unbiased = acceleration - acceleration[:before].mean()
    steps = (unbiased[1:] + unbiased[:-1]) / 2.0 * np.diff(t_s)
    return np.concatenate([[0.0], np.cumsum(steps)])
