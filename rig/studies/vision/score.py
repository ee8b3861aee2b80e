"""Figures of a tracker on pictures with known truth, and the bounds that they must meet."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from msgspec import Meta, Struct

from rig.run.toml_file import Section

FloatArray = np.ndarray[Any, np.dtype[np.float64]]
Expect = Literal["angle", "refuse"]
Bound = Annotated[float, Meta(ge=0, le=1e12)]

SAMPLING_SIGMAS = 3.0
WRONG_RAD = 5e-3  # an angle farther from the truth is silently wrong


class Angles(NamedTuple):
    """Angles of a sequence of pictures; NaN where a value is absent."""

    truth_rad: FloatArray  # (N,) absent: the cable is not visible
    angle_rad: FloatArray  # (N,) absent: refused
    sigma_rad: FloatArray  # (N,) standard deviation by the tracker
    bound_rad: FloatArray  # (N,) Cramer-Rao bound of the picture


class Score(Struct, frozen=True, kw_only=True):
    """Figures of a tracker on a scene, over the pictures with an angle.

    A figure without such pictures is NaN: every comparison with it is false.
    """

    frames: int
    refused: int  # pictures without an angle
    refused_share: float
    wrong: int  # pictures with an angle > WRONG_RAD off, or with one that should be refused
    wrong_share: float
    bias_rad: float  # mean error
    std_rad: float  # of the error about its mean
    worst_rad: float  # largest |error|
    std_over_bound: float  # rms of (error - bias) / bound
    error_over_sigma: float  # rms of error / sigma
    frames_per_s: float  # by the time spent in the tracker


class Bars(Section, frozen=True, kw_only=True):
    """Pass bars of a scene, table [scene.bars]; None = not judged.

    max_refused_share: 0 to 1. max_wrong: number of pictures. The others: as in Score.
    """

    max_wrong: Annotated[int, Meta(ge=0)] = 0
    max_refused_share: Bound | None = None
    max_bias_rad: Bound | None = None
    max_std_rad: Bound | None = None
    max_worst_rad: Bound | None = None
    max_std_over_bound: Bound | None = None
    max_error_over_sigma: Bound | None = None


def score(angles: Angles, seconds: float, expect: Expect = "angle") -> Score:
    """Compute the figures of a tracker that spent `seconds` on the pictures, N >= 1.

    expect = "refuse": every angle is wrong.
    """
    frames = len(angles.truth_rad)
    given = np.isfinite(angles.angle_rad)
    error = angles.angle_rad - angles.truth_rad
    right = np.abs(error) <= WRONG_RAD  # false where the truth is absent
    if expect == "refuse":
        right[:] = False
    refused = frames - int(np.count_nonzero(given))
    wrong = int(np.count_nonzero(given & ~right))
    known = error[np.isfinite(error)]
    bias_rad = _mean(known)
    return Score(
        frames=frames,
        refused=refused,
        refused_share=refused / frames,
        wrong=wrong,
        wrong_share=wrong / frames,
        bias_rad=bias_rad,
        std_rad=_rms(known - bias_rad),
        worst_rad=float(np.abs(known).max()) if known.size else math.nan,
        std_over_bound=_rms((error - bias_rad) / angles.bound_rad),
        error_over_sigma=_rms(error / angles.sigma_rad),
        frames_per_s=frames / seconds if seconds > 0.0 else math.nan,
    )


def _mean(x: FloatArray) -> float:
    return float(x.mean()) if x.size else math.nan


def _rms(x: FloatArray) -> float:
    """Root mean square of the numbers in x; NaN if there is none."""
    return math.sqrt(_mean(np.square(x[np.isfinite(x)])))


def failures(result: Score, bars: Bars) -> list[str]:
    """List the figures beyond their bars, each with value and bound.

    A figure that is NaN fails its bar. The bars of standard deviations are raised by what chance
    does to them in so few pictures, three deviations of the estimate.
    """
    pictures = max(result.frames - result.refused, 1)
    chance = 1.0 + SAMPLING_SIGMAS / math.sqrt(2.0 * pictures)
    judged = (
        ("silently wrong pictures", result.wrong, bars.max_wrong, 1.0, 1.0, ""),
        ("refused", result.refused_share, bars.max_refused_share, 1.0, 100.0, " %"),
        ("bias", abs(result.bias_rad), bars.max_bias_rad, 1.0, 1e3, " mrad"),
        ("std", result.std_rad, bars.max_std_rad, chance, 1e3, " mrad"),
        ("worst error", result.worst_rad, bars.max_worst_rad, 1.0, 1e3, " mrad"),
        ("std over bound", result.std_over_bound, bars.max_std_over_bound, chance, 1.0, ""),
        ("error over sigma", result.error_over_sigma, bars.max_error_over_sigma, chance, 1.0, ""),
    )
    failed = []
    for what, value, bar, factor, scale, unit in judged:
        if bar is None or value <= bar * factor:
            continue
        shown = "not defined" if math.isnan(value) else f"{value * scale:.4g}{unit}"
        of = f" with {pictures} pictures" if factor > 1.0 else ""
        failed.append(f"{what} {shown}; must be <= {bar * factor * scale:.4g}{unit}{of}")
    return failed
