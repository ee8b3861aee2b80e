"""Pivot of a cable from its lines in several pictures: the point in which they meet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vision.line_fit import FloatArray, ImageLine

MIN_LINES = 4
OUTLIER_SIGMAS = 4.0
MIN_SCATTER_PX = 0.02
SIGMA_PER_MAD = 1.4826
ITERATIONS = 5


class MeasuredLine(NamedTuple):
    """Line of the cable in one picture, with its accuracy and the motion of the pivot."""

    line: ImageLine
    sigma_slope: float
    middle_row: float  # of the rows fitted
    shift_px: float = 0.0  # of the pivot along x, from that of the first picture, where known


class MeetingPoint(NamedTuple):
    """Meeting point of the lines."""

    at_px: tuple[float, float]
    sigma_px: tuple[float, float]  # of column and row; their errors are correlated
    scatter_px: float  # rms distance of the lines from the point, along x
    lines: int  # within the scatter
    outliers: int
    drift_px: float  # of the last third of the lines from the first third, along x


def meeting_point(measured: Sequence[MeasuredLine]) -> MeetingPoint | None:
    """Compute the point with the least squared distances from the lines; None for too few lines.

    At the middle row m of a line with slope b the column is c = x + b (m - y), linear in x and y.
    The noise of b shortens the distance m - y; its known variance is taken off (least squares with
    errors in both variables). Lines that miss the point are left out.
    """
    if len(measured) < MIN_LINES:
        return None
    slope = np.array([item.line.slope for item in measured])
    middle = float(np.median([item.middle_row for item in measured]))
    column = np.array([item.line.at(middle) - item.shift_px for item in measured])
    noise = np.array([item.sigma_slope for item in measured])
    x, reach = _start(slope, column)
    near = np.ones(len(slope), bool)
    for _ in range(ITERATIONS):
        miss = column - x - reach * slope
        scatter = max(SIGMA_PER_MAD * float(np.median(np.abs(miss))), MIN_SCATTER_PX)
        near = np.abs(miss) <= OUTLIER_SIGMAS * scatter
        if np.count_nonzero(near) < MIN_LINES:
            return None
        x, reach = _solve(slope[near], column[near], noise[near])
    miss = (column - x - reach * slope)[near]
    count = int(np.count_nonzero(near))
    rms = math.sqrt(float(miss @ miss) / max(count - 2, 1))
    used = slope[near]
    spread = math.sqrt(max(float(np.var(used) - np.mean(np.square(noise[near]))), 1e-18))
    sigma_row = rms / math.sqrt(count) / spread
    sigma_column = math.hypot(rms / math.sqrt(count), float(used.mean()) * sigma_row)
    third = max(count // 3, 1)
    drift = float(np.median(miss[-third:]) - np.median(miss[:third]))
    row = middle - reach
    return MeetingPoint((x, row), (sigma_column, sigma_row), rms, count, len(slope) - count, drift)


def _start(slope: FloatArray, column: FloatArray) -> tuple[float, float]:
    """Choose the intersection of two lines that most others pass nearest to."""
    first, second = np.triu_indices(len(slope), 1)
    apart = slope[second] - slope[first]
    wide = np.abs(apart) >= 0.5 * np.abs(apart).max()
    first, second, apart = first[wide], second[wide], apart[wide]
    reach = (column[second] - column[first]) / np.where(apart == 0.0, 1e-12, apart)
    x = column[first] - reach * slope[first]
    miss = np.abs(column - x[:, None] - reach[:, None] * slope)
    best = int(np.median(miss, axis=1).argmin())
    return float(x[best]), float(reach[best])


def _solve(slope: FloatArray, column: FloatArray, noise: FloatArray) -> tuple[float, float]:
    """Fit column = x + reach slope with noise in slope; return x and reach."""
    mean = float(slope.mean())
    spread = slope - mean
    variance = float(spread @ spread) / len(slope)
    true_variance = max(variance - float(np.mean(np.square(noise))), 0.1 * variance, 1e-18)
    reach = float(spread @ column) / len(slope) / true_variance
    return float(column.mean()) - reach * mean, reach
