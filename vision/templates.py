"""Templates of the cable for the fit of its axis in single rows, matched to width and blur."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

FloatArray = np.ndarray[Any, np.dtype[np.float64]]

PHASES = 64  # templates per pixel
TAIL_SIGMAS = 3.6  # of the template beyond the edge of the cable; what is cut off is 3e-4 of it
MIN_HALF_PX = 5
# sharper templates would see less than two pixels of an edge, and bias towards whole pixels
MIN_BLUR_PX = 1.0


class CableLook(NamedTuple):
    """Width of the cable in the picture and blur of its edges (standard deviation, pixel included).

    The profile at distance d from the axis is Phi((d + w/2) / s) - Phi((d - w/2) / s).
    """

    width_px: float = 2.5
    blur_px: float = 0.85


class Templates(NamedTuple):
    """First and second derivative of the profile at every sub-pixel phase from -0.5 up to 0.5.

    Each sums to zero, so the level of the background cancels. The correlation of a row with the
    first one is zero on the axis; with the profile itself as template that is the position of
    maximum likelihood for white noise.
    """

    half_px: int
    pairs: np.ndarray[Any, np.dtype[np.float32]]  # (PHASES, 2, 2 half + 1)
    # noise of the first and of the second derivative per grey level of noise
    first_norm: float
    second_norm: float
    trend: float  # of the first one on a row that rises by one grey level a pixel
    # gradient of a row [grey levels/px] by the two outer pixels on each side, (2 half + 1,)
    outer: np.ndarray[Any, np.dtype[np.float32]]
    outer_norm: float

    @property
    def taps(self) -> int:
        """Number of pixels of a template."""
        return 2 * self.half_px + 1


@lru_cache(maxsize=64)
def make_templates(look: CableLook) -> Templates:
    """Compute the templates of a cable."""
    reach = 0.5 * look.width_px + TAIL_SIGMAS * max(look.blur_px, MIN_BLUR_PX)
    half = max(MIN_HALF_PX, math.ceil(reach))
    phase = np.arange(PHASES)[:, None] / PHASES - 0.5
    x = np.arange(-half, half + 1) - phase
    blur_px = max(look.blur_px, MIN_BLUR_PX)
    left, right = ((x + sign * 0.5 * look.width_px) / blur_px for sign in (1.0, -1.0))
    scale = 1.0 / (math.sqrt(2.0 * math.pi) * blur_px)
    first = scale * (np.exp(-0.5 * left**2) - np.exp(-0.5 * right**2))
    bells = left * np.exp(-0.5 * left**2) - right * np.exp(-0.5 * right**2)
    second = -scale / blur_px * bells
    pair = np.stack([first, second], axis=1)
    pairs = np.asarray(pair - pair.mean(axis=2, keepdims=True)).astype(np.float32)
    norms = np.linalg.norm(pairs[PHASES // 2], axis=1)
    trend = float(pairs[PHASES // 2, 0] @ np.arange(-half, half + 1))
    outer = np.zeros(2 * half + 1, np.float32)
    outer[-2:] = 0.5 / (2 * half - 1)
    outer[:2] = -outer[-2:]
    outer_norm = float(np.linalg.norm(outer))
    return Templates(half, pairs, float(norms[0]), float(norms[1]), trend, outer, outer_norm)
