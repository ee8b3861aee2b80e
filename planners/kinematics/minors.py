"""Linear systems of four unknowns in plain floats, faster than an array for one system."""

from __future__ import annotations

Vector4 = tuple[float, float, float, float]
Matrix4 = tuple[Vector4, Vector4, Vector4, Vector4]


def solve_by_minors(
    rows: Matrix4, right: Vector4, min_determinant: float
) -> tuple[Vector4 | None, float]:
    """Solve A x = right; return x and det A, without x where |det A| < min_determinant.

    x = adj(A) right / det A, with the adjugate from the 2 x 2 minors of the upper and of the lower
    two rows (Laplace expansion).
    """
    (a0, a1, a2, a3), (b0, b1, b2, b3), (c0, c1, c2, c3), (d0, d1, d2, d3) = rows
    p, q, r, s = right
    u01 = a0 * b1 - a1 * b0
    u02 = a0 * b2 - a2 * b0
    u03 = a0 * b3 - a3 * b0
    u12 = a1 * b2 - a2 * b1
    u13 = a1 * b3 - a3 * b1
    u23 = a2 * b3 - a3 * b2
    l01 = c0 * d1 - c1 * d0
    l02 = c0 * d2 - c2 * d0
    l03 = c0 * d3 - c3 * d0
    l12 = c1 * d2 - c2 * d1
    l13 = c1 * d3 - c3 * d1
    l23 = c2 * d3 - c3 * d2
    determinant = u01 * l23 - u02 * l13 + u03 * l12 + u12 * l03 - u13 * l02 + u23 * l01
    if not abs(determinant) >= min_determinant:
        return None, determinant
    # right side combined with the upper and with the lower rows
    e0 = p * b0 - q * a0
    e1 = p * b1 - q * a1
    e2 = p * b2 - q * a2
    e3 = p * b3 - q * a3
    f0 = r * d0 - s * c0
    f1 = r * d1 - s * c1
    f2 = r * d2 - s * c2
    f3 = r * d3 - s * c3
    x0 = e1 * l23 - e2 * l13 + e3 * l12 + f1 * u23 - f2 * u13 + f3 * u12
    x1 = -e0 * l23 + e2 * l03 - e3 * l02 - f0 * u23 + f2 * u03 - f3 * u02
    x2 = e0 * l13 - e1 * l03 + e3 * l01 + f0 * u13 - f1 * u03 + f3 * u01
    x3 = -e0 * l12 + e1 * l02 - e2 * l01 - f0 * u12 + f1 * u02 - f2 * u01
    scale = 1.0 / determinant
    return (x0 * scale, x1 * scale, x2 * scale, x3 * scale), determinant
