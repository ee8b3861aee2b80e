"""Vectors of three components, as tuples of floats."""

from __future__ import annotations

import math
from collections.abc import Sequence

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)


def between(start: Vector, end: Vector, share: float) -> Vector:
    """Compute the point at a share of the way from start to end."""
    x, y, z = start
    return (
        x + (end[0] - x) * share,
        y + (end[1] - y) * share,
        z + (end[2] - z) * share,
    )


def rate(start: Vector, end: Vector, duration_s: float) -> Vector:
    """Compute the rate of the change from start to end."""
    return (
        (end[0] - start[0]) / duration_s,
        (end[1] - start[1]) / duration_s,
        (end[2] - start[2]) / duration_s,
    )


def moved(start: Vector, velocity: Vector, duration_s: float) -> Vector:
    """Compute where a velocity leads from start."""
    x, y, z = start
    return (
        x + velocity[0] * duration_s,
        y + velocity[1] * duration_s,
        z + velocity[2] * duration_s,
    )


def scaled(vector: Vector, factor: float) -> Vector:
    """Multiply a vector by a number."""
    x, y, z = vector
    return (x * factor, y * factor, z * factor)


def dot(a: Vector, b: Vector) -> float:
    """Compute the inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def mean(vectors: Sequence[Vector], weights: Sequence[float]) -> Vector:
    """Compute the weighted sum of vectors; the sum of the weights is 1."""
    total = ZERO
    for vector, weight in zip(vectors, weights, strict=True):
        total = moved(total, vector, weight)
    return total


def share_inside(start: Vector, end: Vector, centre: Vector, radius: float) -> float:
    """Compute the share of the way from start to end inside a sphere; start is inside.

    Root s of |b + s a|^2 = radius^2, where a = end - start and b = start - centre.
    """
    a = rate(start, end, 1.0)
    b = rate(centre, start, 1.0)
    length = dot(a, a)
    along = dot(a, b)
    room = radius * radius - dot(b, b)
    root = math.sqrt(max(0.0, along * along + length * room))
    share = (root - along) / length
    return min(1.0, max(0.0, share))
