"""The polynomial that meets any set of conditions q^(k)(t) = value, gaps allowed (Hermite-Birkhoff interpolation)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planners import bounds
from planners.errors import NotConverged, PlanError, check_range
from planners.trajectories.pieces import ExpPolynomial, FloatArray, polynomial
from planners.trajectories.trajectory import Trajectory

MOST = 32  # conditions; powers of a time are then numbers
SINGULAR = 1e-12  # smallest by largest singular value of the conditions in scaled time
RESIDUAL = 1e-9  # largest miss of a condition, as a share of the polynomial's size


class Condition(NamedTuple):
    """Derivative `order` of the position is value [m/s^order] at t_s, on any clock."""

    t_s: float
    order: int
    value: float

    def __str__(self) -> str:
        return f"q^({self.order})({self.t_s:g} s)"


def hermite_birkhoff(conditions: Sequence[Condition]) -> Trajectory:
    """The polynomial with as many powers as conditions, from the first of their times to the last (source 000).

    Solved in Chebyshev polynomials of the centred and scaled time. Raises PlanError for a condition that is no number, is
    given twice or asks a derivative beyond the degree, and for sets without a unique answer, naming those that clash;
    NotConverged when rounding spoils a condition by more than RESIDUAL.
    """
    _check(conditions)
    times = np.array([c.t_s for c in conditions])
    middle, half_s = (times.max() + times.min()) / 2, (times.max() - times.min()) / 2
    matrix = _matrix(conditions, (times - middle) / half_s)  # (n, n)
    scale = np.abs(matrix).max(axis=1)
    rows = matrix / scale[:, None]
    left, sizes, _ = np.linalg.svd(rows)
    if sizes[-1] <= SINGULAR * sizes[0]:
        clash = [
            str(c) for c, share in zip(conditions, np.abs(left[:, -1]), strict=True) if share > 1e-6
        ]
        raise PlanError(
            f"conditions {', '.join(clash)} clash: singular values {sizes[-1]:.3g} to {sizes[0]:.3g}; their ratio must be "
            f"> {SINGULAR:g}: move one in time or replace it"
        )
    wanted = np.array([c.value * half_s**c.order for c in conditions]) / scale
    answer = np.linalg.solve(rows, wanted)
    piece = _piece(answer, half_s)
    start_s = float(times.min())
    found = (
        np.array(
            [piece.at(np.array(c.t_s - start_s), c.order) * half_s**c.order for c in conditions]
        )
        / scale
    )
    worst = float(np.abs(found - wanted).max())
    if not worst <= RESIDUAL * float(np.abs(answer).sum()):
        raise NotConverged(
            f"a polynomial of degree {len(conditions) - 1} misses its conditions by {worst:.3g}, scaled; must be "
            f"<= {RESIDUAL:g} of its size: split the move, or take a spline"
        )
    return Trajectory((piece,))


def _check(conditions: Sequence[Condition]) -> None:
    n = len(conditions)
    check_range("number of conditions", n, 2, MOST, "split the move, or take a spline")
    for c in conditions:
        check_range(
            f"time of condition {c}", c.t_s, -bounds.LONGEST_S, bounds.LONGEST_S, "mend or drop it"
        )
        bounds.rate(f"condition {c}", c.value)
        if not 0 <= c.order < n:
            raise PlanError(
                f"condition {c} among {n}; its order must be 0 to {n - 1}, the degree: add conditions of lower order"
            )
    twice = [
        f"q^({order})({t_s:g} s)"
        for (t_s, order), k in Counter((c.t_s, c.order) for c in conditions).items()
        if k > 1
    ]
    if twice:
        raise PlanError(
            f"condition {twice[0]} is given more than once; must be given once: drop one"
        )
    if len({c.t_s for c in conditions}) < 2:
        raise PlanError(
            f"conditions at {len({c.t_s for c in conditions})} times; must be >= 2: add one at another time"
        )
    bounds.duration(max(c.t_s for c in conditions) - min(c.t_s for c in conditions))
    for order in range(n):  # Polya: the derivatives below an order alone must fix as many powers
        lower = sum(c.order <= order for c in conditions)
        if lower <= order:
            raise PlanError(
                f"{lower} conditions on derivatives 0 to {order} of {n}; must be >= {order + 1}, or lower powers stay free: "
                f"replace one of higher order by one of order <= {order}"
            )


def _matrix(conditions: Sequence[Condition], x: FloatArray) -> FloatArray:
    """Derivative of each Chebyshev polynomial (columns) at each condition's scaled time."""
    from numpy.polynomial.chebyshev import chebder, chebval

    basis = np.eye(len(conditions))
    return np.array(
        [
            chebval(place, chebder(basis, c.order))
            for c, place in zip(conditions, x.tolist(), strict=True)
        ]
    )


def _piece(series: FloatArray, half_s: float) -> ExpPolynomial:
    """From Chebyshev coefficients on [-1, 1] to powers of the time since the start."""
    from numpy.polynomial.chebyshev import cheb2poly

    powers = polynomial(2.0, cheb2poly(series).tolist()).window(-1.0, 2.0).coefficients
    return polynomial(2.0 * half_s, [c / half_s**j for j, c in enumerate(powers)])
