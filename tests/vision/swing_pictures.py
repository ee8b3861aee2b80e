"""Small pictures of a swinging cable or bob, drawn in closed form; shares no code with vision."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.special import ndtr

Image = np.ndarray[Any, np.dtype[np.uint8]]
FloatArray = np.ndarray[Any, np.dtype[np.float64]]
Point = tuple[float, float]

WIDTH, HEIGHT = 200, 160
PIVOT_PX = (100.0, -16.0)
WHITE, INK, NOISE, BLUR_PX = 200.0, 35.0, 2.5, 0.8
AMPLITUDE_RAD, STEP_RAD = 0.25, 0.9  # of the swing, and its phase from picture to picture


def swing(count: int, amplitude_rad: float = AMPLITUDE_RAD, middle_rad: float = 0.0) -> FloatArray:
    """Angles (count,) of a swing [rad]."""
    return middle_rad + amplitude_rad * np.sin(STEP_RAD * np.arange(count))


def cable(
    angle_rad: float,
    pivot_px: Point = PIVOT_PX,
    width_px: float = 2.5,
    size: tuple[int, int] = (WIDTH, HEIGHT),
    blur_px: float = BLUR_PX,
) -> FloatArray:
    """Share 0..1 of each pixel (height, width) that a cable from the pivot downwards covers."""
    width, height = size
    slope = math.tan(angle_rad)
    rows = np.arange(float(height))
    columns = pivot_px[0] + slope * (rows - pivot_px[1])
    half = 0.5 * width_px
    reach = math.ceil((half + 5.0 * blur_px) / math.cos(angle_rad)) + 1
    near = np.rint(columns).astype(int)[:, None] + np.arange(-reach, reach + 1)
    distance = (near - columns[:, None]) * math.cos(angle_rad)
    profile = ndtr((distance + half) / blur_px) - ndtr((distance - half) / blur_px)
    seen = (near >= 0) & (near < width) & (rows >= pivot_px[1])[:, None]
    cover = np.zeros((height, width))
    cover[np.nonzero(seen)[0], near[seen]] = profile[seen]
    return cover


def disc(centre_px: Point, radius_px: float, size: tuple[int, int] = (WIDTH, HEIGHT)) -> FloatArray:
    """Share 0..1 of each pixel (height, width) that a disc covers."""
    width, height = size
    across = np.arange(width) - centre_px[0]
    along = np.arange(height) - centre_px[1]
    distance = np.hypot(across, along[:, None])
    return np.asarray(ndtr((radius_px - distance) / BLUR_PX))


def bob(
    angle_rad: float,
    pivot_px: Point = PIVOT_PX,
    length_px: float = 120.0,
    radius_px: float = 9.0,
) -> FloatArray:
    """Share of each pixel that a bob without a cable covers."""
    u = pivot_px[0] + length_px * math.sin(angle_rad)
    v = pivot_px[1] + length_px * math.cos(angle_rad)
    return disc((u, v), radius_px)


def picture(
    cover: FloatArray,
    random: np.random.Generator,
    ground: float = WHITE,
    ink: float = INK,
    noise: float = NOISE,
) -> Image:
    """One plane (height, width): ground, with ink where it is covered."""
    light = ground + (ink - ground) * cover + noise * random.standard_normal(cover.shape)
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)


def coloured(
    cover: FloatArray,
    random: np.random.Generator,
    ground: tuple[float, float, float],
    ink: tuple[float, float, float],
) -> Image:
    """Picture (height, width, 3) blue, green, red; ground and ink in the same order."""
    planes = [picture(cover, random, *levels) for levels in zip(ground, ink, strict=True)]
    return np.stack(planes, axis=2)


def swinging(
    count: int, seed: int = 1, amplitude_rad: float = AMPLITUDE_RAD, width_px: float = 2.5
) -> list[Image]:
    """Pictures of a dark cable on white that swings about PIVOT_PX."""
    random = np.random.default_rng(seed)
    return [
        picture(cable(float(angle), width_px=width_px), random)
        for angle in swing(count, amplitude_rad)
    ]
