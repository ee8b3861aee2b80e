"""Local search for the quickest shape of a motion from rest to rest: how its time is shared among its intervals.

Slowing such a motion by a factor scales its speed, acceleration and jerk by powers of it, so a shape of any length needs
exactly max(v/vmax, sqrt(a/amax), cbrt(j/jmax)) times its own duration: N points leave N - 2 ratios to be found.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from planners.splines.extremes import extremes
from planners.trajectories.pieces import FloatArray

# durations (..., K), points (K + 1,) -> durations (..., P) and coefficients (..., P, powers) of the pieces
Shape: TypeAlias = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]

STEP = 1e-5  # of a logarithm, for central differences
RATIO = 8.0  # the logarithm of a duration moves less: 3000 times


class ShapeSearch:
    """Durations (..., K) of one law through points (K + 1, axes) under bounds by order of derivative."""

    def __init__(self, shape: Shape, points: FloatArray, bounds: dict[int, float]) -> None:
        self.shape, self.points, self.bounds = shape, points, bounds

    def loads(self, h: FloatArray) -> FloatArray:
        """Lowest (negated) and highest value of each piece as shares of the bounds: (bounds, axes, 2, ..., pieces)."""
        tables = [self.shape(h, q) for q in self.points.T]
        ranges = [[extremes(*table, order) for table in tables] for order in self.bounds]
        signed = np.array([[(-low, high) for low, high in row] for row in ranges])
        loads: FloatArray = signed / np.array(list(self.bounds.values())).reshape(
            -1, *[1] * (signed.ndim - 1)
        )
        return loads

    def scaled(self, h: FloatArray) -> FloatArray:
        """The same shapes, as fast as the bounds allow: (..., K)."""
        peaks = self.loads(h).max(axis=-1).max(axis=(1, 2))  # (bounds, ...)
        slower = np.max(
            [peak ** (1.0 / order) for order, peak in zip(self.bounds, peaks, strict=True)], axis=0
        )
        scaled: FloatArray = h * slower[..., None]
        return scaled

    def reached(self, h: FloatArray) -> dict[int, float]:
        """The largest share of each bound."""
        return {
            order: float(load.max()) for order, load in zip(self.bounds, self.loads(h), strict=True)
        }

    def polish(self, h: FloatArray) -> FloatArray:
        """The nearest local minimum: sequential quadratic programming in the logarithms, then exact scaling."""
        from scipy.optimize import minimize

        h = self.scaled(h)
        whole, start = float(h.sum()), np.log(h)

        def total(x: FloatArray) -> float:
            return float(np.exp(x).sum()) / whole

        def slope(x: FloatArray) -> FloatArray:
            return np.asarray(np.exp(x)) / whole

        margins: Any = {"type": "ineq", "fun": self._margins, "jac": self._slopes}
        options: Any = {"ftol": 1e-12, "maxiter": 200}
        bounds = [(x - RATIO, x + RATIO) for x in start.tolist()]
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
        margins: FloatArray = 1.0 - self.loads(np.exp(x)).ravel()
        return margins

    def _slopes(self, x: FloatArray) -> FloatArray:
        offsets = STEP * np.eye(x.size)
        around = np.moveaxis(self.loads(np.exp(x + np.concatenate([offsets, -offsets]))), -2, 0)
        rows = around.reshape(2 * x.size, -1)
        slopes: FloatArray = (rows[x.size :] - rows[: x.size]).T / (2.0 * STEP)
        return slopes
