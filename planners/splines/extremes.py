"""Exact extremes of many short polynomials at once, for searches with thousands of calls."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.trajectories.pieces import FloatArray

BISECTIONS = 54  # of 0..1: to the last bit


class Extremes(NamedTuple):
    """Lowest and highest value of each piece, (...) both."""

    low: FloatArray
    high: FloatArray


def extremes(durations_s: FloatArray, coefficients: FloatArray, order: int) -> Extremes:
    """Compute the extremes of a derivative of many pieces.

    Durations (...), ascending coefficients (..., powers).
    """
    powers = np.arange(coefficients.shape[-1])
    c = coefficients * durations_s[..., None] ** (powers - order)  # on 0..1
    for _ in range(order):
        c = _derivative(c)
    ends = np.broadcast_to([0.0, 1.0], (*c.shape[:-1], 2))
    values = _value(c, np.concatenate([ends, _roots(_derivative(c))], axis=-1))
    return Extremes(values.min(axis=-1), values.max(axis=-1))


def _roots(c: FloatArray) -> FloatArray:
    """Find the sign changes of polynomials (..., powers) on 0..1, ascending: (..., degree).

    Roots of the derivative split 0..1 into monotone intervals; degree 2 is solved in closed form.
    An interval without a root gives one of its ends.
    """
    degree = c.shape[-1] - 1
    if degree <= 0:
        return np.zeros((*c.shape[:-1], 0))
    if degree <= 2:
        return _quadratic(c)
    stationary = _roots(_derivative(c))
    low = np.concatenate([np.zeros_like(stationary[..., :1]), stationary], axis=-1)
    high = np.concatenate([stationary, np.ones_like(stationary[..., :1])], axis=-1)
    rising = _value(c, high) > _value(c, low)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        in_lower_half = (_value(c, middle) > 0.0) == rising
        low = np.where(in_lower_half, low, middle)
        high = np.where(in_lower_half, middle, high)
    roots: FloatArray = (low + high) / 2.0
    return roots


def _quadratic(c: FloatArray) -> FloatArray:
    """Solve degree 1 or 2, roots clipped to 0..1 and ascending.

    Complex roots give places without a sign change, which do no harm among candidates.
    """
    c0, c1 = c[..., 0], c[..., 1]
    c2 = c[..., 2] if c.shape[-1] == 3 else np.zeros_like(c0)
    discriminant = np.maximum(c1**2 - 4.0 * c2 * c0, 0.0)
    far = -(c1 + np.copysign(np.sqrt(discriminant), c1)) / 2.0  # without cancellation
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        roots = np.stack([far / c2, c0 / far], axis=-1)
    return np.sort(np.clip(np.nan_to_num(roots, nan=0.0), 0.0, 1.0), axis=-1)


def _derivative(c: FloatArray) -> FloatArray:
    return c[..., 1:] * np.arange(1.0, c.shape[-1])


def _value(c: FloatArray, x: FloatArray) -> FloatArray:
    out = np.broadcast_to(c[..., -1:], x.shape).copy()
    for j in range(c.shape[-1] - 2, -1, -1):
        out *= x
        out += c[..., j : j + 1]
    return out
