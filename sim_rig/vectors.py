"""Vectors in space as tuples of floats; lists of them, one for each link."""

from __future__ import annotations

import math

Vector = tuple[float, float, float]
Vectors = list[Vector]


def dot(a: Vector, b: Vector) -> float:
    """Compute the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Compute the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def plus(a: Vector, b: Vector) -> Vector:
    """Add two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Vector, b: Vector) -> Vector:
    """Subtract b from a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(a: Vector, factor: float) -> Vector:
    """Multiply a vector by a number."""
    return factor * a[0], factor * a[1], factor * a[2]


def angle_over_sine(a: Vector, b: Vector) -> float:
    """Compute phi / sin(phi) of the angle phi between two unit vectors."""
    sine = math.hypot(*cross(a, b))
    return math.atan2(sine, dot(a, b)) / sine if sine > 1e-12 else 1.0


def moved(a: Vectors, rates: Vectors, time: float) -> Vectors:
    """Add rates times a time to each vector."""
    return [
        (x + time * vx, y + time * vy, z + time * vz)
        for (x, y, z), (vx, vy, vz) in zip(a, rates, strict=True)
    ]


def added(a: Vectors, b: Vectors) -> Vectors:
    """Add two lists vector by vector."""
    return [plus(one, other) for one, other in zip(a, b, strict=True)]


def runge_kutta_sum(
    a: Vectors, sixth: float, k1: Vectors, k2: Vectors, k3: Vectors, k4: Vectors
) -> Vectors:
    """Add sixth (k1 + 2 k2 + 2 k3 + k4) to each vector."""
    return [
        (
            x + sixth * (p[0] + 2.0 * (q[0] + r[0]) + s[0]),
            y + sixth * (p[1] + 2.0 * (q[1] + r[1]) + s[1]),
            z + sixth * (p[2] + 2.0 * (q[2] + r[2]) + s[2]),
        )
        for (x, y, z), p, q, r, s in zip(a, k1, k2, k3, k4, strict=True)
    ]


def product(matrix: list[list[float]], vectors: Vectors) -> Vectors:
    """Multiply a matrix (n, n) by a list of n vectors."""
    result = []
    for row in matrix:
        x = y = z = 0.0
        for factor, (vx, vy, vz) in zip(row, vectors, strict=True):
            x += factor * vx
            y += factor * vy
            z += factor * vz
        result.append((x, y, z))
    return result


def solve(rows: list[list[float]]) -> list[float]:
    """Solve n linear equations, symmetric and positive definite: rows (n, n + 1), changed."""
    n = len(rows)
    for k in range(n):
        pivot = rows[k]
        for i in range(k + 1, n):
            row = rows[i]
            factor = row[k] / pivot[k]
            for j in range(k + 1, n + 1):
                row[j] -= factor * pivot[j]
    result = [0.0] * n
    for k in range(n - 1, -1, -1):
        row = rows[k]
        rest = row[n]
        for j in range(k + 1, n):
            rest -= row[j] * result[j]
        result[k] = rest / row[k]
    return result
