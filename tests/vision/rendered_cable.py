"""Images of a cable with an exact angle, in closed form; shares no code with sim_rig."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr

Grey = np.ndarray[Any, np.dtype[np.uint8]]
FloatArray = np.ndarray[Any, np.dtype[np.float64]]

WIDTH, HEIGHT = 640, 480
PIVOT_PX = (320.0, -40.0)
# over a pixel; exact to 1e-4 of the contrast for psf_px >= 0.7
NODES, WEIGHTS = np.polynomial.legendre.leggauss(3)
BLUR_STEPS = 9


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Straight dark cable through the pivot before a screen; grey levels 0..255.

    During the exposure the cable turns by turn_rad and the pivot moves by shift_px; angle and pivot
    are those at mid-exposure.
    """

    angle_rad: float = 0.0
    pivot_px: tuple[float, float] = PIVOT_PX
    width_px: float = 2.5
    psf_px: float = 0.8
    background: float = 210.0
    contrast: float = 165.0
    turn_rad: float = 0.0
    shift_px: float = 0.0

    def light(self) -> FloatArray:
        """Grey levels (HEIGHT, WIDTH) before noise and rounding."""
        moving = self.turn_rad != 0.0 or self.shift_px != 0.0
        moments = (np.arange(BLUR_STEPS) + 0.5) / BLUR_STEPS - 0.5 if moving else np.zeros(1)
        dark = np.zeros((HEIGHT, WIDTH))
        for moment in moments:
            pivot = (self.pivot_px[0] + moment * self.shift_px, self.pivot_px[1])
            dark += stripe(
                self.angle_rad + moment * self.turn_rad, pivot, self.width_px, self.psf_px
            )
        return self.background - self.contrast / len(moments) * dark


def stripe(
    angle_rad: float, through_px: tuple[float, float], width_px: float, psf_px: float
) -> FloatArray:
    """Darkness 0..1 (HEIGHT, WIDTH) of a stripe.

    A box of width_px, blurred by a Gaussian, integrated over each pixel.
    """
    slope, cosine = math.tan(angle_rad), math.cos(angle_rad)
    v = np.arange(HEIGHT)
    u0 = through_px[0] + slope * (v - through_px[1])
    reach = math.ceil((0.5 * width_px + 5.0 * psf_px) / cosine + 1.0)
    u = np.rint(u0).astype(int)[:, None] + np.arange(-reach, reach + 1)
    inside = np.zeros(u.shape)
    for du, wu in zip(NODES, WEIGHTS, strict=True):
        for dv, wv in zip(NODES, WEIGHTS, strict=True):
            d = (u + du / 2.0 - u0[:, None] - slope * dv / 2.0) * cosine
            profile = ndtr((d + width_px / 2.0) / psf_px) - ndtr((d - width_px / 2.0) / psf_px)
            inside += wu * wv / 4.0 * profile
    dark = np.zeros((HEIGHT, WIDTH))
    seen = (u >= 0) & (u < WIDTH)
    dark[np.broadcast_to(v[:, None], u.shape)[seen], u[seen]] = inside[seen]
    return dark


class Camera:
    """Camera that adds read-out noise and rounds; the noise is a random part of one large array."""

    def __init__(self, seed: int, noise: float = 4.0) -> None:
        self.rng = np.random.default_rng(seed)
        self.noise = noise * self.rng.standard_normal((2 * HEIGHT, 2 * WIDTH))

    def expose(self, light: FloatArray) -> Grey:
        """Image (HEIGHT, WIDTH) uint8, clipped at 0 and 255."""
        v, u = self.rng.integers(HEIGHT), self.rng.integers(WIDTH)
        noisy = light + self.noise[v : v + HEIGHT, u : u + WIDTH]
        return np.clip(np.rint(noisy), 0.0, 255.0).astype(np.uint8)
