"""Local search for the allocation of time to intervals that minimises the total time.

The motion runs from rest to rest. Stretching it by a factor scales its speed, acceleration and
jerk by powers of the factor, so that any allocation needs exactly
max(v/vmax, sqrt(a/amax), cbrt(j/jmax)) times its own duration: N points leave N - 2 ratios.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from planners.splines.extremes import extremes
from planners.trajectories.pieces import FloatArray

# durations (..., K), points (K + 1,)
# -> durations (..., P) and coefficients (..., P, powers) of the pieces
Shape: TypeAlias = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]

LOG_STEP = 1e-5  # of ln(duration), for central differences
LOG_RANGE = 8.0  # largest change of ln(duration), a factor of 3000


class ShapeSearch:
    """Search over durations (..., K) of one law through points (K + 1, axes).

    bounds: order of derivative -> largest absolute value.
    """

    def __init__(self, shape: Shape, points: FloatArray, bounds: dict[int, float]) -> None:
        self.shape = shape
        self.points = points
        self.bounds = bounds

    def bound_shares(self, h: FloatArray) -> FloatArray:
        """Compute both extremes of each piece as shares of the bounds, the lowest negated.

        Shape (bounds, axes, 2, ..., pieces).
        """
        tables = [self.shape(h, q) for q in self.points.T]
        signed = np.array([_signed_extremes(tables, order) for order in self.bounds])
        divisors = np.array(list(self.bounds.values())).reshape(-1, *[1] * (signed.ndim - 1))
        shares: FloatArray = signed / divisors
        return shares

    def scaled(self, h: FloatArray) -> FloatArray:
        """Stretch each allocation to the shortest time within the bounds: (..., K)."""
        peaks = self.bound_shares(h).max(axis=-1).max(axis=(1, 2))  # (bounds, ...)
        factors = [peak ** (1.0 / order) for order, peak in zip(self.bounds, peaks, strict=True)]
        scaled: FloatArray = h * np.max(factors, axis=0)[..., None]
        return scaled

    def reached(self, h: FloatArray) -> dict[int, float]:
        """Compute the largest share of each bound."""
        shares = self.bound_shares(h)
        return {order: float(s.max()) for order, s in zip(self.bounds, shares, strict=True)}

    def refine(self, h: FloatArray) -> FloatArray:
        """Find the nearest local minimum.

        Sequential quadratic programming in the logarithms of the durations, then exact scaling.
        """
        from scipy.optimize import minimize

        h = self.scaled(h)
        whole, start = float(h.sum()), np.log(h)

        def total(x: FloatArray) -> float:
            return float(np.exp(x).sum()) / whole

        def slope(x: FloatArray) -> FloatArray:
            return np.asarray(np.exp(x)) / whole

        margins: Any = {"type": "ineq", "fun": self._margins, "jac": self._margin_slopes}
        options: Any = {"ftol": 1e-12, "maxiter": 200}
        bounds = [(x - LOG_RANGE, x + LOG_RANGE) for x in start.tolist()]
        found = minimize(
            total,
            start,
            jac=slope,
            bounds=bounds,
            constraints=margins,
            method="SLSQP",
            options=options,
        )
        better = self.scaled(np.exp(found.x))
        return better if better.sum() < whole else h

    def _margins(self, x: FloatArray) -> FloatArray:
        """Compute 1 - share of the bound for every extreme."""
        margins: FloatArray = 1.0 - self.bound_shares(np.exp(x)).ravel()
        return margins

    def _margin_slopes(self, x: FloatArray) -> FloatArray:
        """Compute the derivatives of the margins by central differences: (margins, K)."""
        offsets = LOG_STEP * np.eye(x.size)
        shares = self.bound_shares(np.exp(x + np.concatenate([offsets, -offsets])))
        rows = np.moveaxis(shares, -2, 0).reshape(2 * x.size, -1)
        slopes: FloatArray = (rows[x.size :] - rows[: x.size]).T / (2.0 * LOG_STEP)
        return slopes


def _signed_extremes(
    tables: list[tuple[FloatArray, FloatArray]], order: int
) -> list[tuple[FloatArray, FloatArray]]:
    """Compute (-lowest, highest) value of a derivative for each axis."""
    ranges = [extremes(durations_s, rows, order) for durations_s, rows in tables]
    return [(-low, high) for low, high in ranges]
