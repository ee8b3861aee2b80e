"""Exact extremes of many short polynomials at once, for searches that ask for them thousands of times."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.trajectories.pieces import FloatArray

HALVINGS = 54  # of 0..1: to the last bit


class Extremes(NamedTuple):
    """Lowest and highest value of each piece: (...) both."""

    low: FloatArray
    high: FloatArray


def extremes(durations_s: FloatArray, coefficients: FloatArray, order: int) -> Extremes:
    """Of a derivative of pieces with durations (...) and ascending coefficients (..., powers)."""
    powers = np.arange(coefficients.shape[-1])
    c = coefficients * durations_s[..., None] ** (powers - order)  # on 0..1
    for _ in range(order):
        c = _slope(c)
    ends = np.broadcast_to([0.0, 1.0], (*c.shape[:-1], 2))
    values = _value(c, np.concatenate([ends, _roots(_slope(c))], axis=-1))
    return Extremes(values.min(axis=-1), values.max(axis=-1))


def _roots(c: FloatArray) -> FloatArray:
    """Where polynomials (..., powers) change sign on 0..1, ascending; in place of one outside stands an end or a turn.

    Each derivative's roots part the interval where the one before is monotone; degree 2 is met in closed form.
    """
    degree = c.shape[-1] - 1
    if degree <= 0:
        return np.zeros((*c.shape[:-1], 0))
    if degree <= 2:
        return _quadratic(c)
    turns = _roots(_slope(c))
    low = np.concatenate([np.zeros_like(turns[..., :1]), turns], axis=-1)
    high = np.concatenate([turns, np.ones_like(turns[..., :1])], axis=-1)
    rises = _value(c, high) > _value(c, low)
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        beyond = (_value(c, middle) > 0.0) == rises
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    roots: FloatArray = (low + high) / 2.0
    return roots


def _quadratic(c: FloatArray) -> FloatArray:
    """Roots of degree 1 or 2, clipped to 0..1 and ascending; complex ones give places that cost a look, no more."""
    c0, c1 = c[..., 0], c[..., 1]
    c2 = c[..., 2] if c.shape[-1] == 3 else np.zeros_like(c0)
    far = -(c1 + np.copysign(np.sqrt(np.maximum(c1**2 - 4.0 * c2 * c0, 0.0)), c1)) / 2.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        roots = np.stack([far / c2, c0 / far], axis=-1)
    return np.sort(np.clip(np.nan_to_num(roots, nan=0.0), 0.0, 1.0), axis=-1)


def _slope(c: FloatArray) -> FloatArray:
    return c[..., 1:] * np.arange(1.0, c.shape[-1])


def _value(c: FloatArray, x: FloatArray) -> FloatArray:
    out = np.broadcast_to(c[..., -1:], x.shape).copy()
    for j in range(c.shape[-1] - 2, -1, -1):
        out *= x
        out += c[..., j : j + 1]
    return out
