"""How dark the cable is across its width, summed up, so that exposure blur becomes a difference of two look-ups.

The darkening at distance d from the cable's axis is p(d) = C [Phi((d + w/2) / s) - Phi((d - w/2) / s)], s^2 = psf^2 + 1/12
(lens blur and pixel box). A cable that sweeps evenly from column a to b during the exposure darkens column x by the
mean of p, (P(x - a) - P(x - b)) / (b - a), where P is the integral of p: P(d) = C s [G((d + w/2) / s) - G((d - w/2) / s)],
G(z) = z Phi(z) + phi(z).
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_rig.params import CameraParams

PHASE_BITS = 8
PHASES = (
    1 << PHASE_BITS
)  # sub-pixel positions; half a phase is at most 0.2 grey levels on the default cable's flank
TILTS = 256  # steps of cos(tilt); half a step is at most 0.2 grey levels
FINE = 1024  # samples a pixel of P(d) before it is stretched by 1/cos(tilt): 1e-5 px levels of interpolation error
TAILS = 4.5  # standard deviations beyond the cable's edge, where the darkening is below 1e-3 grey levels


class Windows(NamedTuple):
    """P over strips of pixels: `of[phase, k]` is one item of `width` float32, P(k - zero - phase / PHASES + 0, 1, ...)."""

    of: NDArray[np.void]  # (PHASES, last + 1)
    zero: int
    last: int  # greatest k


def reach_px(camera: CameraParams, cos_tilt: float) -> int:
    """Columns to each side of the axis beyond which a cable tilted by acos(cos_tilt) darkens nothing."""
    return math.ceil(_edge_px(camera) / cos_tilt)


@functools.lru_cache(maxsize=64)
def windows(camera: CameraParams, cos_tilt: float, width: int) -> Windows:
    """Look-up table of P for strips of `width` columns, anywhere from wholly left to wholly right of the cable."""
    zero = width + reach_px(camera, cos_tilt) + 1
    d_px, p_px = _integral(camera)
    column = np.arange(2 * zero) - zero - np.arange(PHASES)[:, None] / PHASES  # (PHASES, 2 zero)
    table = (np.interp(cos_tilt * column, d_px, p_px) / cos_tilt).astype(np.float32)
    last = 2 * zero - width
    of: NDArray[np.void] = np.ndarray(
        (PHASES, last + 1), np.dtype((np.void, 4 * width)), table, strides=table.strides
    )
    return Windows(of, zero, last)


@functools.lru_cache(maxsize=4)
def _integral(camera: CameraParams) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distances d [px] and P(d) [grey levels px], from 0 to its full value; constant beyond."""
    s, half, edge = _sigma_px(camera), 0.5 * camera.cable_width_px, _edge_px(camera)
    d = np.linspace(-edge, edge, 2 * math.ceil(FINE * edge) + 1)
    p = [camera.contrast * s * (_ramp((x + half) / s) - _ramp((x - half) / s)) for x in d.tolist()]
    return d, np.array(p)


def _ramp(z: float) -> float:
    """G(z) = z Phi(z) + phi(z), the integral of the normal distribution function."""
    return 0.5 * z * math.erfc(-z / math.sqrt(2.0)) + math.exp(-0.5 * z * z) / math.sqrt(
        2.0 * math.pi
    )


def _edge_px(camera: CameraParams) -> float:
    return 0.5 * camera.cable_width_px + TAILS * _sigma_px(camera)


def _sigma_px(camera: CameraParams) -> float:
    return math.sqrt(camera.psf_px**2 + 1.0 / 12.0)
