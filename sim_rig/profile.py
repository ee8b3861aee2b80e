"""Integrated darkness profile of the cable; motion blur is the difference of two of its values.

The darkness at distance d from the axis of the cable, with s^2 = psf^2 + 1/12 (lens blur and pixel
box), is

    p(d) = C [Phi((d + w/2) / s) - Phi((d - w/2) / s)].

A cable that moves at constant speed from column a to b during the exposure darkens column x by the
mean of p, (P(x - a) - P(x - b)) / (b - a), where P is the integral of p:

    P(d) = C s [G((d + w/2) / s) - G((d - w/2) / s)],  G(z) = z Phi(z) + phi(z).
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_rig.camera_params import CameraParams

PHASE_BITS = 8
# sub-pixel positions; half a phase is at most 0.2 grey levels on the flank of the default cable
PHASES = 1 << PHASE_BITS
TILTS = 256  # steps of cos(tilt); half a step is at most 0.2 grey levels
# samples of P(d) per pixel, before scaling by 1 / cos(tilt): interpolation error 1e-5 px levels
SAMPLES_PER_PX = 1024
TAIL_SIGMAS = 4.5  # beyond the edge of the cable; the darkness there is below 1e-3 grey levels


class CableShape(NamedTuple):
    """Cable in the picture: width, lens blur (standard deviation) and contrast."""

    width_px: float
    psf_px: float
    contrast: float  # grey levels

    @classmethod
    def of(cls, camera: CameraParams) -> CableShape:
        """Take the shape from the parameters of a camera."""
        return cls(camera.cable_width_px, camera.psf_px, camera.contrast)


class StripTable(NamedTuple):
    """Table of P over strips of pixels.

    strips[phase, k] is one item of `width` float32, P(k - zero - phase / PHASES + 0, 1, ...).
    """

    strips: NDArray[np.void]  # (PHASES, last + 1)
    zero: int
    last: int  # largest k


@functools.lru_cache(maxsize=512)
def half_width_px(cable: CableShape, cos_tilt: float) -> int:
    """Compute half the width of the profile [px], for a cable tilted by acos(cos_tilt).

    The darkness is 0 beyond.
    """
    return math.ceil(_edge_px(cable) / cos_tilt)


@functools.lru_cache(maxsize=64)
def strip_table(cable: CableShape, cos_tilt: float, width: int) -> StripTable:
    """Compute P for strips of `width` columns at all positions relative to the cable.

    From entirely left to entirely right of the cable.
    """
    zero = width + half_width_px(cable, cos_tilt) + 1
    d_px, p_px = profile_table(cable)
    column = np.arange(2 * zero) - zero - np.arange(PHASES)[:, None] / PHASES  # (PHASES, 2 zero)
    table = (np.interp(cos_tilt * column, d_px, p_px) / cos_tilt).astype(np.float32)
    last = 2 * zero - width
    strips: NDArray[np.void] = np.ndarray(
        (PHASES, last + 1), np.dtype((np.void, 4 * width)), table, strides=table.strides
    )
    return StripTable(strips, zero, last)


@functools.lru_cache(maxsize=32)
def profile_table(cable: CableShape) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute distances d [px] and P(d) [grey levels px]; P is constant outside their range."""
    s, half, edge = _sigma_px(cable), 0.5 * cable.width_px, _edge_px(cable)
    d = np.linspace(-edge, edge, 2 * math.ceil(SAMPLES_PER_PX * edge) + 1)
    p = [
        cable.contrast * s * (_normal_integral((x + half) / s) - _normal_integral((x - half) / s))
        for x in d.tolist()
    ]
    return d, np.array(p)


def _normal_integral(z: float) -> float:
    """Compute the integral of the normal distribution function, G(z) = z Phi(z) + phi(z)."""
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return 0.5 * z * math.erfc(-z / math.sqrt(2.0)) + density


def _edge_px(cable: CableShape) -> float:
    return 0.5 * cable.width_px + TAIL_SIGMAS * _sigma_px(cable)


def _sigma_px(cable: CableShape) -> float:
    return math.sqrt(cable.psf_px**2 + 1.0 / 12.0)
