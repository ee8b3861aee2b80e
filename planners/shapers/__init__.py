"""Input shapers: table of shapers of one mode by name, and the joint shaper of several modes.

Imports models, laws, trajectories and planners/problem.py.
"""

from __future__ import annotations

from collections.abc import Callable

from planners.shapers.formulas import (
    ei,
    ei_three_hump,
    ei_two_hump,
    mzv,
    um_zv,
    zero_vibration,
    zv,
    zvd,
    zvdd,
    zvddd,
)
from planners.shapers.impulses import Shaper, convolve, insensitivity, residual, transform
from planners.shapers.joint import joint

__all__ = [
    "SHAPERS",
    "Shaper",
    "convolve",
    "ei",
    "ei_three_hump",
    "ei_two_hump",
    "insensitivity",
    "joint",
    "mzv",
    "residual",
    "transform",
    "um_zv",
    "zero_vibration",
    "zv",
    "zvd",
    "zvdd",
    "zvddd",
]

SHAPERS: dict[str, Callable[[complex], Shaper]] = {
    "zv": zv,
    "zvd": zvd,
    "zvdd": zvdd,
    "zvddd": zvddd,
    "mzv": mzv,
    "ei": ei,
    "ei_two_hump": ei_two_hump,
    "ei_three_hump": ei_three_hump,
    "um_zv": um_zv,
}
