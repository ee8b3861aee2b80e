"""Polynomial through conditions q^(k)(t) = value, gaps allowed (Hermite-Birkhoff interpolation)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planners import bounds
from planners.errors import NotConverged, PlanError, check_range
from planners.trajectories.pieces import ExpPolynomial, FloatArray, polynomial
from planners.trajectories.trajectory import Trajectory

MAX_CONDITIONS = 32  # beyond, powers of a time overflow or vanish
MIN_SINGULAR_VALUE_REL = 1e-12  # of the largest one, for the conditions in scaled time
RESIDUAL_REL = 1e-9  # largest error of a condition, relative to the sum of |coefficients|
CLASH_SHARE = 1e-6  # smallest entry of a singular vector whose condition counts as clashing


class Condition(NamedTuple):
    """Condition q^(order)(t_s) = value [m/s^order]; t_s counts from any origin."""

    t_s: float
    order: int
    value: float

    def __str__(self) -> str:
        return f"q^({self.order})({self.t_s:g} s)"


def hermite_birkhoff(conditions: Sequence[Condition]) -> Trajectory:
    """Compute the polynomial with as many coefficients as conditions (source 000).

    It lasts from the first of their times to the last. The system is solved in Chebyshev
    polynomials of the centred and scaled time.
    Raises PlanError for a condition that is not a number, is given twice or has an order above
    the degree, and for sets without a unique solution; the message names the conditions.
    Raises NotConverged when rounding violates a condition by more than RESIDUAL_REL.
    """
    _check(conditions)
    times = np.array([c.t_s for c in conditions])
    middle = (times.max() + times.min()) / 2
    half_s = (times.max() - times.min()) / 2
    matrix = _matrix(conditions, (times - middle) / half_s)  # (n, n)
    scale = np.abs(matrix).max(axis=1)
    rows = matrix / scale[:, None]
    _check_regular(conditions, rows)
    required = np.array([c.value * half_s**c.order for c in conditions]) / scale
    series = np.linalg.solve(rows, required)
    piece = _piece(series, half_s)
    reached = _scaled_values(piece, conditions, half_s) / scale
    worst = float(np.abs(reached - required).max())
    if not worst <= RESIDUAL_REL * float(np.abs(series).sum()):
        raise NotConverged(
            f"residual of a polynomial of degree {len(conditions) - 1} is {worst:.3g}, scaled; "
            f"must be <= {RESIDUAL_REL:g} of its size: split the move, or use a spline"
        )
    return Trajectory((piece,))


def _check(conditions: Sequence[Condition]) -> None:
    n = len(conditions)
    check_range("number of conditions", n, 2, MAX_CONDITIONS, "split the move, or use a spline")
    for c in conditions:
        check_range(
            f"time of condition {c}",
            c.t_s,
            -bounds.LONGEST_S,
            bounds.LONGEST_S,
            "correct or remove it",
        )
        bounds.rate(f"condition {c}", c.value)
        if not 0 <= c.order < n:
            raise PlanError(
                f"condition {c} among {n}; its order must be 0 to {n - 1}, the degree: "
                "add conditions of lower order"
            )
    _check_times(conditions)
    for order in range(n):  # Polya: derivatives 0 to order must fix order + 1 coefficients
        lower = sum(c.order <= order for c in conditions)
        if lower <= order:
            raise PlanError(
                f"{lower} conditions on derivatives 0 to {order} of {n}; must be >= {order + 1}, "
                "or lower coefficients stay free: "
                f"replace one of higher order by one of order <= {order}"
            )


def _check_times(conditions: Sequence[Condition]) -> None:
    """Raise PlanError for a repeated condition, or for fewer than two times."""
    counts = Counter((c.t_s, c.order) for c in conditions)
    for (t_s, order), count in counts.items():
        if count > 1:
            raise PlanError(
                f"condition q^({order})({t_s:g} s) is given {count} times; must be given once: "
                "remove one"
            )
    times = {c.t_s for c in conditions}
    if len(times) < 2:
        raise PlanError(f"conditions at {len(times)} times; must be >= 2: add one at another time")
    bounds.duration(max(times) - min(times))


def _check_regular(conditions: Sequence[Condition], rows: FloatArray) -> None:
    """Raise PlanError when the scaled matrix (n, n) is singular; name the conditions."""
    left, singular_values, _ = np.linalg.svd(rows)
    smallest, largest = singular_values[-1], singular_values[0]
    if not smallest <= MIN_SINGULAR_VALUE_REL * largest:
        return
    shares = np.abs(left[:, -1])
    clash = [str(conditions[k]) for k in np.flatnonzero(shares > CLASH_SHARE).tolist()]
    raise PlanError(
        f"conditions {', '.join(clash)} clash: singular values {smallest:.3g} to {largest:.3g}; "
        f"their ratio must be > {MIN_SINGULAR_VALUE_REL:g}: move one in time or replace it"
    )


def _matrix(conditions: Sequence[Condition], x: FloatArray) -> FloatArray:
    """Compute derivatives of the Chebyshev polynomials (columns) at scaled times x: (n, n)."""
    from numpy.polynomial.chebyshev import chebder, chebval

    basis = np.eye(len(conditions))
    rows = [
        chebval(place, chebder(basis, c.order))
        for c, place in zip(conditions, x.tolist(), strict=True)
    ]
    return np.array(rows)


def _scaled_values(
    piece: ExpPolynomial, conditions: Sequence[Condition], half_s: float
) -> FloatArray:
    """Compute the value of each condition on the piece, in scaled time: (n,)."""
    start_s = float(min(c.t_s for c in conditions))
    values = [piece.at(np.array(c.t_s - start_s), c.order) * half_s**c.order for c in conditions]
    return np.array(values)


def _piece(series: FloatArray, half_s: float) -> ExpPolynomial:
    """Convert Chebyshev coefficients on [-1, 1] to powers of the time since the start."""
    from numpy.polynomial.chebyshev import cheb2poly

    powers = polynomial(2.0, cheb2poly(series).tolist()).window(-1.0, 2.0).coefficients
    return polynomial(2.0 * half_s, [c / half_s**j for j, c in enumerate(powers)])
